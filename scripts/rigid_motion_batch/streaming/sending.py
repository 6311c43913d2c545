"""Sending recordings and performers in real time: one sender for all bodies."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.humanoid import relative_to_followed
from rigid_motion.motion.poses import joined
from rigid_motion.streams import Sender, StreamBody
from rigid_motion.streams.bodies import DEFAULT_RADIUS_M
from rigid_motion.streams.paths import KnotPath
from rigid_motion.streams.wire import Description, read
from rigid_motion_batch.analysis.held import find_held
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import TYPICAL_HEIGHT_M, ZERO_SIZE, size_of

from .rooms import ANSWERS, LISTENING, MOTION, SKELETON, Room

MIN_SLIDE_M = 1e-4
"""How far, in metres, a joint must move in its parent's space for its position to be sent."""

Hand = tuple[str, str | None]
"""A holder: a body and the joint that holds; the joint is None for a body with a single root."""

LOOK_S, REPEAT_S, STAY_AFTER_S = 0.02, 0.03, 0.3
"""In seconds: the longest wait of a loop; the pause before the description is sent again, since many receivers may ask
at once; and how long a sender stays after the end (plus the delay), to answer requests for lost datagrams.
"""


def samples_of(clip: Clip) -> tuple[np.ndarray, Poses]:
    """Return the times (n,) of a clip and its poses (joints, n), in metres and Blender's axes.

    If the keys of a file are not on its frames, the samples are its poses on the frames.
    """
    poses = clip.in_blender(clip.poses)
    times, poses = clip.times, poses if len(poses.shape) == 2 else poses[None]
    if clip.rate and len(times) != round((times[-1] - times[0]) * clip.rate) + 1:
        even = np.arange(times[0], times[-1] + 0.01 / clip.rate, 1.0 / clip.rate)
        return even, KnotPath(times, poses).at(even)
    return times, poses


def radii_of(clip: Clip) -> np.ndarray:
    """Return the radii in metres of the balls at the joints of a whole body, shape (joints,).

    They are an adult's in proportion to the figure, enlarged to the ends of bones that the file has.
    """
    figure, ends = clip.whole_body, clip.whole_body.ends
    size = size_of(figure.parents, figure.rest.positions)
    ball = DEFAULT_RADIUS_M / TYPICAL_HEIGHT_M * size if size > ZERO_SIZE else DEFAULT_RADIUS_M / clip.metres_per_unit
    return np.maximum(np.zeros(clip.joints) if ends is None else ends, ball) * clip.metres_per_unit


def body_of(clip: Clip, poses: Poses, radius: float | None = None) -> StreamBody:
    """Return the stream body of a clip, with the clip's own radii if none is given.

    The rest pose of a rigid body is its first sample.
    """
    if clip.rest_body is None:
        return StreamBody.rigid(clip.name, poses[:, 0], radius or DEFAULT_RADIUS_M)
    radii = radii_of(clip) if radius is None else radius
    parents = clip.rest_body.parents
    turns = relative_to_followed(to_blender(clip.rest_body.rest, clip.axes), parents).quaternions
    sliding = np.ptp(poses.positions, axis=1).max(axis=1) > MIN_SLIDE_M
    rest = Poses(poses.positions[:, 0], turns)
    return StreamBody(clip.name, clip.rest_body.joints, parents, rest, radii, sliding | (parents < 0))


def starting_together(
    clips: Sequence[Clip], rate: float | None = None, radius: float | None = None
) -> tuple[list[StreamBody], np.ndarray, Poses]:
    """Return the bodies of clips that begin together, their times (n,), and the poses (joints, n) of all.

    The times are those of the first clip if all clips share them or it is alone. Otherwise they are evenly spaced, at
    `rate` or the highest rate of the clips. A clip that has ended keeps its last pose.
    """
    samples = [samples_of(clip) for clip in clips]
    bodies = [body_of(clip, poses, radius) for clip, (_, poses) in zip(clips, samples, strict=True)]
    moments = first = samples[0][0]
    if rate or not all(np.array_equal(times, first) for times, _ in samples[1:]):
        rate = rate or max(clip.samples_a_second for clip in clips)
        seconds = max(times[-1] - times[0] for times, _ in samples)
        moments = first[0] + np.arange(int(seconds * rate + 1e-6) + 1) / rate
    shown = [
        KnotPath(times, poses).at(np.minimum(moments - first[0] + times[0], times[-1])) for times, poses in samples
    ]
    return bodies, moments, joined(shown)


