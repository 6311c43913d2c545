"""Even speed along a path: moves keys in time and sets handles for the timing between them, while the path stays.

In a segment with a mode, or with straight channels from key to key, the path is independent of the progress along it: a
cubic of progress is fitted. Where Blender's own in-betweens bend, their values stay and their times are fitted, if all
channels share the same times. The path of *Smooth Screw* depends on the times of its keys: retiming is repeated until
these settle, and the change of the path is measured. A body that rests, rests as long as before.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from bpy.app.translations import pgettext_n as n_

from ...motion.affine import AffineMaps
from ...motion.quaternions import matrices
from ...motion.speeds import ways_and_turns
from ..actions.channels import code_of, key_fields, set_key_fields
from ..actions.reading import read
from ..actions.slots import Binding
from ..evaluation.components import SMOOTH_MODES
from ..evaluation.differences import in_betweens
from ..evaluation.marks import which_vary
from ..evaluation.sources import SAME_FRAME, KeyedTransform, distinct
from ..fcurves.keys import BEZIER, LINEAR
from ..fcurves.keys import CONSTANT as CONSTANT_KEY
from ..transforms import Refused, Transform
from .apply import Readings, Targets, apply_edit, editable_keys

CONSTANT, EASE_IN, EASE_OUT, EASE_IN_OUT = EASES = ("CONSTANT", "EASE_IN", "EASE_OUT", "EASE_IN_OUT")

SHARES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    CONSTANT: lambda time: time,
    EASE_IN: lambda time: 0.5 * time**2 * (3.0 - time),
    EASE_OUT: lambda time: 0.5 * time * (3.0 - time**2),
    EASE_IN_OUT: lambda time: time**2 * (3.0 - 2.0 * time),
}
"""The fraction of the way done at a fraction of the time: cubics, which handles reproduce exactly. An ease-in reaches
full speed at the end, without a jump of acceleration."""

SAMPLES_PER_SEGMENT = 256
"""The number of samples for measuring a segment; for half a turn the measured length is 6 millionths too short."""

MIN_WAY_RATIO = 1e-6
"""The largest fraction of the whole way for which a body counts as resting from key to key: rounding."""

MIN_WAY = 1e-5
"""The largest whole way, in Blender's units or radians, for which a body counts as not moving."""

MAX_TIME_GAP = 1e-4
"""The largest difference in time of handles that count as shared, as a fraction of the segment."""

MAX_BEND_RATIO = 1e-5
"""The largest distance of a channel from its chord at which it counts as straight, as a fraction of the chord."""

SMOOTH_ROUNDS = 12
"""The number of rounds of moving the keys of *Smooth Screw*, until they settle."""

MAX_BISECTIONS = 52
"""Halvings after which a number from 0 to 1 is as exact as it gets."""

EVEN_HANDLE_RATIOS = (1.0 / 3.0, 2.0 / 3.0)


class EvenSpeed(NamedTuple):
    """The result for the motion of one target between two keys."""

    first: float
    last: float

    speed: float
    """The mean speed while it moves, in Blender's units or radians per frame."""

    is_turning: bool

    unevenness: float
    """The largest difference from the intended speed, as a fraction of the mean."""

    bend: float
    """The largest distance of the path from the previous one, in Blender's units."""


