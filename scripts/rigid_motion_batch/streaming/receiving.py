"""Receiving what a room sends: what a display would have shown at every frame, and the keys that came."""

from __future__ import annotations

import math
import socket
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import cast

import numpy as np

from rigid_motion.motion import Poses, shell_error
from rigid_motion.streams import Body, Receiver, Shown
from rigid_motion.streams.bodies import Forest
from rigid_motion.streams.receiver import MOST_STREAMS, Stream
from rigid_motion.streams.wire import LONGEST

from .rooms import ANSWERS, MOTION, SKELETON, Came, Room

ANSWERS_A_SECOND = 100.0
"""To all streams together."""

LINGER = 0.3
"""Seconds without anybody who sends, after somebody did, that are the end: a sender may be followed by another."""

SILENT = 10.0
"""Seconds after which a user who says nothing has gone."""


@dataclass(eq=False)
class Track:
    """What was shown of a body of a user, or its keys."""

    user: str
    body: Body
    moments: list[float] = field(default_factory=list)
    """Rising, by the sender's clock."""
    poses: list[Poses] = field(default_factory=list)
    """Shape (joints,) each."""

    def add(self, moment: float, poses: Poses) -> None:
        if not self.moments or moment > self.moments[-1]:
            self.moments.append(moment)
            self.poses.append(poses)

    def samples(self) -> tuple[np.ndarray, Poses]:
        """Return moments (n,) and poses (joints, n)."""
        parts = ([getattr(pose, part) for pose in self.poses] for part in ("positions", "quaternions"))
        return np.array(self.moments), Poses(*(np.stack(part, axis=1) for part in parts))


def errors(body: Body, shown: Poses, truth: Poses) -> np.ndarray:
    """Return how far off any point of the joints' balls is, the largest of each moment (n,), of poses (joints, n)."""
    forest = Forest([body])
    shown, truth = (forest.skeleton.in_root_space(poses) for poses in (shown, truth))
    return shell_error(shown, truth, forest.radii[:, None]).max(axis=0)


class Tracks(dict[tuple[Stream, str], Track]):
    """Those of all bodies of all streams."""

    def add(self, receiver: Receiver, stream: Stream, moment: float, poses: Mapping[str, Poses]) -> None:
        """Add the poses (joints,) of a stream's bodies at a moment."""
        for name, shown in poses.items():
            if (stream, name) not in self:
                self[stream, name] = Track(str(stream.source), cast(Body, receiver.body(stream, name)))
            self[stream, name].add(moment, shown)


class Handing:
    """Datagrams of a room to another program by UDP, from a port for each user, and its answers back."""

    def __init__(self, host: str, port: int) -> None:
        self._to = (host, port)
        self._sockets: dict[str, socket.socket] = {}

    def hand_on(self, user: str, datagram: bytes) -> None:
        if user not in self._sockets:
            family, kind, *_, address = socket.getaddrinfo(*self._to, type=socket.SOCK_DGRAM)[0]
            self._sockets[user] = socket.socket(family, kind)
            self._sockets[user].setblocking(False)
            self._sockets[user].connect(address)
        with suppress(OSError):  # As if it had been lost.
            self._sockets[user].send(datagram)

    def answers(self) -> list[tuple[str, bytes]]:
        """Return what came back, and to whom it goes."""
        result = []
        for user, own in self._sockets.items():
            with suppress(OSError):
                while True:
                    result.append((user, own.recv(LONGEST)))
        return result

    def forget(self, user: str) -> None:
        """Close the port of a user who has gone."""
        if own := self._sockets.pop(user, None):
            own.close()

    def close(self) -> None:
        for user in list(self._sockets):
            self.forget(user)


class Receiving:
    """A receiver in a room.

    Parameters
    ----------
    room : Room
    user : str
        Who listens.
    fps : float
        Frames a second of a display.
    margin : float
        Seconds that are waited longer for each datagram.
    handing : Handing, optional
    keeps : bool
        Whether what was shown, and the keys, are to be there in the end.
    """

    def __init__(
        self, room: Room, user: str, fps: float, margin: float, handing: Handing | None = None, keeps: bool = True
    ) -> None:
        self.room, self.fps, self.margin, self.handing, self.keeps = room, fps, margin, handing, keeps
        self.receiver = Receiver()
        self.shown, self.keys = Tracks(), Tracks()
        self.datagrams, self.bytes = Counter[str](), Counter[str]()
        """Counts for each user."""
        self.on_frame: list[Callable[[dict[Stream, Shown]], None]] = []
        """Called with what each frame shows."""
        self._heard: dict[str, float] = {}
        """The moments when users who are sending were heard last."""
        self._silent = math.inf
        """Since when nobody is sending, after somebody was."""
        self._answer_at = -math.inf
        for stream in (SKELETON, MOTION):
            room.listen("*", stream)
        room.show_presence(user)

    def hear(self, until: float, stopped: Sequence[int]) -> None:
        """Show what comes until a moment of `time.monotonic`, or until all who sent have gone."""
        began, frame = time.monotonic(), 0
        while not stopped and (now := time.monotonic()) < until and now - self._silent < LINGER:
            due = began + frame / self.fps
            for came in self.room.come(min(due, until) - now):
                self._take(came, time.monotonic())
            self._answer(now := time.monotonic())
            if now >= due:
                self._show(now)
                frame = math.floor((now - began) * self.fps) + 1

    def _take(self, came: Came, now: float) -> None:
        if came.datagram is None:
            self._leave(came.user)
            return
        if came.user not in self._heard and len(self._heard) == MOST_STREAMS:
            return
        self._heard[came.user], self._silent = now, math.inf
        self.datagrams[came.user] += 1
        self.bytes[came.user] += len(came.datagram)
        self.receiver.take(came.datagram, now + self.margin, came.user)
        if self.handing:
            self.handing.hand_on(came.user, came.datagram)

    def _answer(self, now: float) -> None:
        if now >= self._answer_at:
            for source, answer in self.receiver.answers():
                self.room.send(str(source), ANSWERS, answer)
            self._answer_at = now + len(self.receiver.streams) / ANSWERS_A_SECOND
        for user, answer in self.handing.answers() if self.handing else ():
            self.room.send(user, ANSWERS, answer)

    def _show(self, now: float) -> None:
        shown = self.receiver.show(now)
        for act in self.on_frame:
            act(shown)
        if self.keeps:
            self._keep(shown)
        for user in [user for user, heard in self._heard.items() if now - heard > SILENT]:
            self._leave(user)
        if self.datagrams and not self._heard and self._silent == math.inf:
            self._silent = now

    def _keep(self, shown: dict[Stream, Shown]) -> None:
        for stream, what in shown.items():
            self.shown.add(self.receiver, stream, what.moment, what.poses)
        came = self.receiver.keys()
        for keys in came:
            for row, moment in enumerate(keys.moments.tolist()):
                poses = {name: poses[row] for name, poses in keys.poses.items()}
                self.keys.add(self.receiver, keys.stream, moment, poses)

    def _leave(self, user: str) -> None:
        self._heard.pop(user, None)
        if self.handing:
            self.handing.forget(user)
