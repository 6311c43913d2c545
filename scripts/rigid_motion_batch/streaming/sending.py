"""Sending recordings into a room: all bodies by one sender, in real time."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import conjugate, multiply
from rigid_motion.streams import Body, Sender
from rigid_motion.streams.bodies import RADIUS
from rigid_motion.streams.paths import Path
from rigid_motion.streams.sender import KEEPALIVE
from rigid_motion.streams.wire import DESCRIPTION, kind_of
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip

from .measuring import even_rate
from .rooms import ANSWERS, LISTENING, MOTION, SKELETON, Came, Room

SLIDES = 1e-4
"""Metres by which a joint has to change its place in its parent's space to be sent with it."""

LOOK = 0.02
"""Seconds after which a loop looks up, whatever comes or does not."""

ALMOST = 0.9
"""Part of the interval of an even stream after which a key is due."""

AGAIN = 0.03
"""Seconds after which the description is sent again; many may ask for it at once."""

AFTER = 0.3
"""Seconds for which a sender stays behind the end, beside the delay: what was lost is asked for."""


def samples_of(clip: Clip) -> tuple[np.ndarray, Poses]:
    """Return the moments (n,) of a clip and its poses (joints, n), in metres and Blender's axes.

    Of a file whose keys are not at its frames those are what it shows at its frames.
    """
    poses = to_blender(clip.in_metres(clip.poses), clip.axes)
    positions, quaternions = (part if part.ndim == 3 else part[None] for part in (poses.positions, poses.quaternions))
    times, poses = clip.times, Poses(positions, quaternions)
    if clip.rate and len(times) != round((times[-1] - times[0]) * clip.rate) + 1:
        even = np.arange(times[0], times[-1] + 0.01 / clip.rate, 1.0 / clip.rate)
        return even, Path(times, poses).at(even)
    return times, poses


def body_of(clip: Clip, poses: Poses, radius: float = RADIUS) -> Body:
    """Return what is streamed of a clip. A rigid body is at rest as in its first sample."""
    if clip.rest_body is None:
        return Body.rigid(clip.name, poses[:, 0], radius)
    parents, turns = clip.rest_body.parents, to_blender(clip.rest_body.rest, clip.axes).quaternions
    turns = np.where((parents >= 0)[:, None], multiply(conjugate(turns[parents]), turns), turns)
    sliding = np.ptp(poses.positions, axis=1).max(axis=1) > SLIDES
    rest = Poses(poses.positions[:, 0], turns)
    return Body(clip.name, clip.rest_body.joints, parents, rest, radius, sliding | (parents < 0))


def together(clips: Sequence[Clip], rate: float | None = None) -> tuple[list[Body], np.ndarray, Poses]:
    """Return the bodies of clips that begin together, their moments (n,), and the poses (joints, n) of all.

    The moments are those of the first clip where all have the same or it is alone, or else even ones: so many a second,
    or as many as the fastest has. A clip that is over stays as it is.
    """
    samples = [samples_of(clip) for clip in clips]
    bodies = [body_of(clip, poses) for clip, (_, poses) in zip(clips, samples, strict=True)]
    moments = first = samples[0][0]
    if rate or not all(np.array_equal(times, first) for times, _ in samples[1:]):
        rate = rate or max(clip.samples_a_second for clip in clips)
        seconds = max(times[-1] - times[0] for times, _ in samples)
        moments = first[0] + np.arange(int(seconds * rate + 1e-6) + 1) / rate
    shown = [
        Path(times, poses).at(np.clip(moments - first[0] + times[0], times[0], times[-1])) for times, poses in samples
    ]
    return bodies, moments, joined(shown)


def sender_of(bodies: list[Body], moments: np.ndarray, tolerance: float, delay: float, rate: float | None) -> Sender:
    """Return a sender that says what is needed or, with a rate, a key at each of its ticks."""
    even = even_rate(moments) if len(moments) > 1 else None
    return Sender(bodies, tolerance, delay, rate or even, ALMOST / rate if rate else KEEPALIVE)


class Sending:
    """A sender in a room, under the name of a user."""

    def __init__(self, room: Room, user: str, sender: Sender) -> None:
        self.room, self.user, self.sender = room, user, sender
        self.datagrams = self.bytes = self.joined = 0
        self._described = -math.inf
        room.listen(user, ANSWERS)
        room.watch_presence()

    def say(self, datagrams: Iterable[bytes]) -> None:
        """Send datagrams, and count them."""
        for datagram in datagrams:
            self.room.send(self.user, SKELETON if kind_of(datagram) == DESCRIPTION else MOTION, datagram)
            self.datagrams += 1
            self.bytes += len(datagram)

    def take(self, came: Came, now: float) -> None:
        """Deal with an answer, or with a receiver that joins, at a time of the motion."""
        said = []
        if came.stream == LISTENING and came.datagram is not None:
            self.joined += 1
            said = self.sender.join()
        elif came.stream == ANSWERS and came.datagram:
            said = self.sender.hear(came.datagram, now)
        if said and now - self._described > AGAIN:
            self._described = now
            self.say(said)

    def until(self, moment: float, clock: Callable[[], float], stopped: Sequence[int]) -> None:
        """Wait for a moment of the motion, and meanwhile answer and say what is due without a sample."""
        while not stopped and (now := clock()) < moment:
            for came in self.room.come(min(moment - now, max(self.sender.next - now, 0.0), LOOK)):
                self.take(came, clock())
            if self.sender.next <= (now := clock()) < moment:
                self.say(self.sender.poll(now))


def play(
    sending: Sending,
    moments: np.ndarray,
    poses: Poses,
    delay: float,
    stopped: Sequence[int],
    reach: Callable[[float], None] = lambda _: None,
) -> float:
    """Send samples (n,) of poses (joints, n) when they are due, and return the seconds that were sent."""
    began = time.monotonic() - float(moments[0])

    def clock() -> float:
        return time.monotonic() - began

    for sample, moment in enumerate(moments.tolist()):
        sending.until(moment, clock, stopped)
        if stopped:
            break
        for came in sending.room.come(0.0):
            sending.take(came, moment)
        sending.say(sending.sender.add(moment, poses[:, sample]))
        reach(moment - float(moments[0]))
    seconds = clock() - float(moments[0])
    if not stopped:
        sending.say(sending.sender.finish())
        sending.until(float(moments[-1]) + delay + AFTER, clock, stopped)
    sending.room.leave(sending.user, MOTION)
    return seconds
