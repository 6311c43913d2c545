"""Playing: a source to all who are to hear it, those that were named and those that asked, with heartbeats.

Seconds by the clock of the source.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from .endpoints import Address
from .limits import QUIET, SILENCE, STREAMS, Cookies, Gate
from .relay import Outgoing
from .sources import Source
from .wire import BYE, CHALLENGE, HELLO, beat, bye, challenge, hello, pose_bytes, read

HEARTBEAT = 0.5
"""Seconds of silence after which a heartbeat is sent."""

ANSWERED = 0.25
"""Seconds within which one challenge of an address is answered."""


class Playing:
    """What is to be sent to whom.

    Parameters
    ----------
    source : Source
    stream : int
        Its number.
    heartbeat : float
    receivers : iterable of Address
        Who hears it from the beginning, asked or not. Others are welcome who say hello.
    """

    def __init__(
        self, source: Source, stream: int, heartbeat: float = HEARTBEAT, receivers: Iterable[Address] = ()
    ) -> None:
        self.stream, self.updates, self.heartbeats = stream, 0, 0
        self.datagrams = self.bytes = self.pose_bytes = 0
        """Of updates and heartbeats, to everybody who hears them."""
        self._source, self._heartbeat = source, heartbeat
        self._given = tuple(dict.fromkeys(receivers))
        self._asked: dict[Address, float] = {}
        """Who said hello besides, and when last."""
        self._answered: dict[Address, float] = {}
        self._gate, self._cookies = Gate(), Cookies()
        self._newest, self._stamp, self._sent = b"", 0.0, -math.inf

    @property
    def receivers(self) -> tuple[Address, ...]:
        """Who hears it at the moment."""
        return (*self._given, *self._asked)

    def next(self) -> float:
        """When there is something to do."""
        return min(self._source.next(), self._sent + self._heartbeat if self._newest else math.inf)

    def due(self, time: float) -> Outgoing:
        """What is due by a time."""
        for address, heard in list(self._asked.items()):
            if time - heard > SILENCE:
                del self._asked[address]
        datagrams = []
        for key in self._source.due(time):
            begins, self._newest, self._stamp = not self._newest, key, read(key).stamp
            datagrams.append(self._beat(time) if begins else key)
            self.updates += 1
        if not datagrams and self._newest and time - self._sent >= self._heartbeat:
            datagrams.append(self._beat(time))
            self.heartbeats += 1
        if datagrams:
            self._sent = time
        return self._counted([(datagram, address) for datagram in datagrams for address in self.receivers])

    def last_beat(self, time: float) -> Outgoing:
        """A heartbeat at the end, so that the last key is there even if it was lost."""
        self.heartbeats += bool(self._newest)
        return self._counted([(self._beat(time), address) for address in self.receivers] if self._newest else [])

    def goodbye(self, time: float) -> Outgoing:
        """The end of the stream, for everybody."""
        return [(bye(self.stream, max(self.updates - 1, 0), time), address) for address in self.receivers]

    def accept(self, datagram: bytes, address: Address, time: float) -> Outgoing:
        """Take a datagram, and say what is to be sent for it."""
        message = read(datagram) if self._gate.admits(address, time, address in self.receivers) else None
        if message is None:
            return []
        if message.kind == CHALLENGE and address in self._given:
            if time - self._answered.get(address, -math.inf) < ANSWERED:
                return []
            self._answered[address] = time
            return [(hello(message.cookie), address), *self._state(address, time)]
        if message.kind == BYE and message.stream == 0:
            self._asked.pop(address, None)
        if message.kind != HELLO:
            return []
        if not self._cookies.fits(address, message.cookie):
            return [(challenge(self._cookies.of(address)), address)]
        is_new = address not in self.receivers
        if is_new and len(self._asked) >= STREAMS:
            silent = min(self._asked, key=self._asked.get)
            if time - self._asked[silent] < QUIET:
                return []
            del self._asked[silent]
        if address not in self._given:
            self._asked[address] = time
        return self._state(address, time) if is_new else []

    def _state(self, address: Address, time: float) -> Outgoing:
        return self._counted([(self._beat(time), address)] if self._newest else [])

    def _beat(self, time: float) -> bytes:
        return beat(self._newest, self._source.terms, time - self._stamp)

    def _counted(self, outgoing: Outgoing) -> Outgoing:
        for datagram, _ in outgoing:
            self.datagrams += 1
            self.bytes += len(datagram)
            self.pose_bytes += pose_bytes(read(datagram))
        return outgoing