def equalise_speed(
    targets: Targets,
    ease: str = CONSTANT,
    frames: Sequence[float] | None = None,
    *,
    turning: bool = False,
    between_frames: bool = False,
    refused: list[Refused] | None = None,
) -> dict[Transform, EvenSpeed]:
    """Make bodies move at an even speed along their paths, which stay as they are.

    For targets and refusals see `apply`.

    Parameters
    ----------
    ease : str
        One of `EASES`: the speed at the beginning and at the end.
    frames : sequence of float, optional
        Frames of keys: the motion from the first to the last of them changes. The default is from the first key of all
        to the last.
    turning : bool
        Even out the rate of rotation instead of the speed of origins. This is always so if origins stay in place.
    between_frames : bool
        Put keys exactly where an even speed needs them, not on the nearest whole frames.
    """
    if ease not in EASES:
        raise Refused(n_("{ease} is not an easing of speed: give one of {eases}"), ease=ease, eases=", ".join(EASES))

    def plan(transform: Transform, readings: Readings) -> tuple[Binding, _Run]:
        binding, source = editable_keys(transform, readings)
        return binding, _run_of(transform, source, frames, turning)

    def act(_: Transform, planned: tuple[Binding, _Run]) -> EvenSpeed:
        binding, before = planned
        run = before
        for _round in range(SMOOTH_ROUNDS if before.is_smooth.any() else 0):
            moved = run.even_frames(ease)
            _retime(binding, run, moved, ease)
            run = _measure_run(read(binding), moved, before.is_turning)
        even = run.even_frames(ease) if between_frames else on_whole_frames(run.even_frames(ease))
        _retime(binding, run, even, ease)
        return _measure_run(read(binding), even, before.is_turning, as_timed=True).compared(before, ease)

    return apply_edit(targets, plan, act, refused)


@dataclass(frozen=True, eq=False)
class _Run:
    """The motion of a body from its first to its last key: n segments with m samples each."""

    source: KeyedTransform
    frames: np.ndarray
    """The frames of the keys, shape (n + 1,)."""

    is_smooth: np.ndarray
    """True for segments of *Smooth Screw*, shape (n,): their flow through keys depends on frames, not on handles."""

    times: np.ndarray
    """The frames of samples: at even steps of the parameter of a segment from 0 to 1, shape (n, m)."""

    bends: np.ndarray
    """True for segments whose values must stay, as they are no straight line from key to key, shape (n,)."""

    fits: np.ndarray
    """True for segments whose timing can be set by handles, shape (n,)."""

    points: np.ndarray
    """The positions of samples, shape (n, m, 3)."""

    ways: np.ndarray
    """The way from the start of the segment to each sample, in units or radians, shape (n, m)."""

    is_turning: bool

    @property
    def rests(self) -> np.ndarray:
        """True for segments in which the body rests, shape (n,)."""
        return self.ways[:, -1] <= MIN_WAY_RATIO * self.ways[:, -1].sum()

    @property
    def shares(self) -> np.ndarray:
        """The fraction of the whole way done at each key, shape (n + 1,)."""
        done = np.append(0.0, np.cumsum(np.where(self.rests, 0.0, self.ways[:, -1])))
        return done / done[-1]

    def even_frames(self, ease: str) -> np.ndarray:
        """Return the frames (n + 1,) of the keys for an even speed."""
        resting = np.append(0.0, np.cumsum(np.where(self.rests, np.diff(self.frames), 0.0)))
        moving = self.frames[-1] - self.frames[0] - resting[-1]
        result = self.frames[0] + resting + moving * _time_at(self.shares, ease)
        result[[0, -1]] = self.frames[[0, -1]]
        return result.astype(np.float32).astype(np.float64)  # as keys have them

    def timing(self, segment: int, ease: str) -> tuple[np.ndarray, np.ndarray]:
        """Return the handles of a segment, as fractions of its frames and of its change of values, (2,) each.

        The latter are NaN if values stay.
        """
        shares = self.shares[segment : segment + 2]
        done = shares[0] + np.diff(shares) * self.ways[segment] / self.ways[segment, -1]
        first, last = _time_at(shares, ease)
        u, at = np.linspace(0.0, 1.0, done.size), (_time_at(done, ease) - first) / (last - first)
        if self.bends[segment]:
            times = _fitted_handles(u, at)
            if times[0] > times[1]:
                times[:] = times.mean()  # Blender shortens handles that pass one another
            return times, np.full(2, np.nan)
        return np.array(EVEN_HANDLE_RATIOS), np.array(EVEN_HANDLE_RATIOS) if self.is_smooth[
            segment
        ] else _fitted_handles(u, np.interp(u, at, u))

    def compared(self, before: _Run, ease: str) -> EvenSpeed:
        """Return the result, compared with the run before."""
        moves = ~self.rests
        durations = np.diff(self.frames) * moves
        begins, total = np.append(0.0, np.cumsum(durations)), float(self.ways[moves, -1].sum())
        times = (begins[:-1, None] + self.times - self.frames[:-1, None])[moves] / begins[-1]
        meant, done = (np.diff(rows, axis=1) for rows in (SHARES[ease](times), self.ways[moves] / total))
        uneven = float((np.abs(done - meant) / np.diff(times, axis=1)).max())
        bend = max(_largest_distance(new, old) for new, old in zip(self.points, before.points, strict=True))
        ends = float(self.frames[0]), float(self.frames[-1])
        return EvenSpeed(*ends, total / float(begins[-1]), self.is_turning, uneven, bend)


