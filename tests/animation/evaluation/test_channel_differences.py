"""What is added to channels, against the same worked out frame by frame from matrices."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.animation.evaluation.components import LOCATION, MODE_NUMBERS, REST, ROTATION, ROWS, SCALE
from rigid_motion.animation.evaluation.differences import channel_differences, in_betweens
from rigid_motion.animation.evaluation.sources import Marks, Source
from rigid_motion.animation.evaluation.spans import spans
from rigid_motion.animation.fcurves.keys import Cycles
from rigid_motion.motion import Poses, interpolate
from tests.animation.evaluation.by_frame import (
    Track,
    channels,
    inside,
    keys_of,
    matrix,
    pose_of,
    screwed,
    segment,
    share,
    source_of,
    tracks_of,
    turned,
    value,
)

FRAMES = (1.0, 13.0, 20.0, 41.0)
ORDERS = (None, "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "AXIS_ANGLE")
SPLINE = MODE_NUMBERS["motor_spline"]


def rotations(order: str | None, count: int, seed: int = 0) -> np.ndarray:
    """Channels of rotations, less than half a turn from each to the next: lengths and signs differ. Shape (., n)."""
    random = np.random.default_rng(seed)
    if order is None:
        values = np.cumsum(random.normal(size=(4, count)), axis=1)
        return values * random.choice((-1.0, 1.0), count) * np.linspace(0.4, 1.7, count)
    if order == "AXIS_ANGLE":
        return np.concatenate((random.uniform(0.3, 2.0, (1, count)), random.normal(size=(3, count))))
    return random.uniform(-1.3, 1.3, (3, count))


def moving(order: str | None = None, seed: int = 0, frames: tuple = FRAMES, **others: object) -> tuple[dict, Source]:
    location = np.random.default_rng(seed + 99).normal(size=(3, len(frames)))
    tracks = tracks_of(LOCATION, frames, location)
    tracks |= tracks_of(ROTATION, frames, rotations(order, len(frames), seed))
    return tracks, source_of(tracks, order, **others)


def at_keys(tracks: dict[int, Track], frame: float) -> np.ndarray:
    rows = REST.copy()
    for row, track in tracks.items():
        rows[row] = dict(track)[frame]
    return rows


def expected_pose(
    tracks: dict[int, Track], order: str | None, frame: float, interpolation: str, original: np.ndarray = REST
) -> tuple[np.ndarray, float, tuple[float, float]]:
    """The pose on a frame, the progress there, and the keys around."""
    keys = [at for at, _ in tracks[3]]
    index = segment(keys, frame)
    ends = keys[index], keys[index + 1]
    now = {row: value(track, frame, interpolation) for row, track in tracks.items()}
    progress = share(tracks.values(), order, tracks, ends, now)
    first, second = (pose_of(at_keys(tracks, end), order, original) for end in ends)
    return screwed(first, second, progress), progress, ends


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("interpolation", ["LINEAR", "QUAD"])
def test_channels_move_the_body_as_the_screw_does(order, interpolation):
    own = np.array((0.4, -1.0, 2.0, 0.5, 0.5, -0.5, 0.5, 1.0, 1.0, 1.0))
    for seed, original in enumerate((REST, own, REST)):
        tracks, source = moving(order, seed, interpolation=interpolation, original=original)
        frames = inside(source)
        for frame, rows in zip(frames, channels(source, frames).T, strict=True):
            expected, _, _ = expected_pose(tracks, order, frame, interpolation, original)
            np.testing.assert_allclose(pose_of(rows, order, original), expected, atol=1e-7)


def test_quaternions_are_as_long_as_those_of_the_keys_and_in_the_sign_of_the_first():
    tracks, source = moving(seed=5, interpolation="QUAD")
    frames = inside(source)
    for frame, rows in zip(frames, channels(source, frames).T, strict=True):
        pose, progress, ends = expected_pose(tracks, None, frame, "QUAD")
        first, last = (at_keys(tracks, end)[ROWS[ROTATION]] for end in ends)
        unit = np.roll(Rotation.from_matrix(pose[:3, :3]).as_quat(), 1)
        length = (1.0 - progress) * np.linalg.norm(first) + progress * np.linalg.norm(last)
        # Less than half a turn from the first key, so on its side.
        sign = 1.0 if unit @ first > 0.0 else -1.0
        np.testing.assert_allclose(rows[ROWS[ROTATION]], sign * length * unit, atol=1e-7)


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
            # The same whichever frames are asked for along with it.
            for some in (frames[400:], frames[[17, 550]], frames[[300]]):
                np.testing.assert_allclose(channels(source, some), rows[:, np.isin(frames, some)], atol=1e-9)


@pytest.mark.parametrize("order", ORDERS[1:-1])
def test_keys_at_gimbal_lock_begin_alike_whichever_frames_are_asked_for(order):
    angles = rotations(order, len(FRAMES), 3)
    angles["XYZ".index(order[1])] = np.pi / 2.0, np.pi / 2.0, -np.pi / 2.0, np.pi / 2.0
    tracks, _ = moving(order, 3)
    source = source_of(tracks | tracks_of(ROTATION, FRAMES, angles), order, mode=SPLINE)
    frames = inside(source, 60)
    rows = channels(source, frames)
    for some in (frames[::7], frames[[10]], frames[[100, 130]]):
        np.testing.assert_allclose(channels(source, some), rows[:, np.isin(frames, some)], atol=1e-6)


@pytest.mark.parametrize("order", ["XYZ", "ZXY", "AXIS_ANGLE"])
@pytest.mark.parametrize("turns", [-3.5, 1.25, 12.0])
def test_angles_that_turn_far_are_what_they_are_without_a_mode(order, turns):
    """About one axis there is nothing to mend, and no angle is off by whole turns."""
    axis = np.array((0.0, 0.0, 2.0, 0.0)) if order == "AXIS_ANGLE" else np.zeros(3)
    rows = np.stack((axis, axis), axis=1)
    rows[0] = 0.5, 0.5 + 2.0 * np.pi * turns
    tracks = tracks_of(ROTATION, (1, 50), rows) | tracks_of(LOCATION, (1, 50), np.zeros((3, 2)))
    source = source_of(tracks, order)
    for frames in (inside(source), np.array((48.0, 49.0))):
        ((difference, _),) = channel_differences([source], [frames])
        np.testing.assert_allclose(difference, 0.0, atol=1e-9)


def test_axes_that_differ_or_have_no_length_turn_the_shortest_way():
    rows = np.array(((0.0, 7.0), (0.0, 1.0), (1.0, 1.0), (0.0, 0.0)))
    for first in ((0.0, 0.0, 1.0, 0.0), (2.0, 0.0, 0.0, 0.0)):
        rows[:, 0] = first
        source = source_of(tracks_of(ROTATION, (1, 11), rows), "AXIS_ANGLE")
        frames = inside(source)
        for frame, made in zip(frames, channels(source, frames).T, strict=True):
            now = dict(zip(range(3, 7), rows[:, 0] + (rows[:, 1] - rows[:, 0]) * (frame - 1.0) / 10.0, strict=True))
            tracks = tracks_of(ROTATION, (1, 11), rows)
            progress = share(tracks.values(), "AXIS_ANGLE", tracks, (1, 11), now)
            second = matrix(np.zeros(3), turned(rows[:, 1], "AXIS_ANGLE"))
            expected = screwed(np.eye(4), second, progress)
            np.testing.assert_allclose(pose_of(made, "AXIS_ANGLE"), expected, atol=1e-7)


def test_lengths_of_axes_run_evenly():
    rows = np.array(((0.2, 1.5), (0.0, 0.0), (1.0, 4.0), (0.0, 0.0)))
    source = source_of(tracks_of(ROTATION, (1, 11), rows), "AXIS_ANGLE")
    made = channels(source, np.arange(2.0, 11.0))
    np.testing.assert_allclose(made[5], 1.3 + 0.3 * np.arange(9.0), atol=1e-6)
    np.testing.assert_allclose(made[3], 0.2 + 0.13 * np.arange(1.0, 10.0), atol=1e-6)


@pytest.mark.parametrize("order", [None, "YZX", "AXIS_ANGLE"])
@pytest.mark.parametrize("interpolation", ["LINEAR", "CUBIC"])
def test_parts_run_between_their_own_keys(order, interpolation):
    places, turns, sizes = (1.0, 18.0, 40.0, 60.0), (4.0, 18.0, 31.0, 60.0), (1.0, 33.0)
    tracks = tracks_of(LOCATION, places, np.random.default_rng(3).normal(size=(3, 4)))
    turning = tracks_of(ROTATION, turns, rotations(order, 4, 7))
    growing = tracks_of(SCALE, sizes, np.tile((1.0, 1.6), (3, 1)))
    source = source_of(tracks | turning | growing, order, interpolation)
    assert source.is_uneven
    assert {(span.rows[0], span.first, span.last) for span in spans(source)} == {
        *((0, *pair) for pair in itertools.pairwise(places)),
        *((3, *pair) for pair in itertools.pairwise(turns)),
        (7, *sizes),
    }

    def seen_turn(frame: float) -> np.ndarray:
        frame = min(max(frame, turns[0]), turns[-1])
        index = segment(turns, frame)
        ends = turns[index], turns[index + 1]
        now = {row: value(track, frame, interpolation) for row, track in turning.items()}
        first, second = (turned(at_keys(turning, end)[ROWS[ROTATION]], order) for end in ends)
        progress = share(turning.values(), order, turning, ends, now)
        return screwed(matrix(np.zeros(3), first), matrix(np.zeros(3), second), progress)[:3, :3]

    frames = np.arange(1.5, 60.0, 0.75)
    rows = channels(source, frames)
    for frame, made in zip(frames, rows.T, strict=True):
        index = segment(places, frame)
        ends = places[index], places[index + 1]
        now = {row: value(track, frame, interpolation) for row, track in tracks.items()}
        progress = share(tracks.values(), order, tracks, ends, now)
        keys = [np.eye(4), np.eye(4)]
        for key, end in zip(keys, ends, strict=True):
            key[:3, :3], key[:3, 3] = seen_turn(end), at_keys(tracks, end)[ROWS[LOCATION]]
        np.testing.assert_allclose(made[:3], screwed(*keys, progress)[:3, 3], atol=1e-6)
        np.testing.assert_allclose(pose_of(made, order)[:3, :3], seen_turn(frame), atol=1e-7)
    grown = value(growing[7], 20.0, interpolation)
    np.testing.assert_allclose(channels(source, np.array((20.0,)))[7:, 0], 1.6 ** ((grown - 1.0) / 0.6), atol=1e-6)
    # On a key of one part the others go on.
    ((difference, _),) = channel_differences([source], [np.array((4.0, 18.0, 31.0, 40.0))])
    assert (difference[3:7, 0] == 0.0).all()
    assert (difference[:7, 1] == 0.0).all()
    assert (difference[3:7, 2] == 0.0).all()
    assert difference[:3, 2].all()
    assert (difference[:3, 3] == 0.0).all()


@pytest.mark.parametrize("extra", [{4: [(1, 0.0), (9, 0.0), (20, 0.0)]}, {7: [(5, 2.0)]}])
def test_constant_keys_elsewhere_change_nothing(extra):
    tracks, _ = moving(frames=(1.0, 20.0))
    others = {row: track for row, track in tracks.items() if row < 3}
    plain, more = source_of(others), source_of(others | extra)
    assert not more.is_uneven
    frames = np.arange(1.5, 20.0, 0.5)
    np.testing.assert_array_equal(channels(plain, frames)[:3], channels(more, frames)[:3])


def test_location_turns_far_where_its_keys_are_those_of_the_rotation():
    """Half a turn in the sense of the angle: either sense is the shortest."""
    for sense in (-1.0, 1.0):
        turning = tracks_of(ROTATION, (1, 11), np.array(((0, 0), (0, 0), (0, sense * np.pi))))
        even = source_of(turning | tracks_of(LOCATION, (1, 11), np.array(((0, 2), (0, 0), (0, 0)))), "XYZ")
        tracks = tracks_of(LOCATION, (1, 11, 20), np.array(((0, 2, 2), (0, 0, 1), (0, 0, 0))))
        uneven = source_of(turning | tracks, "XYZ")
        assert uneven.is_uneven
        frames = np.arange(2.0, 11.0)
        places = channels(even, frames)[:3], channels(uneven, frames)[:3]
        assert np.abs(places[0][1]).max() > 0.9
        np.testing.assert_allclose(*places, atol=1e-6)


@pytest.mark.parametrize("order", [None, "XYZ", "AXIS_ANGLE"])
def test_it_goes_on_at_its_slope_where_it_is_seen(order):
    tracks, source = moving(order, 2, frames=(1.0, 21.0), linear=True, seen=(-9, 40))
    assert [(span.first, span.last, span.first_is_key, span.last_is_key) for span in spans(source)] == [
        (-9.0, 1.0, False, True),
        (1.0, 21.0, True, True),
        (21.0, 40.0, True, False),
    ]
    frames = np.setdiff1d(np.arange(-9.0, 41.0), FRAMES)
    for frame, rows in zip(frames, channels(source, frames).T, strict=True):
        np.testing.assert_allclose(pose_of(rows, order), expected_pose(tracks, order, frame, "LINEAR")[0], atol=2e-6)


@pytest.mark.parametrize("after", ["REPEAT", "REPEAT_OFFSET", "MIRROR"])
def test_rounds_are_the_first_one_again(after):
    tracks, _ = moving(None, 4, frames=(1.0, 8.0, 21.0, 31.0))
    for row in range(3, 7):
        tracks[row][-1] = 31.0, tracks[row][0][1]
    source = source_of(tracks, cycles=Cycles("NONE", after, 0, 0))
    plain = source_of(tracks)
    assert source.is_repeatable
    assert [(span.first, span.last) for span in spans(source)] == [(1.0, 8.0), (8.0, 21.0), (21.0, 31.0)]
    first = np.arange(1.0, 31.5, 0.5)
    poses = in_betweens(plain, first).desired
    np.testing.assert_allclose(in_betweens(source, first).desired.positions, poses.positions, atol=1e-12)
    later = first[1:-1] + 30.0
    found = in_betweens(source, later).desired
    way = slice(-2, 0, -1) if after == "MIRROR" else slice(1, -1)
    change = [tracks[row][-1][1] - tracks[row][0][1] if after == "REPEAT_OFFSET" else 0.0 for row in range(3)]
    np.testing.assert_allclose(found.positions, poses.positions[way] + change, atol=1e-5)
    np.testing.assert_allclose(np.abs(np.einsum("mi,mi->m", found.quaternions, poses.quaternions[way])), 1.0, atol=1e-9)


@pytest.mark.parametrize("mode", ["REPEAT_OFFSET", "MIRROR"])
def test_smooth_modes_look_over_the_seam_of_rounds(mode):
    keys = np.array((1.0, 8.0, 21.0, 31.0))
    tracks, _ = moving(None, 4, frames=tuple(keys))
    for row in range(3, 7):
        tracks[row][-1] = 31.0, tracks[row][0][1]
    # What does not move evenly in time shapes the tangents.
    source = source_of(tracks, cycles=Cycles("NONE", mode, 0, 3), mode=SPLINE)
    rows = np.array([[at for _, at in tracks[row]] for row in range(7)], np.float32).astype(np.float64)
    rounds, change = [], np.where(np.arange(7) < 3, rows[:, -1] - rows[:, 0], 0.0)
    for number in range(-1, 2):
        if mode == "MIRROR":
            backwards = number % 2 == 1
            times, values = (32.0 - keys[::-1], rows[:, ::-1]) if backwards else (keys, rows)
        else:
            times, values = keys, rows + number * change[:, None]
        rounds.append((times + 30.0 * number, values))
    times = np.concatenate([at[:-1] for at, _ in rounds])
    values = np.concatenate([of_round[:, :-1] for _, of_round in rounds], axis=1).T
    poses = Poses(values[:, :3], values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1, keepdims=True))
    frames = np.setdiff1d(np.arange(1.5, 31.0, 0.5), keys)
    expected = interpolate(times, poses, frames, "motor_spline")
    np.testing.assert_allclose(channels(source, frames)[:3].T, expected.positions, atol=1e-6)


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
    assert source.is_uneven
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


def test_holds_keys_and_blenders_own_segments_have_no_difference():
    tracks, source = moving("XYZ", 3)
    keys = np.array(FRAMES)
    ((difference, _),) = channel_differences([source], [keys])
    assert not difference.any()
    frames = np.arange(-5.0, 50.0, 0.5)
    ((difference, _),) = channel_differences([replace(source, mode=0)], [frames])
    assert not difference.any()
    ((difference, _),) = channel_differences([source_of(tracks, "XYZ", "CONSTANT")], [frames])
    assert not difference.any()
    assert spans(source_of(tracks, "XYZ", "CONSTANT")) == []
    marked = replace(source, mode=Marks(np.array((1.0, 13.0, 20.0)), np.array((2, 0, 2))))
    assert [(span.first, span.last) for span in spans(marked)] == [(1.0, 13.0), (20.0, 41.0)]
    ((difference, _),) = channel_differences([marked], [frames])
    ((all_of_them, _),) = channel_differences([source], [frames])
    own = (frames >= 13.0) & (frames <= 20.0)
    assert not difference[:, own].any()
    np.testing.assert_array_equal(difference[:, ~own], all_of_them[:, ~own])


def test_many_sources_at_once_are_what_they_are_alone():
    sources = [moving(order, seed, mode=1 + seed % 7)[1] for seed, order in enumerate(ORDERS * 2)]
    frames = [inside(source, 5 + number) for number, source in enumerate(sources)]
    for source, times, (difference, native) in zip(sources, frames, channel_differences(sources, frames), strict=True):
        ((alone, native_alone),) = channel_differences([source], [times])
        np.testing.assert_allclose(difference, alone, atol=1e-9)
        np.testing.assert_array_equal(native, native_alone)


def test_driven_rows_and_uneven_scale_are_left_alone():
    tracks, source = moving(None, 1)
    frames = inside(source)
    ((difference, _),) = channel_differences([replace(source, driven=frozenset({1}))], [frames])
    assert not difference[1].any()
    assert difference[[0, 2, 3]].any(axis=1).all()
    stretched = source_of(tracks | tracks_of(SCALE, FRAMES, np.random.default_rng(0).uniform(1.0, 2.0, (3, 4))))
    assert not channel_differences([stretched], [frames])[0][0][ROWS[SCALE]].any()


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
