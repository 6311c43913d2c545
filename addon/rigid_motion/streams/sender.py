"""A sender that sends when it must: it knows every pose, and what its receivers show of what they were sent.

What is shown is a delay behind. When it gets to where a joint's ball would leave the tolerance, all of the window since
then is known here, and is said at once. Until then nothing is sent, for the motion goes on at the receivers as it was
going, and a body at rest costs a keepalive.

What is held is sent in the space of the joint that holds it: what is off there goes with the hand. Where a body changes
hands, all until then is said in the old ones, and the window of what comes next starts there. Every message has who
holds what, unless that is so where the message builds on: whatever is lost, what can be read is right.

A message builds on one that is there: the newest that all receivers who answer have; where nobody answers, the last
refresh, a message that builds on nothing and is sent twice.
"""

from __future__ import annotations

import math
import secrets
from collections.abc import Mapping, Sequence

import numpy as np

from ..motion import Poses
from . import wire
from .bodies import MAX_CLOCK_S, MAX_LENGTH_M, MIN_LENGTH_M, MIN_SAMPLE_GAP_S, Forest, Hold, StreamBody, checked
from .fitting import Fitting, closely
from .messages import MAX_MESSAGES_BACK, NEVER_TICK, Codec, Message
from .paths import KnotPath
from .wire import (
    LONGEST_DELAY,
    NEEDS_DESCRIPTION,
    NEEDS_REFRESH,
    TICKS_PER_S,
    Answer,
    Description,
    EncodedMotion,
    Terms,
)

KEEPALIVE_S, REFRESH_S = 0.5, 1.0
"""Seconds of silence after which something is said in any case; and, where nobody answers, between messages that build
on nothing."""

REPEAT_S, PATIENCE_S = 0.03, 0.15
"""Seconds after which a refresh, or who holds what from now on, is sent a second time, so that one loss does not lose
both; and that it has to arrive, before another is sent to somebody who asks for one."""

MAX_SILENCE_S, MAX_RECEIVERS = 2.0, 256
"""Seconds after which somebody who does not answer any more is not waited for; and for so many at most."""

GRID_TICKS = 3
"""Ticks of the grid of knots for samples at any moments."""

MAX_EARLY_TICKS, CLOCK_UNEVENNESS_S, OVERDUE_S = 1e-3, 1e-4, 2e-4
"""Ticks by which a sample may be before the one that it is at; seconds by which clocks are not more even than that; and
that are waited for a sample, instead of sending without it."""

MAX_SEQUENCE_NUMBER = 0xFFFF
"""The largest sequence number: behind it the sender begins again, with another identity."""

CLOCK_SET_S = 1.0
"""Seconds between two samples that are no pause, but a clock that was set."""

PAUSE_S = 0.25
"""Seconds between two samples beyond what is usual, before which all is said: for a receiver it may be a clock."""

CERTAIN_INTERVAL_RATIO, INTERVAL_DECAY_RATIO = 0.99, 0.9
"""Part of an interval that it surely takes; what is left of the longest with every sample that came sooner."""

ANSWERED_MESSAGES, MAX_BASE_AGE_S = 33, 2.0
"""Messages that an answer speaks of; and seconds: what is older is not worth building on, and all is said anew."""

MIN_LOST_MESSAGES, LOSSLESS_S = 2, 5.0
"""Messages of the last 32: where so many are missing, each is sent twice until none is for some seconds."""


