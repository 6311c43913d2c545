"""Hearing: many streams at one address, each shown by a receiver of its own, and what there is to say of them.

Seconds by the receiver's clock, metres.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from rigid_motion.motion import Poses, interpolate, shell_error

from .endpoints import Address
from .events import What
from .limits import QUIET, SILENCE, STREAMS, Gate
from .live import LiveReceiver
from .packets import KEY
from .receiver import Playback
from .wire import BEAT, BYE, CHALLENGE, NO_COOKIE, bye, hello, read

ASK_AGAIN = 0.5
"""Seconds until who has not been answered asks again."""

STAY = 2.0
"""Seconds after which who listens says so again, and is not forgotten."""


@dataclass(eq=False)
class Truth:
    """A recording to measure against."""

    times: np.ndarray
    """Shape (n,)."""

    poses: Poses
    """Shape (n,)."""

    radius: float = 0.1

    def errors(self, shown: Playback) -> np.ndarray:
        """The shell errors of the frames that stand for a moment of the recording, shape (k,)."""
        moments = shown.moments
        within = (moments >= self.times[0]) & (moments <= self.times[-1])
        if not within.any():
            return np.empty(0)
        truth = interpolate(self.times, self.poses, moments[within])
        return shell_error(shown.poses[within], truth, self.radius)


@dataclass(eq=False)
class Heard:
    """One stream."""

    receiver: LiveReceiver
    address: Address
    began: float
    heard: float
    """When it was, last."""

    ends: float = math.inf
    """When the end of its motion has been shown."""

    frames: int = 0
    counts: Counter = field(default_factory=Counter)
    """Of what happened, as `Playback.counts` has it."""

    measured: int = 0
    squares: float = 0.0
    largest: float = 0.0
    """Of the shell errors."""

    @property
    def rms(self) -> float:
        return math.sqrt(self.squares / self.measured) if self.measured else math.nan


class Hearing:
    """All streams that come to one address.

    Parameters
    ----------
    write : callable
        What is given the number of a stream and its next frames.
    left : callable
        What is given a stream that has ended.
    fps, margin : float
        See `LiveReceiver`.
    truth : Truth, optional
    only : Address, optional
        The only one to listen to. Otherwise everybody's streams are shown, as many as there is room for.
    """

    def __init__(
        self,
        write: Callable[[int, Playback], None],
        left: Callable[[Heard], None],
        fps: float = 72.0,
        margin: float = 0.0,
        truth: Truth | None = None,
        only: Address | None = None,
    ) -> None:
        self.heard = 0
        """Streams so far."""
        self.shown = 0
        """Frames of all of them."""
        self.damaged = 0
        """Datagrams whose checksum did not fit, or that are none of a stream."""
        self.refused = 0
        """Datagrams that were too many, of strangers, or of streams that there was no room for."""
        self._write, self._left, self._fps, self._margin, self._truth = write, left, fps, margin, truth
        self._streams: dict[int, Heard] = {}
        self._ended: dict[int, Address] = {}
        self._gate = Gate()
        self._only, self._cookie, self._asks, self._answered = only, NO_COOKIE, -math.inf, False

    @property
    def streams(self) -> int:
        """How many there are at the moment."""
        return len(self._streams)

    @property
    def over(self) -> bool:
        """Whether all streams that there were have ended."""
        return self.heard > 0 and not self._streams

    def ask(self, time: float) -> bytes | None:
        """What is to be sent to who was asked, if it is time."""
        if self._only is None or time - self._asks < (STAY if self._answered else ASK_AGAIN):
            return None
        self._asks = time
        return hello(self._cookie)

    def goodbye(self) -> bytes:
        """What is to be sent to who was asked at the end."""
        return bye()

    def accept(self, datagram: bytes, address: Address, time: float) -> None:
        """Take a datagram that came from an address at a time."""
        known = any(stream.address == address for stream in self._streams.values())
        wanted = self._only in (None, address)
        if not (wanted and self._gate.admits(address, time, known or self._only is not None)):
            self.refused += 1
            return
        message = read(datagram)
        if message is None:
            self.damaged += 1
            return
        if message.kind == CHALLENGE and self._only is not None:
            if message.cookie != self._cookie:
                self._cookie, self._asks = message.cookie, -math.inf
            return
        if message.kind not in (KEY, BEAT, BYE):
            return
        self._answered = True
        stream = self._streams.get(message.stream)
        if stream is None and message.kind == BEAT and self._has_room(message.stream, address, time):
            stream = Heard(LiveReceiver(self._fps, self._margin), address, time, time)
            self._streams[message.stream] = stream
            self.heard += 1
        if stream is None or stream.address != address:
            self.refused += message.kind != BYE
        elif message.kind == BYE:
            # A motion that ends in a hundred years ends with the delay.
            delay = stream.receiver.delay
            longest = time + stream.receiver.terms.delay + self._margin
            stream.ends = min(stream.ends, message.stamp + delay, longest)
            stream.heard = time
        elif stream.receiver.accept(datagram, time):
            stream.heard = time
        else:
            self.damaged += 1

    def show(self, time: float) -> None:
        """Show all frames up to a time, and let go of the streams that have ended or been silent for too long."""
        for number, stream in list(self._streams.items()):
            if stream.ends <= time or time - stream.heard > SILENCE:
                self._end(number, min(stream.ends, time))
            else:
                self._took(number, stream.receiver.show(time))

    def finish(self, time: float) -> None:
        """Show what there is up to a time, and no more."""
        for number in list(self._streams):
            self._end(number, time)

    def _has_room(self, number: int, address: Address, time: float) -> bool:
        if number in self._ended:
            return False
        if len(self._streams) < STREAMS:
            return True
        silent = min(self._streams, key=lambda one: self._streams[one].heard)
        if time - self._streams[silent].heard < QUIET:
            return False
        self._end(silent, time)
        return True

    def _end(self, number: int, time: float) -> None:
        stream = self._streams[number]
        self._took(number, stream.receiver.finish(time))
        del self._streams[number]
        # What still comes of it is not another one.
        self._ended[number] = stream.address
        if len(self._ended) > STREAMS:
            del self._ended[next(iter(self._ended))]
        self._left(stream)

    def _took(self, number: int, shown: Playback) -> None:
        stream = self._streams[number]
        stream.frames += len(shown.times)
        self.shown += len(shown.times)
        stream.counts.update({what: count for what, count in shown.counts.items() if count})
        if self._truth is not None and len(shown.times):
            errors = self._truth.errors(shown)
            stream.measured += len(errors)
            stream.squares += float(np.sum(errors**2))
            stream.largest = max(stream.largest, float(errors.max(initial=0.0)))
        if len(shown.times):
            self._write(number, shown)


def lines_of(stream: Heard, margin: float) -> list[str]:
    """The statistics of a stream, a line each."""
    receiver, seconds = stream.receiver, max(stream.heard - stream.began, 1e-9)
    lines = [
        f"updates: {receiver.updates}",
        f"heartbeats: {receiver.heartbeats}",
        *lines_of_bytes(receiver.bytes, receiver.pose_bytes, seconds),
        *(f"{what.value}: {stream.counts[what]}" for what in (What.LATE, What.TOO_LATE, What.LOST, What.DUPLICATE)),
        f"damaged: {stream.counts[What.DAMAGED]}",
        f"ran out: {stream.counts[What.RAN_OUT]}",
        f"frames: {stream.frames}",
    ]
    if receiver.terms is not None:
        lines.append(f"behind: {receiver.terms.delay + margin:.4g} s, besides what the link takes")
    if stream.measured:
        lines.append(f"error: {stream.rms * 1e3:.4g} mm RMS, {stream.largest * 1e3:.4g} mm at most")
    return lines


def lines_of_bytes(count: int, of_poses: int, seconds: float) -> list[str]:
    """Bytes and bytes a second, with headers and without."""
    return [
        f"bytes: {count} ({count / seconds:.0f} a second)",
        f"bytes without headers: {of_poses} ({of_poses / seconds:.0f} a second)",
        f"seconds: {seconds:.2f}",
    ]