def hand_of(text: str) -> Hand:
    """Parse BODY or BODY:JOINT."""
    body, _, joint = text.partition(":")
    return body, joint or None


def found_held(clips: Sequence[Clip]) -> list[tuple[str, Hand]]:
    """Return the rigid bodies that others hold during the whole recording, with their holders, as detected."""
    rigid = [clip for clip in clips if clip.rest_body is None]
    return [(rigid[held].name, (rigid[holder].name, None)) for holder, held in find_held(rigid, DEFAULT_RADIUS_M)]


def even_rate(times: np.ndarray) -> float | None:
    """Return the sampling rate in samples per second; None if it is not a whole number."""
    rate = 1.0 / float(np.median(np.diff(times))) if len(times) > 1 else 0.5
    return float(round(rate)) if abs(rate - round(rate)) < 0.01 else None


class RoomSending:
    """A sender in a room, under a user's name."""

    def __init__(self, room: Room, user: str, sender: Sender, ahead: float = 0.0) -> None:
        self.room, self.user, self.sender, self.ahead = room, user, sender, ahead
        """`ahead`: how many seconds the clock of the motion is ahead of `time.monotonic`."""
        self.datagrams = self.bytes = self.joined = 0
        self._described = -math.inf
        room.speak(user)

    @property
    def now(self) -> float:
        """The current time of the motion, in seconds."""
        return time.monotonic() + self.ahead

    def say(self, datagrams: Iterable[bytes]) -> None:
        """Send datagrams, and count them."""
        for datagram in datagrams:
            stream = SKELETON if isinstance(read(datagram), Description) else MOTION
            self.room.send(self.user, stream, datagram)
            self.datagrams += 1
            self.bytes += len(datagram)

    def answer(self, seconds: float) -> None:
        """Wait this long for answers and joining receivers, and respond to them."""
        for came in self.room.received(seconds):
            said = []
            if came.stream == LISTENING and came.datagram is not None:
                self.joined += 1
                said = self.sender.join()
            elif came.stream == ANSWERS and came.datagram:
                said = self.sender.take_answer(came.datagram, self.now)
            if said and self.now - self._described > REPEAT_S:
                self._described = self.now
                self.say(said)

    def until(self, moment: float, stopped: Sequence[int]) -> None:
        """Wait until a moment of the motion; until then, answer receivers and send datagrams due without a sample."""
        while not stopped and (now := self.now) < moment:
            self.answer(min(moment - now, max(self.sender.next - now, 0.0), LOOK_S))
            if self.sender.next <= (now := self.now) < moment:
                self.say(self.sender.poll(now))

    def play(
        self,
        moments: np.ndarray,
        poses: Poses,
        delay: float,
        stopped: Sequence[int],
        reach: Callable[[float], None] = lambda _: None,
    ) -> float:
        """Send samples (n,) of poses (joints, n) when they are due, and return how many seconds were sent."""
        first, last = float(moments[0]), float(moments[-1])
        self.ahead = first - time.monotonic()
        for sample, moment in enumerate(moments.tolist()):
            self.until(moment, stopped)
            if stopped:
                break
            self.answer(0.0)
            self.say(self.sender.add(moment, poses[:, sample]))
            reach(moment - first)
        seconds = self.now - first
        if not stopped:
            self.say(self.sender.finish())
            self.until(last + delay + STAY_AFTER_S, stopped)
        self.room.send(self.user, MOTION, None)
        return seconds