def _run_of(transform: Transform, source: KeyedTransform, frames: Sequence[float] | None, turning: bool) -> _Run:
    """Return the part of a source to even out. Raise `Refused` if that is impossible."""
    if source.switches:
        text = n_("{name} passes from hand to hand: its keys are in the spaces of the hands, not on one path")
        raise Refused(text, name=transform.name)
    varying = [keys for _, keys in source.channels if which_vary(keys).any()]
    keyed = distinct(np.unique(np.concatenate([np.empty(0), *(keys.times for keys in varying)])))
    if frames is not None:
        first, last = min(frames, default=np.inf), max(frames, default=-np.inf)
        keyed = keyed[(keyed > first - SAME_FRAME) & (keyed < last + SAME_FRAME)]
    if len(keyed) < 2:
        raise Refused(n_("{name} has no two keys to move between: select more keys, or key it"), name=transform.name)
    for keys in varying:
        lacks = np.abs(keyed[:, None] - keys.times).min(axis=1) > SAME_FRAME
        if lacks.any():
            text = n_("{name}: only some channels have a key on frame {frame:g}: key everything that moves there")
            raise Refused(text, name=transform.name, frame=float(keyed[lacks][0]))
    run = _measure_run(source, keyed, turning)
    if not turning and run.ways.sum() <= MIN_WAY:
        run = _measure_run(source, keyed, turning=True)
    if run.ways[:, -1].sum() <= MIN_WAY:
        text = n_("{name} does not move from frame {first:g} to {last:g}: select other keys")
        raise Refused(text, name=transform.name, first=float(keyed[0]), last=float(keyed[-1]))
    return run


