"""Playback timing of streams: which moment is shown when, and how the display continues after late messages.

The shown moment is behind the newest one that can have arrived: by the delay of the stream, and by the longest recent
transit time. It never goes back. If the network becomes slower for good, playback waits; if faster for good, it
hurries; a clock that was set causes neither. Seconds; `transit` is arrival by our clock minus sending by the sender's,
so it includes the difference between the clocks.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Hashable
from typing import Any, NamedTuple

import numpy as np

from ..motion import Poses
from ..motion.quaternions import ZERO_SINE, normalise, turned, turns_between
from .bodies import Forest, StreamBody
from .paths import KnotPath
from .steady import Steady
from .wire import TICKS_PER_S

LOOK_BACK, MOST_TRANSITS = 3.0, 512
"""Seconds over which the longest transit counts, and the most datagrams that count."""

# The network has become faster, and does not only vary, if datagrams all arrived sooner than usual:
MIN_QUICK_DATAGRAMS = 4  # sending times in a row
MIN_QUICK_S = 0.3  # duration
MIN_SOONER_S = 0.05  # sooner than the longest transit, at least
MAX_SOONER_RATIO = 0.1  # and sooner than all but this fraction of the earlier datagrams

CLOCK_SET_S = 1.0
"""Seconds: a transit that differs by more is due to a clock that was set; the display may not leap further."""

CLOCK_AHEAD_S = 0.25
"""Seconds by which a datagram arrives sooner than all recent ones if the sender's clock was set ahead."""

SETTLING_S, MAX_HURRY_RATIO = 0.15, 0.6
"""Seconds in which the difference to the desired moment shrinks to about a third; and the largest fraction by which
playback runs faster than time."""

FADE_S, MAX_FORWARD_RATIO = 0.04, 0.8
"""Time constant in seconds with which differences to the desired poses fade, like critically damped springs. And the
fraction of the motion that a difference may take away: poses shown too far ahead wait, and never go back."""

MAX_REST_SPEED, MIN_DIFFERENCE = 0.05, 1e-5
"""Metres or radians per second: slower motion counts as rest, where differences along it fade like all others. And
metres or radians: smaller differences count as zero."""

MAX_SILENCE_S = 10.0
"""Seconds of silence after which a stream is forgotten."""

MOST_KNOTS, MOST_JOINT_KNOTS = 256, 1 << 14
"""Knots of a stream kept for `keys`; for few joints more, up to MOST_JOINT_KNOTS poses of joints."""

NO_HOLDERS = np.full(1, -1, dtype=np.int16)
"""Holder of each joint if nothing is held."""


class Playing:
    """The moment of a stream to show."""

    def __init__(self, delay: float) -> None:
        self.delay = delay
        self.longest: float | None = None
        """The longest recent transit, which playback waits for."""
        self._transits: deque[tuple[float, float]] = deque(maxlen=MOST_TRANSITS)
        self._moment: float | None = None
        self._last = self._heard = -np.inf
        self._unsure = False
        """Whether our clock leapt, and nothing has arrived since."""
        self._leap: tuple[float, float] | None = None
        """A moment, and seconds to skip after it, because the sender's clock was set ahead."""

    def heard(self, sent: float, arrival: float) -> None:
        """Record when a datagram was sent and arrived."""
        transit = arrival - sent
        known = self._transits
        if known and (abs(transit - known[-1][1]) > CLOCK_SET_S or arrival < known[-1][0] - CLOCK_SET_S):
            known.clear()
        known.append((arrival, transit))
        while known[0][0] < arrival - LOOK_BACK:
            known.popleft()
        # By sending time: datagrams on a quick route overtake others.
        by_sent = sorted((when - took, when, took) for when, took in known)
        # A receiver that seldom polls its socket sees several arrivals at one time.
        last_left = {when: left for left, when, _ in by_sent}
        begun = min(sorted(last_left.values())[-MIN_QUICK_DATAGRAMS:][0], by_sent[-1][0] - MIN_QUICK_S)
        recent = [took for left, _, took in by_sent if left >= begun]
        older = sorted(took for left, _, took in by_sent if left < begun)
        if (
            older
            and len(last_left) >= MIN_QUICK_DATAGRAMS
            and max(recent) < min(older[int(MAX_SOONER_RATIO * len(older))], older[-1] - MIN_SOONER_S)
        ):
            known.clear()
            known.extend(sorted((when, took) for left, when, took in by_sent if left >= begun))
        self.longest = max(took for _, took in known)
        self._heard, self._unsure = arrival, False

    def set_ahead(self, sent: float, arrival: float) -> float:
        """Return by how much the sender's clock was set ahead, 0 if it was not, given the next datagram."""
        before = [(when, took) for when, took in self._transits if when < arrival]
        # A receiver that seldom polls does not know arrival times, and a clock of ours that goes back proves nothing.
        if not before or self._transits[-1][0] > arrival or arrival - before[-1][0] > CLOCK_AHEAD_S:
            return 0.0
        step = min(took for _, took in before) - (arrival - sent)
        return step if step > CLOCK_AHEAD_S else 0.0

    def skip(self, moment: float, step: float) -> None:
        """Skip `step` seconds after a moment, once it has been shown."""
        if self._leap and self._moment is not None:
            self._moment += self._leap[1]
        self._transits = deque(((when, took - step) for when, took in self._transits), MOST_TRANSITS)
        self._leap = moment, step

    def moment(self, now: float) -> float | None:
        """Return the moment to be shown now; None before anything arrived."""
        if self.longest is None:
            return None
        desired = now - self.longest - self.delay
        if self._leap:
            last, step = self._leap
            if self._moment is not None and self._moment < last:
                desired -= step
            else:
                self._moment, self._leap = None if self._moment is None else self._moment + step, None
        passed, self._last = now - self._last, now
        if self._moment is None:
            self._moment, passed = desired, 0.0
        if abs(passed) > CLOCK_SET_S and not 0.0 <= now - self._heard <= CLOCK_SET_S:
            self._unsure = True
        if self._unsure or passed <= 0.0:
            return self._moment
        gap = desired - self._moment - passed
        if abs(gap) > CLOCK_SET_S:
            self._moment = desired
        else:
            # A receiver that seldom polls must not overshoot.
            self._moment += passed + min(max(gap / max(SETTLING_S, passed), -1.0), MAX_HURRY_RATIO) * passed
        return self._moment


