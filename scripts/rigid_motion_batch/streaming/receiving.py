"""Receiving the streams of a room: the poses that a display would show at every frame, and the received keys."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence

from rigid_motion.live.sockets import Address, Outlet
from rigid_motion.streams import Receiver, Shown
from rigid_motion.streams.playing import MAX_SILENCE_S
from rigid_motion.streams.receiver import MOST_STREAMS

from .rooms import ANSWERS, Came, Room

ANSWERS_A_SECOND = 100.0
"""The most answers per second, to all streams together."""

LINGER_S = 0.3
"""How long, in seconds, to wait for another sender after all have left and everything has been shown."""


class Receiving:
    """A receiver in a room, itself a user there.

    It shows `fps` frames per second, and delays each datagram by `margin` seconds. If an address `to` is given, it also
    forwards all datagrams there by UDP, from one port for each user, and returns the answers. With `steady` it reduces
    jitter.
    """

    def __init__(
        self, room: Room, user: str, fps: float, margin: float, to: Address | None = None, steady: bool = False
    ) -> None:
        self._room, self._fps, self._margin, self._forward_to = room, fps, margin, to
        self.receiver = Receiver(steady=steady)
        self.datagrams, self.bytes = Counter[str](), Counter[str]()
        """Counts by user."""
        self.on_frame: list[Callable[[Iterable[Shown]], None]] = []
        """Called with the poses of each frame."""
        self._outlets: dict[str, Outlet] = {}
        self._heard: dict[str, float] = {}
        """When each sending user was last heard."""
        self._last_heard = self._answer_at = -math.inf
        """When the last datagram came, and when the next answers are due."""
        room.listen(user)

    def listen_until(self, until: float, stopped: Sequence[int]) -> None:
        """Show received motion until a moment of `time.monotonic`, or until all senders have left."""
        began, frame = time.monotonic(), 0
        while not stopped and (now := time.monotonic()) < until:
            if self._last_heard > -math.inf and not self._heard and now - self._last_heard > LINGER_S + self._margin:
                break
            due = began + frame / self._fps
            for came in self._room.received(min(due, until) - now):
                self._take(came, time.monotonic())
            self._answer(now := time.monotonic())
            if now >= due:
                self._show(now)
                frame = math.floor((now - began) * self._fps) + 1

    def _take(self, came: Came, now: float) -> None:
        user, datagram, self._last_heard = came.user, came.datagram, now
        if datagram is None:
            self._forget(user)
        elif user in self._heard or len(self._heard) < MOST_STREAMS:
            self._heard[user] = now
            self.datagrams[user] += 1
            self.bytes[user] += len(datagram)
            self.receiver.take(datagram, now + self._margin, user)
            if self._forward_to:
                if user not in self._outlets:
                    self._outlets[user] = Outlet(*self._forward_to)
                self._outlets[user].say(datagram)

    def _answer(self, now: float) -> None:
        if now >= self._answer_at:
            for source, answer in self.receiver.answers():
                self._room.send(str(source), ANSWERS, answer)
            self._answer_at = now + len(self.receiver.streams) / ANSWERS_A_SECOND
        for user, outlet in self._outlets.items():
            for answer, _ in outlet.received():
                self._room.send(user, ANSWERS, answer)

    def _show(self, now: float) -> None:
        shown = list(self.receiver.show(now).values())
        for act in self.on_frame:
            act(shown)
        for user in [user for user, heard in self._heard.items() if now - heard > MAX_SILENCE_S]:
            self._forget(user)

    def _forget(self, user: str) -> None:
        self._heard.pop(user, None)
        self.receiver.leave(user)
        if outlet := self._outlets.pop(user, None):
            outlet.close()

    def close(self) -> None:
        """Close the ports of all users."""
        for user in list(self._outlets):
            self._forget(user)
