"""Channel differences: what modes add to channels. Every channel is a list of keys with one interpolation."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.animation.evaluation.components import (
    LOCATION,
    MODE_NUMBERS,
    PART_OF,
    REST_COMPONENTS,
    ROTATION,
    ROWS,
    SCALE,
)
from rigid_motion.animation.evaluation.differences import channel_differences
from rigid_motion.animation.evaluation.sources import KeyedTransform, Marks
from rigid_motion.animation.evaluation.spans import spans
from rigid_motion.animation.fcurves.keys import CODE, INTERPOLATIONS, Cycles, Keys

pytestmark = pytest.mark.any_blender

Track = Sequence[tuple[float, float]]

CODES = {name: code for code, name in INTERPOLATIONS.items()}
FRAMES = (1.0, 13.0, 20.0, 41.0)
ORDERS = (None, "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "AXIS_ANGLE")
SPLINE = MODE_NUMBERS["motor_spline"]


def keys_of(track: Track, interpolation: str = "LINEAR", **others: object) -> Keys:
    points = np.array(track, np.float32)[None]
    eased = interpolation not in ("LINEAR", "CONSTANT")
    easing = {"easing": np.zeros(points.shape[:2], CODE), "easing_settings": np.zeros((3, *points.shape[:2]))}
    codes = np.full(points.shape[:2], CODES[interpolation], CODE)
    return Keys(points, codes, **(easing if eased else {}), **others)


def source_of(
    tracks: dict[int, Track], order: str | None = None, interpolation: str = "LINEAR", **others: object
) -> KeyedTransform:
    """Return a source with one channel per row, linearly extrapolated or cyclic if requested."""
    of_keys = {name: others.pop(name) for name in ("linear", "cycles") if name in others}
    channels = tuple(([row], keys_of(track, interpolation, **of_keys)) for row, track in tracks.items())
    keyed = frozenset(PART_OF[row] for row in tracks)
    return KeyedTransform(
        order,
        keyed,
        channels,
        **{"rest": {}, "original": REST_COMPONENTS.copy(), "mode": MODE_NUMBERS["dq_sclerp"], **others},
    )


def tracks_of(part: str, frames: Iterable[float], rows: np.ndarray) -> dict[int, Track]:
    """Return the tracks of all components of a part, from values (., n)."""
    frames = list(frames)
    return {ROWS[part].start + row: list(zip(frames, values, strict=True)) for row, values in enumerate(rows.tolist())}


def inside(source: KeyedTransform, count: int = 23) -> np.ndarray:
    """Return frames strictly inside all spans."""
    steps = np.arange(1, count) / count
    return np.unique(np.concatenate([span.first + (span.last - span.first) * steps for span in spans(source)]))


def channels(source: KeyedTransform, frames: np.ndarray) -> np.ndarray:
    """Return the expected values of the channels, (10, m)."""
    ((difference, native),) = channel_differences([source], [frames])
    unfilled = [row for row in range(10) if row not in source.filled_rows]
    assert not difference[unfilled].any()
    assert SCALE in source.keyed or not difference[ROWS[SCALE]].any()
    return difference + native


def rotations(order: str | None, count: int, seed: int = 0) -> np.ndarray:
    """Return rotation channels (., n), less than half a turn from key to key, with varying lengths and signs."""
    random = np.random.default_rng(seed)
    if order is None:
        values = np.cumsum(random.normal(size=(4, count)), axis=1)
        return values * random.choice((-1.0, 1.0), count) * np.linspace(0.4, 1.7, count)
    if order == "AXIS_ANGLE":
        return np.concatenate((random.uniform(0.3, 2.0, (1, count)), random.normal(size=(3, count))))
    return random.uniform(-1.3, 1.3, (3, count))


def moving(
    order: str | None = None, seed: int = 0, frames: tuple = FRAMES, **others: object
) -> tuple[dict, KeyedTransform]:
    location = np.random.default_rng(seed + 99).normal(size=(3, len(frames)))
    tracks = tracks_of(LOCATION, frames, location)
    tracks |= tracks_of(ROTATION, frames, rotations(order, len(frames), seed))
    return tracks, source_of(tracks, order, **others)


def at_keys(tracks: dict[int, Track], frame: float) -> np.ndarray:
    rows = REST_COMPONENTS.copy()
    for row, track in tracks.items():
        rows[row] = dict(track)[frame]
    return rows


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "cga_lerp"])
def test_values_are_continuous_from_the_first_key_on_whichever_frames_are_asked_for(order, mode):
    for seed in range(6):
        tracks, source = moving(order, seed, mode=MODE_NUMBERS[mode])
        for span in spans(source):
            frames = np.concatenate(((span.first + 1e-3,), np.linspace(span.first, span.last, 602)[1:-1]))
            rows = channels(source, frames)
            begin = at_keys(tracks, span.first)
            np.testing.assert_allclose(rows[:, 0], begin, atol=5e-3)
            assert np.abs(np.diff(rows[3:7], axis=1)).max() < 0.3
            if order is None and mode == "dq_sclerp":
                lengths = [np.linalg.norm(at_keys(tracks, key)[ROWS[ROTATION]]) for key in (span.first, span.last)]
                evenly = np.interp(frames, (span.first, span.last), lengths)
                np.testing.assert_allclose(np.linalg.norm(rows[ROWS[ROTATION]], axis=0), evenly, atol=1e-6)
            # The values do not depend on the other frames requested in the same call.
            for some in (frames[400:], frames[[17, 550]], frames[[300]]):
                np.testing.assert_allclose(channels(source, some), rows[:, np.isin(frames, some)], atol=1e-9)


@pytest.mark.parametrize("order", ORDERS[1:-1])
def test_keys_at_gimbal_lock_begin_alike_whichever_frames_are_asked_for(order):
    angles = rotations(order, len(FRAMES), 3)
    angles["XYZ".index(order[1])] = np.pi / 2.0, np.pi / 2.0, -np.pi / 2.0, np.pi / 2.0
    source = source_of(moving(order, 3)[0] | tracks_of(ROTATION, FRAMES, angles), order, mode=SPLINE)
    frames = inside(source, 60)
    rows = channels(source, frames)
    for some in (frames[::7], frames[[10]], frames[[100, 130]]):
        np.testing.assert_allclose(channels(source, some), rows[:, np.isin(frames, some)], atol=1e-6)


@pytest.mark.parametrize("order", ["XYZ", "ZXY", "AXIS_ANGLE"])
@pytest.mark.parametrize("turns", [-3.5, 1.25, 12.0])
def test_angles_that_turn_far_are_what_they_are_without_a_mode(order, turns):
    """About a single axis nothing needs correcting, and no angle is off by whole turns."""
    axis = np.array((0.0, 0.0, 2.0, 0.0)) if order == "AXIS_ANGLE" else np.zeros(3)
    rows = np.stack((axis, axis), axis=1)
    rows[0] = 0.5, 0.5 + 2.0 * np.pi * turns
    tracks = tracks_of(ROTATION, (1, 50), rows) | tracks_of(LOCATION, (1, 50), np.zeros((3, 2)))
    source = source_of(tracks, order)
    for frames in (inside(source), np.array((48.0, 49.0))):
        ((difference, _),) = channel_differences([source], [frames])
        np.testing.assert_allclose(difference, 0.0, atol=1e-9)


def test_lengths_of_axes_run_evenly():
    rows = np.array(((0.2, 1.5), (0.0, 0.0), (1.0, 4.0), (0.0, 0.0)))
    source = source_of(tracks_of(ROTATION, (1, 11), rows), "AXIS_ANGLE")
    made = channels(source, np.arange(2.0, 11.0))
    np.testing.assert_allclose(made[5], 1.3 + 0.3 * np.arange(9.0), atol=1e-6)
    np.testing.assert_allclose(made[3], 0.2 + 0.13 * np.arange(1.0, 10.0), atol=1e-6)


@pytest.mark.parametrize("order", [None, "XYZ", "AXIS_ANGLE"])
@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
def test_parts_with_keys_of_their_own_go_round_as_if_all_rounds_had_keys(order, mode):
    tracks, _ = moving(order, 6, frames=(1.0, 8.0, 21.0, 31.0))
    for row in range(3, 3 + len(rotations(order, 2))):
        tracks[row] = [tracks[row][0], (15.0, tracks[row][2][1]), (31.0, tracks[row][0][1])]
    others = {"mode": MODE_NUMBERS[mode]}
    source = source_of(tracks, order, cycles=Cycles("REPEAT_OFFSET", "REPEAT_OFFSET", 2, 0), **others)
    rolled_out = {}
    for row, track in tracks.items():
        change = track[-1][1] - track[0][1]
        rolled_out[row] = [(at + 30.0 * n, now + n * change) for n in range(-2, 3) for at, now in track[:-1]]
    frames = np.arange(1.5, 31.0, 0.5)
    expected = channels(source_of(rolled_out, order, **others), frames)
    np.testing.assert_allclose(channels(source, frames), expected, atol=2e-6)


def test_what_does_not_repeat_is_told_apart():
    tracks, _ = moving(None, 4)
    cycles = Cycles("REPEAT", "REPEAT_OFFSET", 0, 0)
    assert not source_of(tracks, cycles=cycles).is_repeatable
    assert source_of(tracks, cycles=replace(cycles, after="REPEAT")).is_repeatable
    turning = tracks_of(ROTATION, (1, 20), np.array(((0, 0), (0, 0), (0, 1.0))))
    assert source_of(turning, "XYZ", cycles=cycles).is_repeatable
    turning[4] = [(1, 0.0), (20, 2.0)]
    assert not source_of(turning, "XYZ", cycles=cycles).is_repeatable
    later = source_of(turning, "XYZ", cycles=replace(cycles, after="REPEAT"))
    channels_of = (*later.channels, ([0], keys_of([(1, 0.0), (21, 2.0)], cycles=replace(cycles, after="REPEAT"))))
    assert not replace(later, channels=channels_of).is_repeatable
    assert replace(later, channels=(*later.channels, ([0], keys_of([(7, 2.0)])))).is_repeatable


def test_the_digest_follows_marks_and_the_range_that_is_seen():
    _, source = moving(None, 1, seen=(0, 10))
    same = replace(source)
    others = [
        replace(source, mode=Marks(np.array((1.0,)), np.array((2,)))),
        replace(source, turns=keys_of([(1, 1.0)]), turns_axis=Marks(np.array((1.0,)), np.array((1,)))),
        replace(source, turns=keys_of([(1, 1.0)]), turns_axis=Marks(np.array((1.0,)), np.array((2,)))),
        replace(source, original=source.original + 1.0),
    ]
    assert same.digest == source.digest
    assert replace(source, seen=(0, 99)).digest == source.digest
    assert len({source.digest, *(other.digest for other in others)}) == 5
    assert source.digest24 == int(source.digest, 16) >> (4 * len(source.digest) - 24)
