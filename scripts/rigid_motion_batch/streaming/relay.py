"""The relay: one room for many users, where everybody's datagrams go to all others.

It opens no datagram but for its header. Whoever comes gets the newest of each stream at once. Somebody is in the room
only after answering a challenge, so that nobody can have the relay flood a third party, and until they have been silent
for `SILENCE`. Seconds by the relay's clock.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from .endpoints import Address
from .limits import QUIET, SILENCE, STREAMS, Cookies, Gate
from .packets import KEY
from .wire import BEAT, BYE, HELLO, Message, challenge, changed, read

USERS = 2 * STREAMS
"""In a room: of each stream who sends it, and as many who only listen."""

GONE = 64
"""Users who are remembered for the statistics when they have gone."""

Outgoing = list[tuple[bytes, Address]]


@dataclass(eq=False)
class User:
    """Somebody in the room, or who has been."""

    address: Address
    heard: float
    """When, last."""

    datagrams_in: int = 0
    bytes_in: int = 0
    datagrams_out: int = 0
    bytes_out: int = 0


@dataclass(eq=False)
class Stream:
    """What somebody sends, and the newest of it."""

    owner: Address
    heard: float
    newest: dict[int, tuple[bytes, Message, float]] = field(default_factory=dict)
    """Of each kind, KEY and BEAT, the newest, what it says, and when it came. Nothing once the stream has ended."""


class Relay:
    """A room: what is to be sent to whom, for every datagram that comes."""

    def __init__(self) -> None:
        self.users: dict[Address, User] = {}
        self.gone: deque[User] = deque(maxlen=GONE)
        self.refused = 0
        """Datagrams that were damaged, of strangers, too many, or somebody else's."""
        self._streams: dict[int, Stream] = {}
        self._gate = Gate()
        self._cookies = Cookies()

    @property
    def streams(self) -> int:
        """How many streams there are at the moment, those among them that have ended a moment ago."""
        return len(self._streams)

    def accept(self, datagram: bytes, address: Address, time: float) -> Outgoing:
        """Take a datagram, and say which are to be sent to whom."""
        user = self.users.get(address)
        message = read(datagram) if self._gate.admits(address, time, user is not None) else None
        if message is None:
            self.refused += 1
            return []
        if message.kind == HELLO and self._cookies.fits(address, message.cookie):
            return self._count_out(self._welcome(datagram, address, time))
        if message.kind == HELLO or (user is None and message.kind in (KEY, BEAT)):
            return [(challenge(self._cookies.of(address)), address)]
        if user is None or message.kind not in (KEY, BEAT, BYE):
            self.refused += 1
            return []
        _count_in(user, datagram, time)
        if message.kind == BYE and message.stream == 0:
            self._leave(address)
            return []
        if not self._is_theirs(message, address, time):
            self.refused += 1
            return []
        newest = self._streams[message.stream].newest
        if message.kind == BYE:
            newest.clear()
        elif message.kind not in newest or message.sequence >= newest[message.kind][1].sequence:
            newest[message.kind] = (datagram, message, time)
        return self._count_out([(datagram, other) for other in self.users if other != address])

    def forget(self, time: float) -> None:
        """Forget who has been silent for too long."""
        for address, user in list(self.users.items()):
            if time - user.heard > SILENCE:
                self._leave(address)
        for number, stream in list(self._streams.items()):
            if time - stream.heard > SILENCE:
                del self._streams[number]

    def _welcome(self, datagram: bytes, address: Address, time: float) -> Outgoing:
        """Let somebody in who is not in yet, and give them what is newest."""
        if address in self.users:
            _count_in(self.users[address], datagram, time)
            return []
        if len(self.users) >= USERS:
            silent = min(self.users.values(), key=lambda user: user.heard)
            if time - silent.heard < QUIET:
                self.refused += 1
                return []
            self._leave(silent.address)
        self.users[address] = User(address, time)
        _count_in(self.users[address], datagram, time)
        state = []
        for stream in self._streams.values():
            beat, key = stream.newest.get(BEAT), stream.newest.get(KEY)
            # Without its terms nothing of a stream can be shown.
            some = [] if beat is None else [beat] if key is None or key[1].sequence <= beat[1].sequence else [beat, key]
            for datagram_, message, came in some:
                state.append((changed(datagram_, age=message.age + time - came), address))
        return state

    def _is_theirs(self, message: Message, address: Address, time: float) -> bool:
        """Whether a stream is that of the user at an address; a new one is, where there is room."""
        stream = self._streams.get(message.stream)
        if stream is None:
            if message.kind == BYE:
                return False
            if len(self._streams) >= STREAMS:
                number, silent = min(self._streams.items(), key=lambda one: (bool(one[1].newest), one[1].heard))
                if silent.newest and time - silent.heard < QUIET:
                    return False
                del self._streams[number]
            stream = self._streams[message.stream] = Stream(address, time)
        if stream.owner != address:
            return False
        stream.heard = time
        return True

    def _leave(self, address: Address) -> None:
        self.gone.append(self.users.pop(address))

    def _count_out(self, outgoing: Outgoing) -> Outgoing:
        for datagram, address in outgoing:
            self.users[address].datagrams_out += 1
            self.users[address].bytes_out += len(datagram)
        return outgoing


def _count_in(user: User, datagram: bytes, time: float) -> None:
    user.heard = time
    user.datagrams_in += 1
    user.bytes_in += len(datagram)