class Fading:
    """The poses shown of a path that changes during playback: differences fade, without turning the motion back.

    Joints with a new holder change at once.
    """

    def __init__(self) -> None:
        self._shown: Poses | None = None
        self._path: Poses | None = None
        """Poses of the path at the last shown moment."""
        self._last = 0.0
        self._left, self._rate = np.zeros((2, 2, 1, 3))
        """Remaining differences of positions and rotations, the latter as rotation vectors, and their change per
        second. Shape (2, joints, 3).
        """
        self._holders = NO_HOLDERS
        """Holder of each joint when last shown."""

    def changed(self, poses: Poses, holders: np.ndarray = NO_HOLDERS) -> None:
        """Continue from the last shown poses, given the poses (joints,) of a new path and their holders (joints,)."""
        if self._shown is not None:
            self._path, self._left = poses, _differences(poses, self._shown)
            self._drop_changed_holders(holders)

    def _drop_changed_holders(self, holders: np.ndarray) -> None:
        """Forget the differences of joints whose holder has changed."""
        differs = self._holders != holders
        if differs.any():
            self._left, self._rate = (np.where(differs[:, None], 0.0, each) for each in (self._left, self._rate))
        self._holders = holders

    def show(self, poses: Poses, now: float, holders: np.ndarray = NO_HOLDERS) -> Poses:
        """Return poses (joints,) of the path, with holders (joints,), plus the remaining differences."""
        self._drop_changed_holders(holders)
        passed, self._last = max(now - self._last, 0.0), now
        if self._path is not None and passed > 0.0 and self._left.any():
            self._fade(_differences(self._path, poses), passed)
        slides, turns = self._left
        self._path = poses
        self._shown = Poses(poses.positions + slides, normalise(turned(poses.quaternions, turns)))
        return self._shown

    def _fade(self, step: np.ndarray, passed: float) -> None:
        """Fade the differences over `passed` seconds, in which the path moves by `step` (2, joints, 3)."""
        before, decay = self._left, np.exp(-passed / FADE_S)
        pull = self._rate + before / FADE_S
        left = (before + pull * passed) * decay
        length = np.linalg.norm(step, axis=-1, keepdims=True)
        along = step / np.maximum(length, ZERO_SINE)
        back = np.minimum(np.sum((left - before) * along, axis=-1, keepdims=True) + MAX_FORWARD_RATIO * length, 0.0)
        held = np.where(length > MAX_REST_SPEED * passed, back, 0.0) * along
        self._rate, self._left = pull * decay - left / FADE_S - held / passed, left - held
        over = np.abs(self._left).max(axis=(1, 2)) < MIN_DIFFERENCE
        self._rate[over] = self._left[over] = 0.0


def _differences(first: Poses, second: Poses) -> np.ndarray:
    turns = turns_between(first.quaternions, second.quaternions)
    return np.stack((second.positions - first.positions, turns))


class Stream(NamedTuple):
    """Identity of a stream."""

    source: Hashable
    identity: bytes


class HeldPoses(NamedTuple):
    """A held body: the body and joint that hold it, and its poses (joints,) with roots in that joint's space."""

    body: str
    joint: str
    poses: Poses