def _measure_run(source: KeyedTransform, frames: np.ndarray, turning: bool, *, as_timed: bool = False) -> _Run:
    """Return the measured run of a source over keys on these frames (n + 1,), on which all changing channels have keys.

    Samples are in even steps of time if `as_timed`, otherwise in even steps of the parameter that handles set.
    """
    count, m = len(frames) - 1, SAMPLES_PER_SEGMENT + 1
    u, durations = np.linspace(0.0, 1.0, m), np.diff(frames)
    even = frames[:-1, None] + durations[:, None] * u
    modes = np.array([source.mode_at(frame) for frame in even[:, m // 2].tolist()])
    handles, jumps, holds = _time_handles(source, frames)
    progress, is_straight = _progress(source, even)
    bends, times = (modes == 0) & ~is_straight, even.copy()
    fits = ~jumps & (~bends | np.isfinite(handles).all(axis=1))
    for segment in np.flatnonzero(bends & fits & (not as_timed)):
        times[segment, 1:-1] += durations[segment] * (_bezier(u, *handles[segment]) - u)[1:-1]
    inside = np.append(times[:, :-1], frames[-1])
    poses = in_betweens(source, inside, progress=None if as_timed else np.append(np.tile(u[:-1], count), 1.0)).desired
    maps = AffineMaps(np.moveaxis(matrices(poses.quaternions), -1, 0), poses.positions)
    steps = ways_and_turns(maps)[turning].reshape(count, m - 1) * ~holds[:, None]
    ways = np.concatenate((np.zeros((count, 1)), np.cumsum(steps, axis=1)), axis=1)
    for segment in np.flatnonzero((modes == 0) & is_straight & (not as_timed)):
        ways[segment] = np.interp(u, progress[segment], ways[segment])
    points = poses.positions[np.arange(count)[:, None] * (m - 1) + np.arange(m)]
    return _Run(source, frames, np.isin(modes, SMOOTH_MODES), times, bends, fits, points, ways, turning)


def _time_handles(source: KeyedTransform, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the handles of segments as fractions of their frames, NaN if channels differ or ease, (n, 2); for which
    segments any channel jumps at the end, and for which all do, both (n,).
    """
    ends, constant = [], []
    for _, keys in source.channels:
        at = np.abs(frames[:, None] - keys.times).argmin(axis=1)
        for curve in np.flatnonzero(which_vary(keys)):
            codes = keys.interpolation[curve, at[:-1]]
            both = np.tile(EVEN_HANDLE_RATIOS, (len(codes), 1))
            if keys.left is not None and keys.right is not None:
                times = np.stack((keys.right[curve, at[:-1], 0], keys.left[curve, at[1:], 0]), axis=1)
                both = np.clip((times - frames[:-1, None]) / np.diff(frames)[:, None], 0.0, 1.0)
            both = np.where((codes == LINEAR)[:, None], EVEN_HANDLE_RATIOS, both)
            ends.append(np.where((codes == BEZIER) | (codes == LINEAR), both.T, np.nan).T)
            constant.append(codes == CONSTANT_KEY)
    result = np.where(np.ptp(ends, axis=0) < MAX_TIME_GAP, ends[0], np.nan)
    return result, np.any(constant, axis=0), np.all(constant, axis=0)


def _progress(source: KeyedTransform, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the progress of channels on frames (n, m) of n segments, and which run straight and never back, (n,)."""
    values = source.values_at(frames.ravel()).reshape(10, *frames.shape)
    change = values[..., -1] - values[..., 0]
    weights = change / np.maximum(np.square(change).sum(axis=0), MIN_WAY**2)
    progress = np.einsum("rs,rsm->sm", weights, values - values[..., :1])
    off = np.abs(values - values[..., :1] - change[..., None] * progress).max(axis=(0, 2))
    rises = np.all(np.diff(progress) >= -MAX_BEND_RATIO, axis=1)
    return progress, rises & (off <= MAX_BEND_RATIO * np.abs(change).max(axis=0))


def _time_at(shares: np.ndarray, ease: str) -> np.ndarray:
    """Return the fractions of the time at which fractions of the way (n,) are done."""
    low, high = np.zeros(shares.shape), np.ones(shares.shape)
    for _bisection in range(MAX_BISECTIONS):
        middle = 0.5 * (low + high)
        is_past = SHARES[ease](middle) > shares
        low, high = np.where(is_past, low, middle), np.where(is_past, middle, high)
    return 0.5 * (low + high)


def on_whole_frames(frames: np.ndarray) -> np.ndarray:
    """Return rising frames (n + 1,) rounded, each after the one before, if there is room; the ends stay unchanged."""
    inner, first, last = np.rint(frames[1:-1]), np.floor(frames[0]) + 1.0, np.ceil(frames[-1]) - 1.0
    steps = np.arange(len(inner))
    if last - first + 1.0 < len(inner):
        return frames
    inner = np.maximum.accumulate(np.maximum(inner, first) - steps) + steps
    inner = np.minimum.accumulate((np.minimum(inner, last) - steps)[::-1])[::-1] + steps
    return np.concatenate((frames[:1], inner, frames[-1:]))


def _bezier(at: np.ndarray, first: float, second: float) -> np.ndarray:
    """Return the cubic Bezier from 0 to 1 with these two inner control values, at parameters (m,)."""
    rest = 1.0 - at
    return 3.0 * rest**2 * at * first + 3.0 * rest * at**2 * second + at**3


def _fitted_handles(at: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the two handles of the cubic from 0 to 1 whose slope best fits that of values (m,) at parameters (m,)."""
    middle, slopes = 0.5 * (at[1:] + at[:-1]), np.diff(values) / np.maximum(np.diff(at), MIN_WAY**2)
    rest = 1.0 - middle
    parts = np.stack((3.0 * rest * (1.0 - 3.0 * middle), 3.0 * middle * (2.0 - 3.0 * middle)), axis=1)
    # Where slopes are steep the body is slow, so an error shows less.
    weights = np.diff(at) / np.maximum(slopes, 1.0)
    return np.clip(np.linalg.lstsq(weights[:, None] * parts, weights * (slopes - 3.0 * middle**2), rcond=None)[0], 0, 1)


def _retime(binding: Binding, run: _Run, frames: np.ndarray, ease: str) -> None:
    """Move the keys of a run to new frames (n + 1,), and set the handles between them."""
    scales, last = np.diff(frames) / np.diff(run.frames), len(frames) - 2
    free, bezier, linear = (
        code_of(*names)
        for names in (("handle_left_type", "FREE"), ("interpolation", "BEZIER"), ("interpolation", "LINEAR"))
    )
    turns = binding.curves.get(binding.users[0].turns_channel)
    for fcurve in filter(None, (*binding.moving.values(), turns)):
        fields = key_fields(fcurve.keyframe_points)
        points, left, right = (fields[name] for name in ("co", "handle_left", "handle_right"))
        old = points[:, 0].astype(np.float64)
        chosen = np.flatnonzero((old > run.frames[0] - SAME_FRAME) & (old < run.frames[-1] + SAME_FRAME))
        if not len(chosen):
            continue
        points[chosen, 0] = np.interp(old[chosen], run.frames, frames)
        for handles, side, ahead in ((left, "left", -SAME_FRAME), (right, "right", SAME_FRAME)):
            at = np.searchsorted(run.frames, old[chosen] + ahead) - 1
            scale = np.where((at < 0) | (at > last), 1.0, scales[np.clip(at, 0, last)])
            handles[chosen, 0] = points[chosen, 0] + (handles[chosen, 0] - old[chosen]) * scale
            fields[f"handle_{side}_type"][chosen] = free
        for key, following in pairwise(chosen.tolist() if fcurve is not turns else ()):
            segment = int(np.abs(run.frames - old[key]).argmin())
            spans = np.abs(run.frames[segment : segment + 2] - old[[key, following]]).max() < SAME_FRAME
            if segment > last or not spans or run.rests[segment] or not run.fits[segment]:
                continue
            times, values = run.timing(segment, ease)
            change = (points[following] - points[key]).astype(np.float64)
            right[key, 0], left[following, 0] = points[key, 0] + times * change[0]
            if not run.bends[segment]:
                right[key, 1], left[following, 1] = points[key, 1] + values * change[1]
            fields["interpolation"][key] = linear if run.is_smooth[segment] else bezier
        set_key_fields(fcurve, fields)


def _largest_distance(points: np.ndarray, line: np.ndarray) -> float:
    """Return the largest distance of points (m, 3) from a polyline through other points (m, 3)."""
    start, along = line[:-1], np.diff(line, axis=0)
    away = points[:, None] - start
    share = np.einsum("psk,sk->ps", away, along) / np.maximum(np.einsum("sk,sk->s", along, along), MIN_WAY**4)
    nearest = away - np.clip(share, 0.0, 1.0)[..., None] * along
    return float(np.sqrt(np.einsum("psk,psk->ps", nearest, nearest).min(axis=1).max()))
