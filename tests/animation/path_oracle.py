"""Oracle for paths: the path of a mode between two keys, and its adjustment where breakdowns lie beside it.

Smooth modes, which pass keys at speeds of their own, are computed from their formula.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate, twists
from rigid_motion.motion.quaternions import multiply, rotate
from tests.animation.spin_oracle import Spin
from tests.animation.timing_oracle import progress

if TYPE_CHECKING:
    from tests.animation.body_oracle import Body


class Path:
    """The path of a mode in the segment between two keys that shape it."""

    def __init__(self, body: Body, frame: float, mode: str) -> None:
        self.body, self.mode, self.keys = body, mode, body.shaping
        self.first, self.last = self.keys[self.keys <= frame][-1], self.keys[self.keys > frame][0]

    def poses(self, share: np.ndarray, elapsed: np.ndarray | None = None) -> Poses:
        """Return the poses at this progress; without times, along the path alone."""
        if not KEYFRAME_MODES[self.mode].is_smooth:
            ends = self.body.key_poses(np.array((self.first, self.last)))
            spin, ends.quaternions[1] = self.body.spin_and_end(self.first, self.last)
            return spin.add_to(interpolate((0.0, 1.0), ends, share, self.mode, extrapolate=True), share)
        leaving, arriving = self._end_tangents()
        if elapsed is not None:
            share = share + leaving[1] * elapsed * (1.0 - elapsed) ** 2 - arriving[1] * elapsed**2 * (1.0 - elapsed)
        return self.body.spin(self.first, self.last).add_to(self._smooth(share, (leaving[0], arriving[0])), share)

    def _smooth(self, share: np.ndarray, tangents: tuple[float, float]) -> Poses:
        """Return the segment with its adjacent keys. Beside a segment that holds, the object rests."""
        place = int(np.flatnonzero(self.keys == self.first)[0])
        around = self.keys[max(place - 1, 0) : place + 3]
        shown = around.copy()
        before = int(place > 0)
        if before and self.body.codes(around[0]) == {"CONSTANT"}:
            shown[0] = shown[1]
        if len(around) > before + 2 and self.body.codes(around[before + 1]) == {"CONSTANT"}:
            shown[before + 2] = shown[before + 1]
        spins = [
            self.body.spin(*pair) if pair == pair_shown else Spin()
            for pair, pair_shown in zip(itertools.pairwise(around), itertools.pairwise(shown), strict=True)
        ]
        return _with_tangents(around, self.body.key_poses(shown), before, share, tangents, spins)

    def _end_tangents(self) -> list[tuple[float, float]]:
        """Return the length of the tangent, and the missing slope of progress, at both ends of a segment."""
        place, codes = int(np.flatnonzero(self.keys == self.first)[0]), self.body.codes(self.first)
        passings = [(1.0, 0.0), (1.0, 0.0)]
        if "BEZIER" in codes and codes <= {"LINEAR", "BEZIER"}:
            if place > 0:
                passings[0] = _key_tangent(self.body, self.keys[place - 1 : place + 2], after=True)
            if place + 2 < len(self.keys):
                passings[1] = _key_tangent(self.body, self.keys[place : place + 3], after=False)
        return passings

    def beside(self, frames: np.ndarray, share: np.ndarray) -> Poses:
        """Return poses between two keys (2,), at least one a breakdown: on the path, plus the offsets of the keys."""
        places, offs = self.nearest(frames)
        (first, second), growths = offs[:, :6], offs[:, 6]
        poses = self.poses(places[0] + (places[1] - places[0]) * share)
        blend = np.clip(share, 0.0, 1.0)
        if self.mode == "motor_spline":
            blend = blend * blend * (3.0 - 2.0 * blend)
        change = steps(_as_poses(first[:, None]), _as_poses(second[:, None]))[:, :6].T
        poses = _moved_along(
            _moved_along(poses, _as_poses(first[:, None] * np.ones(len(share)))), _as_poses(change * blend)
        )
        if poses.scales is not None:
            poses = replace(poses, scales=poses.scales * np.exp(growths[0] + blend * (growths[1] - growths[0])))
        return poses

    def nearest(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the positions on the path nearest to keys (2,), and the offsets of the keys from the path, (2, 7).

        One radian counts as one unit of length. Keys that shape the path are at its ends, even where the path rests.

        """
        keys, places = self.body.key_poses(frames), []
        for number, frame in enumerate(frames):
            if frame in (self.first, self.last):
                places.append(float(frame == self.last))
                continue
            low, high = -0.25, 1.25
            for _ in range(7):
                grid, step = np.linspace(low, high, 49, retstep=True)
                off = steps(self.poses(grid), keys[np.full(len(grid), number)])
                place = grid[np.argmin((off**2).sum(axis=1))]
                # At an end, one step beyond it is searched as well.
                low, high = np.clip((place - step, place + step), -0.25 - 1.0 / 32.0, 1.25 + 1.0 / 32.0)
            places.append(place)
        return np.array(places), steps(self.poses(np.array(places)), keys)


