"""Rooms, which Zenoh runs: who is there, and what they say.

Keys are ROOM/USER/STREAM. A sender says its `motion`, best effort and at once, and its `skeleton`, which is sure to
arrive; others say `answers` to it. Whoever listens has a token ROOM/USER/listening/ID, by which senders know that
somebody came. Everything stays on loopback, and nobody is looked for, unless more is asked for.
"""

from __future__ import annotations

import json
import queue
import re
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

from rigid_motion.live.sockets import is_loopback
from rigid_motion.streams.wire import MAX_BYTES
from rigid_motion_batch.places import brings

if TYPE_CHECKING:
    import zenoh

LOOPBACK_ADDRESS, ANY_ADDRESS, ROUTER_PORT = "127.0.0.1", "0.0.0.0", 7447
"""The port is Zenoh's own."""

MOTION, SKELETON, ANSWERS, LISTENING = "motion", "skeleton", "answers", "listening"

USER = re.compile(r"[\w.-]+")
ROOM = re.compile(r"[\w.-]+(/[\w.-]+)*")

WAIT_MS, MOST_WAITING = 4000, 4096
"""Milliseconds for which a router that cannot be reached is tried; and datagrams that wait to be looked at: others are
dropped, as a network does."""

LIMITS = {
    "connect/retry": {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5},
    "transport/link/rx/max_message_size": 1 << 16,
    # So many may be on the way out at once before some are dropped: in a room of many each datagram is one.
    "transport/link/tx/queue/size/data": 16,
}
"""Of Zenoh: the pauses between attempts to connect, and bytes of what is taken from others at once."""


class Came(NamedTuple):
    """What came."""

    user: str
    stream: str
    datagram: bytes | None
    """None where somebody has gone."""


def locator(address: str) -> str:
    """Return HOST, HOST:PORT or [IPV6]:PORT as Zenoh writes it; its own, such as tls/HOST:PORT, stay as they are."""
    if "/" in address:
        return address
    has_port = re.fullmatch(r"(\[[^]]*\]|[^:]*):\d+", address)
    return f"tcp/{address}" if has_port else f"tcp/{address}:{ROUTER_PORT}"


def is_local(address: str) -> bool:
    """Return whether an address, as a locator or HOST:PORT, is of this machine alone."""
    return is_loopback(re.sub(r"^\w+/|[?#].*$|:\d+([?#].*)?$", "", address).strip("[]"))


def settings(role: str, at: str | None, network: bool) -> dict[str, Any]:
    """Return what is set of Zenoh's configuration, by its keys.

    On loopback whoever comes first keeps the port, and brings the others together. Elsewhere a router is expected.
    """
    everywhere = ANY_ADDRESS if network else LOOPBACK_ADDRESS
    place = locator(at or (everywhere if role == "router" else LOOPBACK_ADDRESS))
    result: dict[str, Any] = {"mode": role, "scouting/multicast/enabled": network, **LIMITS}
    if role == "router":
        return result | {"listen/endpoints": [place]}
    result["connect/endpoints"] = [place]
    if is_local(place):
        listen = {"listen/endpoints": [place, f"tcp/{everywhere}:0"], "listen/exit_on_failure": False}
        return result | listen | {"connect/timeout_ms": 0, "connect/exit_on_failure": False}
    return result | {"mode": "client", "connect/timeout_ms": WAIT_MS, "connect/exit_on_failure": True}


def opened(role: str, at: str | None = None, network: bool = False, config: Path | None = None) -> zenoh.Session:
    """Return a session as a `peer` or a `router`. A file of Zenoh's configuration says what is not said here.

    Raises
    ------
    ValueError
        Without Zenoh, for a file that it cannot read, and where no one can be reached.
    """
    try:
        import zenoh
    except ImportError:
        way = brings("stream", "stream")
        raise ValueError(f"rooms need Zenoh, which is not installed; {way} brings it") from None
    chosen = settings(role, at, network)
    try:
        text = zenoh.Config.from_file(config) if config else zenoh.Config()
        side = f"{'listen' if role == 'router' else 'connect'}/endpoints"
        if config and not at and text.get_json(side) != zenoh.Config().get_json(side):
            chosen = settings(role, "the file's", network)
            del chosen[side]
        for key, value in chosen.items():
            text.insert_json5(key, json.dumps(value))
    except (zenoh.ZError, OSError) as error:
        raise ValueError(f"{config or at}: Zenoh does not take this: {_first_line(error)}") from None
    try:
        return zenoh.open(text)
    except zenoh.ZError as error:
        way = "is its router running, as stream router --network on that machine?"
        if role == "router":
            way = "another program may have this port, or a file is missing"
        raise ValueError(
            f"{at or config or LOOPBACK_ADDRESS}: there is no way to it ({_first_line(error)}); {way}"
        ) from None


def _first_line(error: Exception) -> str:
    return re.sub(r" at /\S+:\d+\.?", "", str(error).splitlines()[0]).strip()


class Room:
    """One room of a session, as a context that closes it. What comes waits until it is looked at."""

    def __init__(self, session: zenoh.Session, name: str) -> None:
        self.name, self._session = name, session
        self._came: queue.Queue[Came] = queue.Queue(MOST_WAITING)
        self._declared: dict[str, Any] = {}
        """Zenoh's publishers by their keys, and what it would let go otherwise."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()

    def listen(self, user: str) -> None:
        """Take what everybody sends from now on, and let senders know that a user listens."""
        for stream in (SKELETON, MOTION):
            self._subscribe(self._session, f"*/{stream}")
        key = f"{self.name}/{user}/{LISTENING}/{self._session.zid()}"
        self._declared[key] = self._session.liveliness().declare_token(key)

    def speak(self, user: str) -> None:
        """Take the answers to a user, and whoever begins to listen, or does already."""
        self._subscribe(self._session, f"{user}/{ANSWERS}")
        self._subscribe(self._session.liveliness(), f"*/{LISTENING}/*", history=True)

    def _subscribe(self, to: zenoh.Session | zenoh.Liveliness, keys: str, **options: bool) -> None:
        self._declared[f"take {keys}"] = to.declare_subscriber(f"{self.name}/{keys}", self._take, **options)

    def send(self, user: str, stream: str, datagram: bytes | None) -> None:
        """Say something as a user, or answers to one; None where the stream is over."""
        import zenoh

        key, is_sure = f"{self.name}/{user}/{stream}", stream == SKELETON
        if key not in self._declared:
            self._declared[key] = self._session.declare_publisher(
                key,
                reliability=zenoh.Reliability.RELIABLE if is_sure else zenoh.Reliability.BEST_EFFORT,
                congestion_control=zenoh.CongestionControl.DROP,
                express=not is_sure,
            )
        if datagram is None:
            self._declared[key].delete()
        else:
            self._declared[key].put(datagram)

    def come(self, seconds: float) -> list[Came]:
        """Return what came since the last call or, where that is nothing, the first thing within so many seconds."""
        result = []
        with suppress(queue.Empty):
            result.append(self._came.get(seconds > 0.0, max(seconds, 0.0)))
            while True:
                result.append(self._came.get_nowait())
        return result

    def _take(self, sample: zenoh.Sample) -> None:
        """Take what came: called by Zenoh, in a thread of its own."""
        user, stream, *_ = str(sample.key_expr).removeprefix(f"{self.name}/").split("/")
        datagram = None if str(sample.kind) == "SampleKind.DELETE" else sample.payload.to_bytes()
        if datagram is None or len(datagram) <= MAX_BYTES:
            with suppress(queue.Full):
                self._came.put_nowait(Came(user, stream, datagram))