class Sender:
    """Samples in, and out come the datagrams that are needed, each as soon as it is.

    Parameters
    ----------
    bodies : sequence of Body
    tolerance : float
        Metres: no point within a joint's radius is shown further off, at any moment, where nothing is lost or late.
    delay : float
        Seconds by which what is shown is behind, beside what the network takes.
    rate : float, optional
        Samples a second, where they are even.
    keepalive : float
        Seconds of silence at most.

    Raises
    ------
    ValueError
        For numbers out of range.
    """

    def __init__(
        self,
        bodies: Sequence[StreamBody],
        tolerance: float = 0.005,
        delay: float = 0.1,
        rate: float | None = None,
        keepalive: float = KEEPALIVE_S,
    ) -> None:
        for name, value, least, most in (
            ("tolerance", tolerance, MIN_LENGTH_M, MAX_LENGTH_M),
            ("delay", delay, 1.0 / TICKS_PER_S, LONGEST_DELAY / TICKS_PER_S),
            ("keepalive", keepalive, 0.0, math.inf),
        ):
            if not (least <= value <= most and 0.0 < value < MAX_LENGTH_M):
                raise ValueError(f"a {name} of {value} is not a positive number from {least:g} to {most:g}")
        even = TICKS_PER_S / rate if rate else GRID_TICKS
        is_whole = 1.0 <= even <= LONGEST_DELAY and abs(even - round(even)) < 0.01
        grid = round(even) if is_whole else GRID_TICKS
        terms, self._keepalive = Terms(tolerance, round(delay * TICKS_PER_S), grid), keepalive
        self._delay = terms.delay / TICKS_PER_S
        self._packed = wire.describe(Forest(bodies), terms)
        # The bodies as receivers read them, in so many digits.
        read = wire.read_description(self._packed)
        if read is None or len(self._packed) > wire.MAX_BYTES - 4:
            raise ValueError("the bodies have too many joints or too long names to be described")
        self.codec = self._codec = Codec(*read)
        """As described; and with what is held."""
        self._wanted: tuple[tuple[int, int], ...] = ()
        """The numbers of bodies that are held from the next sample on, and of the joints that hold them."""
        self._since, self._takes = NEVER_TICK, False
        """The tick since which all is in the same hands; and whether that is still to be said."""
        self._slip = 0.0
        """What is added to the times of samples, so that a clock that was set makes no difference."""
        none = np.empty((len(read[0]), 0, 4))
        self._samples = KnotPath(np.empty(0), Poses(none[..., :3], none))
        self._next = math.inf
        self._interval = 0.0
        """Within which the next sample is expected."""
        self._begin()

    def _begin(self) -> None:
        """Begin with a new identity."""
        self.identity = secrets.token_bytes(3)
        self._messages: dict[int, Message] = {}
        """Of messages that others may build on, by their sequence numbers."""
        self._sequence = 0
        self._path: KnotPath | None = None
        """What the receivers show who have everything."""
        self._shown = -math.inf
        """Until this moment it is known to be within the tolerance."""
        self._good: float | None = None
        """The moment behind which it is not."""
        self._receivers: dict[bytes, tuple[Answer, float]] = {}
        """What those who answer have, and when they said so."""
        self._refreshed = self._sent = -math.inf
        """The ends of the last refresh and of the last message."""
        self._copy: tuple[int, float, bytes] | None = None
        """What is to be sent a second time: its sequence number, and when it was sent."""
        self._base: int | None = None
        """The last refresh."""
        self._desired = False
        """Whether somebody cannot read what is sent."""
        self._missed = -math.inf
        """When somebody said last that so much is lost that all is to be sent twice."""

    def hold(self, tool: str, body: str | None, joint: str | None = None) -> None:
        """Say that a body is in the hand of a joint of another from the next sample on, or in nobody's any more.

        The poses of its roots are given in the world all the same, and shown there. The more rigidly it is held, the
        less it costs.

        Parameters
        ----------
        tool : str
        body : str, optional
        joint : str, optional
            Not needed of a body with a single joint.

        Raises
        ------
        ValueError
            Where there is no such body or joint, and where it would hold itself, if only through others.
        """
        forest = self.codec.forest
        wanted = {held: holder for held, holder in self._wanted if held != forest.body(tool)}
        if body is not None:
            wanted[forest.body(tool)] = forest.joint(body, joint)
        pairs = tuple(sorted(wanted.items()))
        try:
            forest.holding(tuple(Hold(*pair) for pair in pairs))
        except ValueError as error:
            raise ValueError(f"{tool} cannot be held by {body}: {error}") from None
        self._wanted = pairs

    def add(self, time: float, poses: Poses | Mapping[str, Poses]) -> list[bytes]:
        """Take a sample, and return what is to be sent now.

        Parameters
        ----------
        time : float
            Seconds. Where it goes back or jumps ahead by more than a second, a clock was set: the motion goes on.
        poses : Poses, shape (joints,), or Poses for each body's name
            Each joint in its parent's space, and roots in the world, held or not.

        Raises
        ------
        ValueError
            Where poses are not as many as joints; and where a place is 10 km away or further, a quaternion is 0, or any
            number is not finite. It is as if there had been no such sample.
        """
        forest = self._codec.forest
        poses = poses if isinstance(poses, Poses) else forest.joined(poses)
        if poses.shape != (len(forest),) or not abs(time) <= MAX_CLOCK_S:
            raise ValueError(f"a sample needs {len(forest)} poses and a time within {MAX_CLOCK_S:g} s, not {time}")
        poses, times, now = checked(poses, forest.labels), self._samples.moments, time + self._slip
        if len(times) and not MIN_SAMPLE_GAP_S < now - times[-1] <= CLOCK_SET_S:
            usual = times[-1] - times[-2] if len(times) > 1 else 1.0 / TICKS_PER_S
            now = float(times[-1] + usual)
            self._slip = now - time
        said = self._before_pause(now)
        if len(times):
            self._interval = max(now - float(times[-1]), INTERVAL_DECAY_RATIO * self._interval)
        if self._wanted != tuple((body, joint) for body, joint, _ in forest.holds):
            said += self._take_over(now, poses)
        else:
            self._samples = self._samples.extended(now, forest.in_hands(poses)).since(now - self._delay - CLOCK_SET_S)
        return said + self._due(now, self._interval)

    def _take_over(self, now: float, poses: Poses) -> list[bytes]:
        """Go on in other hands from a sample (joints,) on, and return what is to be sent of the motion until then."""
        before, old, described, said = self._samples, self._codec.forest, self.codec.forest, list[bytes]()
        holds, known = tuple(Hold(*pair) for pair in self._wanted), {hold[:2]: hold for hold in old.holds}
        placed = described.holding(holds).in_hands(poses)
        new = [known.get(hold[:2], hold._replace(level=described.level(hold.body, placed))) for hold in holds]
        codec = self.codec.holding(tuple(new))
        taken, begun = old.holders != codec.forest.holders, KnotPath(np.array([now]), placed[:, None])
        if len(before.moments):
            # In the old hands it goes on as it went, and how it got into the new ones is not known.
            until, last = old.in_hands(poses), before.poses[:, -1].copy()
            until[taken], last[taken] = before.going_on().pose(now)[taken], placed[taken]
            self._samples = before.extended(now, until)
            said = self._due(now, math.inf)
            begun = KnotPath(before.moments[-1:], last[:, None]).extended(now, placed)
            self._since, self._takes, self._good = math.floor(now * TICKS_PER_S + MAX_EARLY_TICKS), True, now - REPEAT_S
        self._codec, self._samples = codec, begun
        return said

    def poll(self, time: float) -> list[bytes]:
        """Return what is to be sent at a time at which no sample came: worth asking at `next`, where one is overdue."""
        now, times = time + self._slip, self._samples.moments
        if not len(times) or not now <= times[-1] + CLOCK_SET_S:
            return []  # Somebody set the clock, as the next sample will tell; or no sample is going to come.
        return self._before_pause(now) + self._due(max(now, float(times[-1])), 0.0)

    @property
    def next(self) -> float:
        """When what is shown gets to a sample behind which it is off: by then something has to be sent."""
        return self._next - self._slip

    def finish(self) -> list[bytes]:
        """Return what is still needed where no more samples are to come."""
        times = self._samples.moments
        return self._due(float(times[-1]), math.inf) if len(times) else []

    def describe(self) -> list[bytes]:
        """Names, parents and rest poses, for those who join."""
        return [wire.write(Description(self.identity, self._packed))]

    def join(self) -> list[bytes]:
        """Return what somebody who joins needs: the description. The next message then builds on nothing."""
        self._desired = True
        return self.describe()

    def take_answer(self, datagram: bytes, now: float) -> list[bytes]:
        """Take an answer, at a time by the clock of the samples, and return what is to be sent for it."""
        answer = wire.read(datagram)
        if not isinstance(answer, Answer) or answer.identity != self.identity:
            return []
        if answer.receiver not in self._receivers and len(self._receivers) == MAX_RECEIVERS:
            return []
        heard, times = now + self._slip, self._samples.moments
        if len(times) and not abs(heard - times[-1]) <= CLOCK_SET_S:
            heard = float(times[-1])
        self._receivers[answer.receiver] = answer, heard
        missing = answer.before.bit_length() - answer.before.bit_count()
        self._missed = heard if missing >= (1 if self._is_lossy(heard) else MIN_LOST_MESSAGES) else self._missed
        self._desired |= bool(answer.needs & NEEDS_REFRESH) and heard - self._refreshed > PATIENCE_S
        return self.describe() if answer.needs & NEEDS_DESCRIPTION else []

    def _before_pause(self, now: float) -> list[bytes]:
        """Return what is to be sent of the samples that there are before one that comes late."""
        last = float(self._samples.moments[-1]) if len(self._samples.moments) else now
        is_pause = now - last > PAUSE_S + self._interval and self._sent < last and self._sequence <= MAX_SEQUENCE_NUMBER
        return [self._message(last)] if is_pause else []

    def _due(self, now: float, interval: float) -> list[bytes]:
        """Return what is to be sent now, where nobody asks again before the interval is over."""
        if self._sequence > MAX_SEQUENCE_NUMBER:
            self._begin()
        due, self._next = [], math.inf
        if self._copy and now - self._copy[1] >= REPEAT_S:
            sequence, _, datagram = self._copy
            due, self._copy = [] if self._answered(now) and self._have(sequence) else [datagram], None
        if not self._answered(now) and now - self._refreshed >= REFRESH_S:
            due += [*self.describe(), self._message(now, refresh=True)]
        elif self._desired:
            due.append(self._message(now, refresh=True))
        elif now - self._sent >= self._keepalive:
            due.append(self._message(now))
        elif (good := self._is_shown_until(now)) is not None:
            if good < now - self._delay + max(CERTAIN_INTERVAL_RATIO * interval, CLOCK_UNEVENNESS_S):
                due.append(self._message(now))
            else:
                self._next = good + self._delay + OVERDUE_S
        return due * (2 if self._is_lossy(now) else 1)

    def _is_shown_until(self, now: float) -> float | None:
        """Return the moment before one that is shown further off than the tolerance; None where there is none yet."""
        times = self._samples.moments
        if self._good is None and self._path is not None and self._shown < times[-1]:
            moments = closely(times[max(int(np.searchsorted(times, self._shown, side="right")) - 1, 0) :])
            moments = moments[moments > max(self._shown, now - self._delay)]
            errors = self._codec.forest.errors(self._path.at(moments), self._samples.at(moments))
            off = errors.max(axis=0) > self.codec.tolerance
            if off.any():
                self._good = float(np.append(self._shown, moments)[np.argmax(off)])
            self._shown = float(times[-1])
        return self._good

    def _is_lossy(self, now: float) -> bool:
        """Return whether so much was lost lately that all is sent twice."""
        return now - self._missed < LOSSLESS_S

    def _answered(self, now: float) -> bool:
        """Whether anybody answers; those who do not any more are forgotten."""
        self._receivers = {own: it for own, it in self._receivers.items() if now - it[1] < MAX_SILENCE_S}
        return bool(self._receivers)

    def _have(self, sequence: int) -> bool:
        """Whether all who answer have a message."""
        return all(answer.has(sequence) for answer, _ in self._receivers.values())

    def _usable(self, now: float) -> int | None:
        """Return the message to build on, or None."""
        number = self._base
        if self._answered(now):
            number = next((it for it in sorted(self._messages, reverse=True) if self._have(it)), None)
        if number is None or self._sequence - number > MAX_MESSAGES_BACK:
            return None
        return number if now - self._messages[number].end / TICKS_PER_S < MAX_BASE_AGE_S else None

    def _message(self, now: float, refresh: bool = False) -> bytes:
        """Say the window until now. Where no sample is there yet, the motion is taken to go on as it went."""
        samples, last = self._samples, float(self._samples.moments[-1])
        now = max(now, self._sent, (self._since + 1) / TICKS_PER_S)
        if now - last > CLOCK_UNEVENNESS_S:
            there = samples.going_on().pose(now)
            samples = samples.extended(
                now, Poses(np.clip(there.positions, -MAX_LENGTH_M, MAX_LENGTH_M), there.quaternions)
            )
        end = math.floor(now * TICKS_PER_S + MAX_EARLY_TICKS)
        # What goes on from a leap of kilometres may be nowhere: then it builds on nothing.
        for number in (None if refresh else self._usable(now), None):
            base = self.codec.rest if number is None else self._messages[number]
            back = 0 if number is None else self._sequence - number
            message, is_within = Fitting(self._codec, self._path, base, back, end, self._since, samples).message()
            if message.is_somewhere:
                break
        datagram = wire.write(EncodedMotion(self.identity, self._sequence, self.codec.write(message, base)))
        self._messages[self._sequence] = message
        kept = {*range(self._sequence - ANSWERED_MESSAGES, self._sequence + 1), self._base}
        self._messages = {number: old for number, old in self._messages.items() if number in kept}
        start = float(message.path.moments[0])
        self._path = message.path if self._path is None else self._path.followed(message.path).since(start - 0.05)
        self._shown, self._good = min(end / TICKS_PER_S, last) if is_within else start, None
        self._sent = end / TICKS_PER_S
        if number is None:
            self._refreshed, self._desired, self._base = now, False, self._sequence
        if number is None or self._takes:
            self._copy, self._takes = (self._sequence, now, datagram), False
        self._sequence += 1
        return datagram
