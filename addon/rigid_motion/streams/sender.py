"""Sender of streams: knows every pose and the motion that receivers show, and sends only when necessary.

The shown motion is a delay behind. When it reaches a moment at which a joint's ball would leave the tolerance, the
whole window up to now is known here, and is sent at once. Until then nothing is sent: receivers continue the motion,
and a body at rest costs only a keepalive.

Held objects are sent in the space of the joint that holds them: their errors move with the hand. When a body changes
hands, the motion before is sent with the old holder, and the next window starts at the change. Every message contains
the holders, unless they are the same as in the message it builds on: whatever is lost, readable messages are right.

A message builds on one that has arrived: the newest that all answering receivers have; without answers, the last
refresh, which is a message that builds on nothing and is sent twice.
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
"""Seconds of silence after which a message is always sent; and, without answers, between messages that build on
nothing."""

REPEAT_S, PATIENCE_S = 0.03, 0.15
"""Seconds after which a refresh or a change of holders is sent again, so that one loss does not lose both; and seconds
it gets to arrive before another is sent on request."""

MAX_SILENCE_S, MAX_RECEIVERS = 2.0, 256
"""Seconds without answers after which a receiver is forgotten; and the most receivers."""

GRID_TICKS = 3
"""Ticks between possible knots if samples have no even rate."""

MAX_EARLY_TICKS, CLOCK_UNEVENNESS_S, OVERDUE_S = 1e-3, 1e-4, 2e-4
"""Ticks by which a sample may be earlier than its tick; seconds of unevenness to expect from clocks; and seconds to
wait for an overdue sample before sending without it."""

MAX_SEQUENCE_NUMBER = 0xFFFF
"""The largest sequence number: after it, the sender restarts with another identity."""

CLOCK_SET_S = 1.0
"""Longest pause between two samples in seconds: anything longer means that a clock was set."""

PAUSE_S = 0.25
"""Seconds beyond the usual interval before a late sample at which all samples so far are sent: receivers may take the
pause for a clock that was set."""

CERTAIN_INTERVAL_RATIO, INTERVAL_DECAY_RATIO = 0.99, 0.9
"""Fraction of an interval that surely passes before the next sample; and decay of the longest interval per sample."""

ANSWERED_MESSAGES, MAX_BASE_AGE_S = 33, 2.0
"""Messages that an answer reports on; and seconds: older messages are not worth building on, all is sent anew."""

MIN_LOST_MESSAGES, LOSSLESS_S = 2, 5.0
"""Least losses in the last 32 messages for sending each twice, until nothing is lost for LOSSLESS_S seconds."""


class Sender:
    """Takes samples and returns the datagrams that are needed, each as soon as it is.

    Parameters
    ----------
    bodies : sequence of StreamBody
    tolerance : float
        Metres: no point within a joint's radius is shown farther off, at any moment, if nothing is lost or late.
    delay : float
        Seconds by which the shown motion is behind, in addition to network delays.
    rate : float, optional
        Samples per second, if they are even.
    keepalive : float
        Longest silence in seconds.

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
        # The bodies as receivers read them, with rounded numbers.
        read = wire.read_description(self._packed)
        if read is None or len(self._packed) > wire.MAX_BYTES - 4:
            raise ValueError("the bodies have too many joints or too long names to be described")
        self.codec = self._codec = Codec(*read)
        """As described; and with the current holds."""
        self._wanted: tuple[tuple[int, int], ...] = ()
        """Numbers of bodies that will be held from the next sample on, and of the joints that hold them."""
        self._since, self._holders_changed = NEVER_TICK, False
        """The tick since which holders have not changed; and whether the change still has to be sent."""
        self._slip = 0.0
        """Seconds added to the times of samples, so that a clock that was set makes no difference."""
        none = np.empty((len(read[0]), 0, 4))
        self._samples = KnotPath(np.empty(0), Poses(none[..., :3], none))
        self._next = math.inf
        self._interval = 0.0
        """Seconds within which the next sample is expected."""
        self._begin()

    def _begin(self) -> None:
        """Begin with a new identity."""
        self.identity = secrets.token_bytes(3)
        self._messages: dict[int, Message] = {}
        """Messages that others may build on, by sequence number."""
        self._sequence = 0
        self._path: KnotPath | None = None
        """The motion shown by receivers that got all messages."""
        self._shown = -math.inf
        """The shown motion is known to be within the tolerance before this moment."""
        self._good_until: float | None = None
        """The last moment within the tolerance, if a later one is not."""
        self._receivers: dict[bytes, tuple[Answer, float]] = {}
        """Latest answers of receivers, and when they arrived."""
        self._refreshed = self._sent = -math.inf
        """The ends of the last refresh and of the last message."""
        self._copy: tuple[int, float, bytes] | None = None
        """Datagram to be sent again: sequence number, time when sent, and bytes."""
        self._base: int | None = None
        """The last refresh."""
        self._desired = False
        """Whether a refresh was requested."""
        self._missed = -math.inf
        """When an answer last reported enough losses to send everything twice."""

    def hold(self, tool: str, body: str | None, joint: str | None = None) -> None:
        """Put a body into the hand of another body's joint from the next sample on, or let go of it if `body` is None.

        The poses of its roots are still given and shown in world space. The more rigidly it is held, the less it costs.

        Parameters
        ----------
        tool : str
        body : str, optional
        joint : str, optional
            Not needed for a body with a single joint.

        Raises
        ------
        ValueError
            If the body or joint does not exist, or if the body would hold itself, even indirectly.
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
        """Add a sample, and return the datagrams to send now.

        Parameters
        ----------
        time : float
            Seconds. If it goes back or jumps ahead by more than a second, a clock was set: the motion goes on.
        poses : Poses, shape (joints,), or Poses for each body's name
            Each joint in its parent's space, and roots in world space, held or not.

        Raises
        ------
        ValueError
            If the numbers of poses and joints differ; or if a position is 10 km away or farther, a quaternion is 0, or
            any number is not finite. The sample is then ignored.
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
        """Change holders from a sample (joints,) on, and return the datagrams for the motion before it."""
        before, old, described, said = self._samples, self._codec.forest, self.codec.forest, list[bytes]()
        holds, known = tuple(Hold(*pair) for pair in self._wanted), {hold[:2]: hold for hold in old.holds}
        placed = described.holding(holds).in_hands(poses)
        new = [known.get(hold[:2], hold._replace(level=described.level(hold.body, placed))) for hold in holds]
        codec = self.codec.holding(tuple(new))
        taken, begun = old.holders != codec.forest.holders, KnotPath(np.array([now]), placed[:, None])
        if len(before.moments):
            # With the old holders the motion continues; the motion into the new hands is unknown.
            until, last = old.in_hands(poses), before.poses[:, -1].copy()
            until[taken], last[taken] = before.going_on().pose(now)[taken], placed[taken]
            self._samples = before.extended(now, until)
            said = self._due(now, math.inf)
            begun = KnotPath(before.moments[-1:], last[:, None]).extended(now, placed)
            self._since, self._holders_changed, self._good_until = (
                math.floor(now * TICKS_PER_S + MAX_EARLY_TICKS),
                True,
                now - REPEAT_S,
            )
        self._codec, self._samples = codec, begun
        return said

    def poll(self, time: float) -> list[bytes]:
        """Return the datagrams to send at a time without a sample: call it at `next` if a sample is overdue."""
        now, times = time + self._slip, self._samples.moments
        if not len(times) or not now <= times[-1] + CLOCK_SET_S:
            return []  # The clock was set, as the next sample will show; or samples have ended.
        return self._before_pause(now) + self._due(max(now, float(times[-1])), 0.0)

    @property
    def next(self) -> float:
        """When the shown motion reaches the last sample within the tolerance: by then a datagram has to be sent."""
        return self._next - self._slip

    def finish(self) -> list[bytes]:
        """Return the datagrams that are still needed after the last sample."""
        times = self._samples.moments
        return self._due(float(times[-1]), math.inf) if len(times) else []

    def describe(self) -> list[bytes]:
        """Return names, parents and rest poses, for new receivers."""
        return [wire.write(Description(self.identity, self._packed))]

    def join(self) -> list[bytes]:
        """Return the description, for a new receiver. The next message then builds on nothing."""
        self._desired = True
        return self.describe()

    def take_answer(self, datagram: bytes, now: float) -> list[bytes]:
        """Process an answer, at a time by the clock of the samples, and return the datagrams it asks for."""
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
        """Return the datagrams for the samples so far, if the next sample is late."""
        last = float(self._samples.moments[-1]) if len(self._samples.moments) else now
        is_pause = now - last > PAUSE_S + self._interval and self._sent < last and self._sequence <= MAX_SEQUENCE_NUMBER
        return [self._message(last)] if is_pause else []

    def _due(self, now: float, interval: float) -> list[bytes]:
        """Return the datagrams to send now, if the next call may come only after the interval."""
        if self._sequence > MAX_SEQUENCE_NUMBER:
            self._begin()
        due, self._next = [], math.inf
        if self._copy and now - self._copy[1] >= REPEAT_S:
            sequence, _, datagram = self._copy
            due, self._copy = [] if self._answered(now) and self._all_have(sequence) else [datagram], None
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
        """Return the last moment before the shown motion leaves the tolerance; None if it does not yet."""
        times = self._samples.moments
        if self._good_until is None and self._path is not None and self._shown < times[-1]:
            moments = closely(times[max(int(np.searchsorted(times, self._shown, side="right")) - 1, 0) :])
            moments = moments[moments > max(self._shown, now - self._delay)]
            errors = self._codec.forest.errors(self._path.at(moments), self._samples.at(moments))
            off = errors.max(axis=0) > self.codec.tolerance
            if off.any():
                self._good_until = float(np.append(self._shown, moments)[np.argmax(off)])
            self._shown = float(times[-1])
        return self._good_until

    def _is_lossy(self, now: float) -> bool:
        """Whether recent losses are high enough to send everything twice."""
        return now - self._missed < LOSSLESS_S

    def _answered(self, now: float) -> bool:
        """Whether any receiver answers; receivers that no longer answer are forgotten."""
        self._receivers = {own: it for own, it in self._receivers.items() if now - it[1] < MAX_SILENCE_S}
        return bool(self._receivers)

    def _all_have(self, sequence: int) -> bool:
        """Whether all answering receivers have a message."""
        return all(answer.has_arrived(sequence) for answer, _ in self._receivers.values())

    def _usable(self, now: float) -> int | None:
        """Return the number of the message to build on, or None."""
        number = self._base
        if self._answered(now):
            number = next((it for it in sorted(self._messages, reverse=True) if self._all_have(it)), None)
        if number is None or self._sequence - number > MAX_MESSAGES_BACK:
            return None
        return number if now - self._messages[number].end / TICKS_PER_S < MAX_BASE_AGE_S else None

    def _message(self, now: float, refresh: bool = False) -> bytes:
        """Return a message for the window until now. If there is no sample yet, the motion is assumed to continue."""
        samples, last = self._samples, float(self._samples.moments[-1])
        now = max(now, self._sent, (self._since + 1) / TICKS_PER_S)
        if now - last > CLOCK_UNEVENNESS_S:
            there = samples.going_on().pose(now)
            samples = samples.extended(
                now, Poses(np.clip(there.positions, -MAX_LENGTH_M, MAX_LENGTH_M), there.quaternions)
            )
        end = math.floor(now * TICKS_PER_S + MAX_EARLY_TICKS)
        # The motion after a leap of kilometres may leave the valid range: then the message builds on nothing.
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
        self._shown, self._good_until = min(end / TICKS_PER_S, last) if is_within else start, None
        self._sent = end / TICKS_PER_S
        if number is None:
            self._refreshed, self._desired, self._base = now, False, self._sequence
        if number is None or self._holders_changed:
            self._copy, self._holders_changed = (self._sequence, now, datagram), False
        self._sequence += 1
        return datagram
