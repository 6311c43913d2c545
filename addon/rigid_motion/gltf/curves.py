"""Key reduction with cubic curves: CUBICSPLINE channels where these need fewer keys than lines.

Unlike with lines, the tolerance holds at the frames of the file. The error between frames is measured and reported.
Channels of scales and weights, and channels that need no search, are treated as with lines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ..motion import Poses, Skeleton
from ..motion.cubic_bodies import CurvedBody, JointCurves, fitted_body
from ..motion.cubic_keys import CubicKeys, Samples, is_of_lines, joined, keyed_at
from ..motion.quaternions import align_signs
from ..motion.skeleton_stretches import stretches
from .clips import ClipReduction, ReducedClip
from .errors import World, Worst
from .rewriting import StoredTrack, stored
from .search import NodeSearch
from .settling import SettledChannel
from .tracks import CUBICSPLINE, LINEAR, ROTATION, TRANSLATION, WEIGHTS, Target, Track, Tracks

STRETCH_FRAMES, MIN_STRETCHES = 500, 2
"""Frames searched in one go, if there are more than MIN_STRETCHES times as many."""

MAX_LINE_ERROR = 1e-6
"""Largest error of values when keys are given: a curve within it is stored as lines."""

MAX_FRAME_GAP_S = 1 / 20
"""Seconds between frames at most: longer gaps between keys are divided into more frames."""

MAX_PROOF_ROUNDS = 12
"""Most rounds of tightening the tolerance when the proof fails."""

TIGHTER_ALLOWANCE_RATIO, TIGHTER_REACH_FRAMES = 0.5, 2
"""Factor on the tolerance, and frames around a failure that get it; for sliding feet, all the time that they stand."""


class CurveReduction(ClipReduction):
    """The search for the curves of one clip."""

    lines = 0
    """Number of keys that lines would need."""

    @cached_property
    def _known(self) -> dict[tuple[int, bytes], list[JointCurves]]:
        """Curves of stretches, by number and allowed errors of the stretch."""
        return {}

    def _moments(self, world: World, channels: Sequence[SettledChannel]) -> np.ndarray:
        """Return the frames: those with keys, and some in between where keys are far apart."""
        moving = [channel for channel in channels if channel.track.path != WEIGHTS and not channel.track.is_constant]
        splines = [channel.times for channel in moving if channel.is_curved]
        keys = np.unique(np.concatenate([world.times, *splines, *(channel.track.times for channel in moving)]))
        parts = np.ceil(np.diff(keys) / MAX_FRAME_GAP_S).astype(np.int64)
        number = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
        between = np.repeat(keys[:-1], parts) + np.repeat(np.diff(keys) / parts, parts) * number
        return np.append(between, keys[-1]).astype(np.float32).astype(np.float64)

    def _within_tolerance(self) -> tuple[list[StoredTrack], Worst] | None:
        if not self.dense:
            return super()._within_tolerance()
        allowed = np.full((len(self.world.moving), len(self.world.times)), self.tolerance)
        for _ in range(MAX_PROOF_ROUNDS):
            tracks = self._curved(allowed)
            self._amount(tracks)
            shown = self._shown(tracks)
            worst, rows, samples = self.world.worst(shown, self.morphed, self.tolerance, parts=1)
            slips = self._slips(shown)
            if not len(rows) and not slips:
                worst = max(worst, self.world.morphed(shown)[0])
                return (tracks, worst) if worst.error <= self.tolerance else None
            for row, sample in zip(rows.tolist(), samples.tolist(), strict=True):
                allowed[row, max(sample - TIGHTER_REACH_FRAMES, 0) : sample + TIGHTER_REACH_FRAMES + 1] *= (
                    TIGHTER_ALLOWANCE_RATIO
                )
            for row, first, end in slips:
                some = allowed[row, first:end]
                some[:] = TIGHTER_ALLOWANCE_RATIO * np.minimum(some, self.more_slide / TIGHTER_ALLOWANCE_RATIO)
        return None

    def _key_poses(self, keys: np.ndarray) -> list[StoredTrack]:
        tracks = [stored(track, integers=False) for track in self.settled.values()]
        for (_, path), track in self.dense.items():
            exactly = np.full(len(self.world.times), MAX_LINE_ERROR)
            samples = Samples(track.at(self.world.times), exactly, path == ROTATION)
            tracks.append(stored(_as_track(track, keyed_at(self.world.times, samples, keys)), integers=False))
        return self._spanning(tracks)

    def _slips(self, shown: Tracks) -> set[tuple[int, int, int]]:
        """Return spans in which joints stand but slide too far: row, first sample, and the sample after the last."""
        rows, samples = self.feet.slips(shown, self.more_slide)
        spans = self.feet.spans.tolist()
        return {
            (row, first, last + 1)
            for slid, sample in zip(rows.tolist(), samples.tolist(), strict=True)
            for row, first, last in spans
            if row == slid and first <= sample <= last
        }

    def _result(self, tracks: list[StoredTrack], worst: Worst) -> ReducedClip:
        between = self.world.worst(self._shown(tracks), self.morphed)[0].error
        return replace(super()._result(tracks, worst), between=between, lines=self.lines)

    @cached_property
    def storing(self) -> tuple[frozenset[Target], float]:
        """Nothing is stored as integers."""
        return frozenset(), 0.0

    def _curved(self, allowed: np.ndarray) -> list[StoredTrack]:
        """Return all tracks as stored, given the allowed errors (n, m)."""
        world = self.world
        some = self._stretches()
        tasks = [(number, allowed[:, own].tobytes()) for number, own in enumerate(some)]
        new = [task for task in tasks if task not in self._known]
        bodies = (self._body(some[number], allowed) for number, _ in new)
        self._known |= zip(new, self.options.run(fitted_body, bodies), strict=True)
        parts = [self._known[task] for task in tasks]
        joints = [_joined(curves) for curves in zip(*parts, strict=True)]
        self.lines = sum(curves.lines for curves in joints)
        tracks = [stored(track, integers=False) for track in self.settled.values()]
        for (node, path), track in self.dense.items():
            curves = joints[world.rows[node]]
            keys = curves.rotation if path == ROTATION else curves.location
            assert keys is not None
            tracks.append(stored(_as_track(track, keys), integers=False))
        return self._spanning(tracks)

    def _stretches(self) -> list[slice]:
        """Return the frame ranges that are searched one by one: all channels have keys where they meet."""
        count = len(self.world.times)
        return stretches(count, STRETCH_FRAMES) if count > MIN_STRETCHES * STRETCH_FRAMES else [slice(0, count)]

    def _body(self, some: slice, allowed: np.ndarray) -> CurvedBody:
        """Return the nodes of the world at some of the moments as a body."""
        world, skeleton, times = self.world, Skeleton(self.world.parents), self.world.times[some]
        nothing, nodes = np.zeros(len(world.moving), dtype=bool), world.moving.tolist()
        curved = np.array([[(node, path) in self.dense for path in (TRANSLATION, ROTATION)] for node in nodes])
        lengths, tracks = world.lengths_above(times), {**self.given, **self.settled, **self.dense}
        truth, local = (NodeSearch(world, own, nothing, map).poses(some) for own in (world.truth, tracks))
        local = Poses(local.positions / lengths, align_signs(local.quaternions))
        truth = skeleton.in_root_space(truth)
        return CurvedBody(times, skeleton, truth, local, lengths, world.radii, curved, allowed[:, some], True)


def _joined(parts: Sequence[JointCurves]) -> JointCurves:
    location, rotation = (
        None if curves[0] is None else joined(curves, are_turns=bool(number))
        for number, curves in enumerate(zip(*(part[:2] for part in parts), strict=True))
    )
    return JointCurves(location, rotation, sum(part.lines for part in parts))


def _as_track(track: Track, keys: CubicKeys) -> Track:
    if is_of_lines(keys):
        return replace(track, interpolation=LINEAR, times=keys.times, values=keys.values)
    values = np.stack((keys.arriving, keys.values, keys.leaving), axis=1)
    return replace(track, interpolation=CUBICSPLINE, times=keys.times, values=values)
