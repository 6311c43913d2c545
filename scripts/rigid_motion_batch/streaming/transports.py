"""Transports: what carries datagrams. Others need the same two methods."""

from __future__ import annotations

import select
import socket
from typing import Protocol, Self

from rigid_motion.streams.wire import DESCRIPTION, LONGEST, kind_of

LOOPBACK = "127.0.0.1"

HEADERS = 28
"""Bytes of UDP and IPv4 in front of every datagram."""

PENDING = 1 << 20
"""Bytes that the system keeps of what was not read yet."""


class Transport(Protocol):
    """What carries datagrams to whoever listens, and what they answer back."""

    def send(self, datagram: bytes) -> None: ...

    def received(self) -> list[bytes]: ...


class Udp:
    """A socket on loopback, as a context. Datagrams go to `to`, or to where the last one came from."""

    def __init__(self, to: tuple[str, int] | None = None) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind((LOOPBACK, 0))
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, PENDING)
        self._socket.setblocking(False)
        self._to = to

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    @property
    def port(self) -> int:
        return self._socket.getsockname()[1]

    def send(self, datagram: bytes) -> None:
        if self._to:
            try:
                self._socket.sendto(datagram, self._to)
            except OSError:
                return  # As if it had been lost.

    def received(self) -> list[bytes]:
        datagrams: list[bytes] = []
        while True:
            try:
                datagram, sender = self._socket.recvfrom(LONGEST)
            except BlockingIOError:
                return datagrams
            except OSError:
                continue  # What Windows says of somebody who is not there any more.
            self._to = self._to or sender
            datagrams.append(datagram)

    def awaited(self, seconds: float) -> list[bytes]:
        """Return what came, or comes within so many seconds: one datagram."""
        if not select.select([self._socket], [], [], seconds)[0]:
            return []
        datagram, sender = self._socket.recvfrom(LONGEST)
        self._to = self._to or sender
        return [datagram]


class Counted:
    """A transport, and what went through it."""

    def __init__(self, transport: Transport) -> None:
        self._transport = transport
        self.datagrams = self.bytes = self.lost = 0
        self.joining_datagrams = self.joining_bytes = 0
        """The descriptions among those."""

    def count(self, datagram: bytes) -> None:
        """Count a datagram that is sent, whether or not it arrives."""
        self.datagrams += 1
        self.bytes += len(datagram)
        if kind_of(datagram) == DESCRIPTION:
            self.joining_datagrams += 1
            self.joining_bytes += len(datagram)

    def send(self, datagram: bytes) -> None:
        self._transport.send(datagram)

    def received(self) -> list[bytes]:
        return self._transport.received()
