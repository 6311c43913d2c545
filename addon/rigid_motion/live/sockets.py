"""The only module that opens a socket: UDP, without waiting. In Blender an operator asks for it, nothing else.

On this machine that is always allowed; to reach others, or to be reached by them, Blender has to be allowed online.
Commands send and receive by the same ports, without Blender.
"""

from __future__ import annotations

import ipaddress
import select
import socket
from contextlib import suppress
from typing import Self, cast

MAX_DATAGRAM_BYTES = 65535
MOST_AT_ONCE = 2048
"""Datagrams that one look at a socket takes out of it: a flood does not stop the viewport."""

PENDING_BYTES = [1 << bits for bits in range(23, 15, -1)]
"""Bytes that may wait to be looked at, where a viewport is slow: as many as the system allows."""

Address = tuple[str, int]


class NotAllowed(Exception):
    """What has to be allowed first, with the way out."""


def check_access(host: str) -> None:
    """Raise NotAllowed for an address beyond this machine where Blender is to stay offline."""
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
    """A UDP port, as a context that closes it. Raises OSError where it is taken."""

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
        """Set how many bytes may be pending: Linux takes what is allowed of what is asked for, others refuse it."""
        for size in PENDING_BYTES:
            with suppress(OSError):
                self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size)
                return

    @property
    def number(self) -> int:
        return self._socket.getsockname()[1]

    def received(self, wait: float = 0.0) -> list[tuple[bytes, Address]]:
        """Return what came since the last look, or comes first within so many seconds, and from where."""
        if wait:
            select.select([self._socket], [], [], wait)
        result: list[tuple[bytes, Address]] = []
        for _ in range(MOST_AT_ONCE):
            try:
                data, (host, port, *_) = self._socket.recvfrom(MAX_DATAGRAM_BYTES)
            except BlockingIOError:
                break
            except OSError:
                continue  # what Windows says of somebody who is not there any more
            result.append((data, (host, port)))
        return result

    def send(self, data: bytes, to: Address) -> None:
        """Send a datagram; as if it had been lost where that cannot be."""
        with suppress(OSError):
            self._socket.sendto(data, to)

    def close(self) -> None:
        self._socket.close()


class Outlet(Port):
    """A port to send from, to one address."""

    def __init__(self, host: str, port: int) -> None:
        # Looked up once: a name could take seconds at every datagram.
        family, *_, to = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        self.to = cast(Address, to)
        own = ("::" if family == socket.AF_INET6 else "0.0.0.0") if not is_loopback(host) else self.to[0]
        super().__init__(own)

    def say(self, data: bytes) -> None:
        self.send(data, self.to)
