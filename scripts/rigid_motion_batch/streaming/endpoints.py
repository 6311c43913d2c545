"""Endpoints: UDP addresses as people write them, and sockets that neither wait nor complain of what strangers do."""

from __future__ import annotations

import errno
import ipaddress
import re
import selectors
import socket
from collections.abc import Iterable, Iterator
from typing import Self

from .wire import LARGEST

Address = tuple
"""Of a socket: (host, port), and for IPv6 two numbers more."""

LOOPBACK = "127.0.0.1"

AT_ONCE = 256
"""Datagrams that are taken before anything else is looked at."""

PASSING = {errno.EAGAIN, errno.EWOULDBLOCK, errno.ENOBUFS, errno.ECONNREFUSED, errno.ECONNRESET, errno.EMSGSIZE}
"""What a socket may say of one datagram, and be as good as before."""


class EndpointError(ValueError):
    """An address that cannot be had, with the way out."""


def address_of(text: str) -> Address:
    """The address of HOST:PORT, or of [HOST]:PORT for IPv6. Raises EndpointError."""
    found = re.fullmatch(r"(?:\[([^\[\]]+)\]|([^:\[\]\s]+)):(\d{1,5})", text, re.ASCII)
    if not found:
        raise EndpointError(f"{text!r} is no address; write HOST:PORT, such as 127.0.0.1:9000 or [::1]:9000")
    port = int(found[3])
    if not 1 <= port <= 65535:
        raise EndpointError(f"{text!r} has no port from 1 to 65535")
    return _resolved(found[1] or found[2], port)[1]


def shown(address: Address) -> str:
    """An address as one writes it."""
    host, port = address[:2]
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def is_loopback(address: Address) -> bool:
    """Whether an address is of this machine alone."""
    return ipaddress.ip_address(address[0].partition("%")[0]).is_loopback


class Endpoint:
    """UDP sockets, one of each family that is needed, as a context.

    Parameters
    ----------
    hosts : iterable of str
        Addresses of this machine, one of a family at the most.
    port : int
        0 for one that is free.

    Raises
    ------
    EndpointError
        Where one is no address of this machine, or its port is taken.
    """

    def __init__(self, hosts: Iterable[str], port: int) -> None:
        self._selector = selectors.DefaultSelector()
        self._sockets: dict[int, socket.socket] = {}
        self.unsent = 0
        """Datagrams that the system did not take."""
        try:
            for host in hosts:
                self._bind(host, port)
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Give the ports back."""
        for own in self._sockets.values():
            own.close()
        self._selector.close()

    @property
    def addresses(self) -> list[Address]:
        """Where it is heard."""
        return [_plain(own.getsockname()) for own in self._sockets.values()]

    def send(self, datagram: bytes, address: Address) -> bool:
        """Send a datagram, and say whether the system took it. It is lost otherwise, as it may be on the way."""
        own = self._sockets.get(_family(address))
        try:
            sent = own is not None and own.sendto(datagram, address) == len(datagram)
        except OSError:
            sent = False
        self.unsent += not sent
        return sent

    def receive(self, wait: float) -> Iterator[tuple[bytes, Address]]:
        """The datagrams that are there, or come within so many seconds: not very many at once.

        One that is longer than any of a stream is cut off behind the first byte too many.
        """
        for key, _ in self._selector.select(max(wait, 0.0)):
            for _ in range(AT_ONCE):
                try:
                    datagram, address = key.fileobj.recvfrom(LARGEST + 1)
                except OSError as error:
                    if error.errno in (errno.EAGAIN, errno.EWOULDBLOCK):
                        break
                    if error.errno not in PASSING and getattr(error, "winerror", 0) not in (10040, 10052, 10054):
                        raise
                    continue
                yield datagram, _plain(address)

    def _bind(self, host: str, port: int) -> None:
        family, address = _resolved(host, port, passive=True)
        own = socket.socket(family, socket.SOCK_DGRAM)
        self._sockets[family] = own
        own.setblocking(False)
        if family == socket.AF_INET6:
            own.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
        try:
            own.bind(address)
        except OSError as error:
            raise EndpointError(_why_not(error, host, port)) from None
        self._selector.register(own, selectors.EVENT_READ)


def _why_not(error: OSError, host: str, port: int) -> str:
    if error.errno == errno.EADDRINUSE:
        return f"port {port} of {host} is in use by another program; choose another --port, or 0 for one that is free"
    if error.errno == errno.EADDRNOTAVAIL:
        return (
            f"this machine has no address {host}; --bind takes one of its own: {LOOPBACK} or ::1 to be heard on this "
            "machine alone, 0.0.0.0 or :: on all its networks"
        )
    if error.errno in (errno.EACCES, errno.EPERM):
        return f"port {port} of {host} is not for everybody; choose a --port from 1024 on"
    return f"{host}, port {port}: {error.strerror or error}"


def _resolved(host: str, port: int, passive: bool = False) -> tuple[int, Address]:
    """The family and the address of a host, IPv4 where it has both. Raises EndpointError."""
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM, flags=socket.AI_PASSIVE if passive else 0)
    except (OSError, UnicodeError):
        raise EndpointError(f"there is no host {host!r}; give its name or address, such as {LOOPBACK}") from None
    found = [one for one in found if one[0] in (socket.AF_INET, socket.AF_INET6)]
    if not found:
        raise EndpointError(f"the host {host!r} has neither an IPv4 nor an IPv6 address")
    family, *_, address = min(found, key=lambda one: one[0] != socket.AF_INET)
    return family, _plain(address)


def _family(address: Address) -> int:
    return socket.AF_INET if len(address) == 2 else socket.AF_INET6


def _plain(address: Address) -> Address:
    """The same for every datagram of one sender: without the name of the interface, which its number says too."""
    return (address[0].partition("%")[0], *address[1:])