def _key_tangent(body: Body, keys: np.ndarray, *, after: bool) -> tuple[float, float]:
    """Return the tangent's length, and the missing slope of progress, before or after the middle one of three keys."""
    times = np.diff(keys)
    begin, end = keys[after : after + 2]
    frames = keys[1] + times[int(after)] / 8.0 * (np.arange(4) if after else -np.arange(4))
    poses = body.key_poses(keys)
    spun = np.array([body.spin(*pair).twist(poses.quaternions[1]) for pair in itertools.pairwise(keys)])
    screws = steps(poses[[0, 1]], poses[[1, 2]]) + spun
    progressed = progress(body.curves, begin, end, frames, body.turns(begin))
    rate = np.polyfit(frames - keys[1], progressed, 3)[2]
    # Angles turn by the spin, too, and less than half a turn remains without it.
    by_angles = body.spin(begin, end, channel=False)
    left = by_angles._replace(turns=-by_angles.turns).add_to(body.key_poses(frames), progressed)
    native = np.polyfit(frames - keys[1], steps(left[[0] * 4], left), 3)[2] + rate * spun[int(after)]
    if np.abs(screws[:, :6]).max() > 1e-9:
        screws[:, 6] = 0.0
    share = _weight_before(*times)
    speeds = [part * screw / time for part, screw, time in zip((share, 1.0 - share), screws, times, strict=True)]
    mean = sum(speeds)
    squared = max(mean @ mean, 0.01 * sum(speed @ speed for speed in speeds))
    if not squared > 0.0:
        return 0.0, 0.0
    length = screws[int(after)] / times[int(after)] @ mean / squared
    if share == float(not after):
        return length, 0.0
    passed = native @ mean / squared / np.copysign(max(abs(length), 0.1), length)
    return length, np.clip(passed, -3.0, 3.0) - np.clip(rate * times[int(after)], -3.0, 3.0)


def _with_tangents(
    times: np.ndarray,
    keys: Poses,
    segment: int,
    u: np.ndarray,
    tangents: tuple[float, float],
    spins: Sequence[Spin],
) -> Poses:
    """Return the segment between keys whose tangents are multiplied by these factors, without its own spin.

    A key before or after which the body rests has no tangent.
    """
    screws, durations = steps(keys[:-1], keys[1:]), np.diff(times)
    leaving, arriving = (
        screws + [spin.twist(quaternion) for spin, quaternion in zip(spins, keys.quaternions[at], strict=True)]
        for at in (slice(None, -1), slice(1, None))
    )
    bends = []
    for key, tangent in zip((segment, segment + 1), tangents, strict=True):
        own = (leaving if key == segment else arriving)[segment]
        rate = own / durations[segment]
        if 0 < key < len(durations):
            part = _weight_before(*durations[key - 1 : key + 1])
            rate = part * arriving[key - 1] / durations[key - 1] + (1.0 - part) * leaving[key] / durations[key]
            # Differences of rounding size count as rest.
            rate = rate * (min(np.abs(arriving[key - 1]).max(), np.abs(leaving[key]).max()) > 1e-6)
        bends.append(tangent * durations[segment] * rate - own)
    first = np.where(u < 0.0, u, np.where(u > 1.0, 0.0, u * (1.0 - u) ** 2))
    second = np.where(u < 0.0, 0.0, np.where(u > 1.0, u - 1.0, -(u**2) * (1.0 - u)))
    added = np.outer(bends[0], first) + np.outer(bends[1], second)
    rigid = Poses(keys.positions, keys.quaternions)[segment : segment + 2]
    result = _moved_along(interpolate((0.0, 1.0), rigid, u, "dq_sclerp", extrapolate=True), _as_poses(added[:6]))
    if keys.scales is None:
        return result
    return replace(result, scales=keys.scales[segment] * np.exp(u * screws[segment, 6] + added[6]))


def _weight_before(before: float, after: float) -> float:
    """Return the weight of the twist before a key in the twist at the key."""
    if max(before, after) >= 16.0 * min(before, after):
        return float(before > after)
    return min(max(after / (before + after), 1.0 - after / before), before / after)


def steps(first: Poses, second: Poses) -> np.ndarray:
    """Return the twists from poses (n,) to others, and the change of log scale, shape (n, 7)."""
    result = twists.between(first.positions, first.quaternions, second.positions, second.quaternions)
    grown = np.zeros(len(first)) if first.scales is None else np.log(np.maximum(second.scales, 1e-3) / first.scales)
    return np.vstack((result, grown)).T


def _as_poses(rows: np.ndarray) -> Poses:
    quaternions, translations = twists.exponential(rows)
    return Poses(translations.T, quaternions.T)


def _moved_along(poses: Poses, moves: Poses) -> Poses:
    """Return poses after moves along the body's own axes."""
    positions = poses.positions + rotate(poses.quaternions, moves.positions)
    return Poses(positions, multiply(poses.quaternions, moves.quaternions), poses.scales)
