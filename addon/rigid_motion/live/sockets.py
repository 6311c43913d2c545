"""UDP sockets, non-blocking: the only module that opens one. In Blender only operators open sockets.

Connections within this machine are always allowed. Other machines need Blender's permission for online access.
Commands use the same ports, without Blender.
"""

from __future__ import annotations

import ipaddress
import select
import socket
from contextlib import suppress
from typing import Self, cast

MAX_DATAGRAM_BYTES = 65535
MOST_AT_ONCE = 2048
"""The most datagrams read from a socket at once, so a flood of datagrams does not block the viewport."""

PENDING_BYTES = [1 << bits for bits in range(23, 15, -1)]
"""Sizes of the receive buffer to try, in bytes: the largest that the system allows helps a slow viewport."""

Address = tuple[str, int]


class NotAllowed(Exception):
    """Raised when online access is needed but not allowed. The message says how to allow it."""


def check_access(host: str) -> None:
    """Raise NotAllowed for an address on another machine if Blender is offline."""
    import bpy
    from bpy.app.translations import pgettext_rpt as rpt_

    if not is_loopback(host) and not bpy.app.online_access:
        raise NotAllowed(
            rpt_(
                "{host} is not on this machine, and Blender is offline: "
                "turn on Preferences > System > Network > Allow Online Access, or use 127.0.0.1"
            ).format(host=host)
        )


def is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Port:
    """A UDP port, as a context manager that closes it. Raises OSError if the port is taken."""

    def __init__(self, host: str = "127.0.0.1", port: int = 0) -> None:
        self._socket = socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._allow_pending()
            self._socket.setblocking(False)
            self._socket.bind((host, port))
        except OSError:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _allow_pending(self) -> None:
        """Set the size of the receive buffer. Linux reduces a size that is too large; other systems refuse it."""
        for size in PENDING_BYTES:
            with suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
                return

    @property
    def number(self) -> int:
        return self._socket.getsockname()[1]

    def received(self, wait: float = 0.0) -> list[tuple[bytes, Address]]:
        """Return the datagrams that have arrived, with their senders. Wait up to `wait` seconds for the first one."""
        if wait:
            select.select([self._socket], [], [], wait)
        result: list[tuple[bytes, Address]] = []
        for _ in range(MOST_AT_ONCE):
            try:
                data, (host, port, *_) = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except OSError:
                continue  # Windows raises it when an earlier receiver is gone
            result.append((data, (host, port)))
        return result

    def send(self, data: bytes, to: Address) -> None:
        """Send a datagram. One that cannot be sent counts as lost."""
        with suppress(OSError):
            self._socket.sendto(data, to)

    def close(self) -> None:
        self._socket.close()


class Outlet(Port):
    """A port that sends to one address."""

    def __init__(self, host: str, port: int) -> None:
        # Looked up once: resolving a name could take seconds for every datagram.
        family, *_, to = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self.to = cast(Address, to)
        own = ("::" if family == socket.AF_INET6 else "0.0.0.0") if not is_loopback(host) else self.to[0]
        super().__init__(own)

    def say(self, data: bytes) -> None:
        self.send(data, self.to)
