"""Rooms over Zenoh: users join, send datagrams, and listen to each other.

Keys are ROOM/USER/STREAM. A sender publishes its `motion` (best effort, sent at once) and its `skeleton` (reliable);
receivers publish `answers` to it. Every listener has a token ROOM/USER/listening/ID, which tells senders that it has
come. Everything stays on loopback without discovery, unless the user asks for more.
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
from rigid_motion_batch.places import install_command

if TYPE_CHECKING:
    import zenoh

LOOPBACK_ADDRESS, ANY_ADDRESS, ROUTER_PORT = "127.0.0.1", "0.0.0.0", 7447
"""The port is Zenoh's default."""

MOTION, SKELETON, ANSWERS, LISTENING = "motion", "skeleton", "answers", "listening"

USER = re.compile(r"[\w.-]+")
ROOM = re.compile(r"[\w.-]+(/[\w.-]+)*")

WAIT_MS, MOST_WAITING = 4000, 4096
"""How long, in milliseconds, to try an unreachable router; and how many datagrams may wait in the queue (others are
dropped, as by a network).
"""

LIMITS = {
    "connect/retry": {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5},
    "transport/link/rx/max_message_size": 1 << 16,
    # How many messages may wait to be sent before some are dropped: in a full room each datagram takes one place.
    "transport/link/tx/queue/size/data": 16,
}
"""Zenoh's settings: pauses between attempts to connect, largest incoming message in bytes, and outgoing queue."""


class Came(NamedTuple):
    """A datagram received from a room, or the end of a stream."""

    user: str
    stream: str
    datagram: bytes | None
    """None if the user has left."""


def locator(address: str) -> str:
    """Return HOST, HOST:PORT or [IPV6]:PORT in Zenoh's form; Zenoh's own forms, such as tls/HOST:PORT, stay."""
    if "/" in address:
        return address
    has_port = re.fullmatch(r"(\[[^]]*\]|[^:]*):\d+", address)
    return f"tcp/{address}" if has_port else f"tcp/{address}:{ROUTER_PORT}"


def is_local(address: str) -> bool:
    """Return whether an address (a locator or HOST:PORT) is on this machine only."""
    return is_loopback(re.sub(r"^\w+/|[?#].*$|:\d+([?#].*)?$", "", address).strip("[]"))


def settings(role: str, at: str | None, network: bool) -> dict[str, Any]:
    """Return settings for Zenoh's configuration, by key.

    On loopback the first process takes the port and connects the others. Elsewhere a router is expected.
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
    """Open a session as a `peer` or a `router`. A file of Zenoh's configuration supplies all other settings.

    Raises
    ------
    ValueError
        If Zenoh is missing, cannot read the file, or cannot reach anyone.
    """
    try:
        import zenoh
    except ImportError:
        way = install_command("stream", "stream")
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
    """One room of a session; as a context manager it closes the session. Received datagrams wait in a queue."""

    def __init__(self, session: zenoh.Session, name: str) -> None:
        self.name, self._session = name, session
        self._queue: queue.Queue[Came] = queue.Queue(MOST_WAITING)
        self._declared: dict[str, Any] = {}
        """Zenoh's publishers by key, and other declarations that Zenoh would drop without a reference."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._session.close()

    def listen(self, user: str) -> None:
        """Receive all senders from now on, and tell them that this user listens."""
        for stream in (SKELETON, MOTION):
            self._subscribe(self._session, f"*/{stream}")
        key = f"{self.name}/{user}/{LISTENING}/{self._session.zid()}"
        self._declared[key] = self._session.liveliness().declare_token(key)

    def speak(self, user: str) -> None:
        """Receive the answers to a user, and notices of present and future listeners."""
        self._subscribe(self._session, f"{user}/{ANSWERS}")
        self._subscribe(self._session.liveliness(), f"*/{LISTENING}/*", history=True)

    def _subscribe(self, to: zenoh.Session | zenoh.Liveliness, keys: str, **options: bool) -> None:
        self._declared[f"take {keys}"] = to.declare_subscriber(f"{self.name}/{keys}", self._queue_sample, **options)

    def send(self, user: str, stream: str, datagram: bytes | None) -> None:
        """Send a datagram as a user, or an answer to one; None ends the stream."""
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

    def received(self, seconds: float) -> list[Came]:
        """Return all datagrams since the last call; if there are none, wait up to `seconds` for the first."""
        result = []
        with suppress(queue.Empty):
            result.append(self._queue.get(seconds > 0.0, max(seconds, 0.0)))
            while True:
                result.append(self._queue.get_nowait())
        return result

    def _queue_sample(self, sample: zenoh.Sample) -> None:
        """Queue a received sample; called by Zenoh in its own thread."""
        user, stream, *_ = str(sample.key_expr).removeprefix(f"{self.name}/").split("/")
        datagram = None if str(sample.kind) == "SampleKind.DELETE" else sample.payload.to_bytes()
        if datagram is None or len(datagram) <= MAX_BYTES:
            with suppress(queue.Full):
                self._queue.put_nowait(Came(user, stream, datagram))