class Shown(NamedTuple):
    """The poses of a stream at a moment in seconds by the sender's clock. For each body by name poses (joints,), each
    joint in its parent's space, and roots in world space, held or not.

    `held` has the held bodies by name.
    """

    stream: Stream
    moment: float
    bodies: tuple[StreamBody, ...]
    poses: dict[str, Poses]
    held: dict[str, HeldPoses] = {}  # noqa: RUF012


class ReceivedKeys(NamedTuple):
    """Received keys, for recording: rising moments (k,) in seconds by the sender's clock, and poses (joints, k).

    Roots are in world space, held or not. When a body changes hands, there is a key just before. `held` has, by name,
    the bodies held at any of these moments: the body and joint that hold it at each moment (k,), or None, and its poses
    (joints, k) with roots in that joint's space.
    """

    stream: Stream
    bodies: tuple[StreamBody, ...]
    moments: np.ndarray
    poses: dict[str, Poses]
    held: dict[str, tuple[list[tuple[str, str] | None], Poses]] = {}  # noqa: RUF012


class Playback:
    """A stream that is shown: its bodies, the path received so far, and the moment due.

    `heard` is when new data last arrived, `begins` and `ends` are the first and last moment that can be shown, and the
    path will not change any more before `settled`.
    """

    silent = MAX_SILENCE_S

    def __init__(self, stream: Stream, delay: float, heard: float, forest: Forest | None = None) -> None:
        self.stream, self.heard, self.playing = stream, heard, Playing(delay)
        self.forest: Any = forest
        """The Forest of all bodies, or None while nothing is known of them."""
        self.path: KnotPath | None = None
        self.begins, self.ends, self.settled = -np.inf, np.inf, np.inf
        self.fading, self._steady = Fading(), Steady()
        self.moment: float | None = None
        self.kept = -np.inf
        """Keys have been returned up to this moment."""

    def put(self, path: KnotPath) -> None:
        """Show this path from now on; keep only the knots that are still to be shown or recorded."""
        self.ends = np.inf
        count = min(max(MOST_JOINT_KNOTS // len(self.forest), MOST_KNOTS), len(path.moments))
        shown = path.moments[0] if self.moment is None else self.moment
        self.path = path.since(max(min(self.kept, shown) - 1e-6, path.moments[-count]))

    def end(self) -> None:
        """Show nothing after the received path, because the sender has left, unless more arrives."""
        self.ends, self.settled = float(self.path.moments[-1]) if self.path else -np.inf, np.inf

    def show(self, now: float, steady: bool = False) -> Shown | None:
        """Return the poses shown now, with jitter removed if `steady`."""
        self.moment = self.playing.moment(now)
        if self.moment is None or self.path is None or not self.begins <= self.moment <= self.ends:
            return None
        forest, holders = self.forest, self.path.held_at(self.moment)
        poses = self._steady(self.path, self.moment, self.settled) if steady else self.path.pose(self.moment)
        poses = self.fading.show(poses, now, holders)
        shown = forest.parted(forest.out_of_hands(poses[:, None], holders[:, None])[:, 0])
        hands = forest.held(holders) if (holders >= 0).any() else {}
        held = {name: HeldPoses(body, joint, forest.parted(poses)[name]) for name, (body, joint) in hands.items()}
        return Shown(self.stream, self.moment, forest.bodies, shown, held)

    def keys(self) -> ReceivedKeys | None:
        """Return the settled knots that have not been returned yet."""
        moments = self.path.moments if self.path else np.empty(0)
        rows = np.flatnonzero((moments > self.kept) & (moments <= self.settled))
        if self.path is None or not len(rows):
            return None
        self.kept = float(moments[rows[-1]])
        # Of knots at one moment, the first is the pose before it, and the last the pose from it on.
        is_last = np.diff(moments[rows], append=np.inf) > 0.0
        is_first = np.insert(is_last[:-1], 0, True)
        moments = (moments[rows] - np.where(is_last, 0.0, 0.5 / TICKS_PER_S))[is_first | is_last]
        rows = rows[is_first | is_last]
        poses, holders = self.path.poses[:, rows], self.path.holders[:, rows]
        seen, inside, held = self.forest.out_of_hands(poses, holders), self.forest.parted(poses), {}
        if (holders >= 0).any():
            columns, which = np.unique(holders, axis=1, return_inverse=True)
            hands = [self.forest.held(column) for column in columns.T]
            of_keys = [hands[number] for number in which.ravel().tolist()]
            held = {name: ([one.get(name) for one in of_keys], inside[name]) for name in set().union(*hands)}
        return ReceivedKeys(self.stream, self.forest.bodies, moments, self.forest.parted(seen), held)
