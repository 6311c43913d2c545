"""Equalise Speed: bodies keep their paths and move at even speed, as Blender plays them between frames."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import Refused, equalise_speed, key_frames, modes_of, set_mode, set_turns
from rigid_motion.animation.edits.speed import on_whole_frames
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from rigid_motion.motion.quaternions import angle_between
from tests.animation.bones.rigs import in_turn
from tests.animation.held import worlds
from tests.animation.keyed import curves_of, snapshot
from tests.animation.scenes import FRAMES as FEW_FRAMES
from tests.animation.scenes import key, new_object, write

FRAMES = (1.0, 9.0, 33.0, 41.0, 81.0)
MOMENTS = np.arange(1.0, 81.03125, 0.0625)
"""Sixteenths of frames."""

SHARES = {
    "CONSTANT": lambda t: t,
    "EASE_IN": lambda t: t * t * (3.0 - t) / 2.0,
    "EASE_OUT": lambda t: 1.0 - (1.0 - t) ** 2 * (2.0 + t) / 2.0,
    "EASE_IN_OUT": lambda t: t * t * (3.0 - 2.0 * t),
}
FOR_MODES = [name for name, mode in KEYFRAME_MODES.items() if not mode.is_smooth]
BLENDS = ("pga_lerp", "cga_lerp")
PLACES = np.array(((0, 0, 0), (3, 1, 0), (4, 2, 2), (1, 6, 3), (0, 7, 0)), float)
ANGLES = np.radians(((0, 0, 0), (20, 50, 0), (40, 20, 60), (0, 80, 90), (10, 20, 60)))


def tool(mode: str, interpolation: str = "BEZIER") -> bpy.types.Object:
    obj = new_object()
    write(obj, "location", np.array(FRAMES), PLACES, interpolation)
    turns = np.array([Euler(one).to_quaternion() for one in ANGLES])
    write(obj, "rotation_quaternion", np.array(FRAMES), turns, interpolation)
    set_mode(obj, mode)
    return obj


def places_of(obj: bpy.types.Object) -> np.ndarray:
    return worlds(obj, MOMENTS)[:, :3, 3]


def ways(places: np.ndarray) -> np.ndarray:
    return np.append(0.0, np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1)))


def path_of(matrices: Sequence[np.ndarray], mode: str) -> np.ndarray:
    """Return positions on the path from key to key, by interpolating two poses at a time."""
    keys, shares = Poses.from_matrices(np.array(matrices)), np.linspace(0.0, 1.0, 4001)
    parts = [interpolate((0.0, 1.0), keys[i : i + 2], shares, mode).positions for i in range(len(keys.positions) - 1)]
    return np.concatenate(parts)


def off_path(points: np.ndarray, line: np.ndarray) -> float:
    """Return the largest distance of points from a polyline, by the segments around the nearest vertex."""
    most = 0.0
    for point in points:
        near = int(np.square(line - point).sum(axis=1).argmin())
        start, along = line[max(near - 1, 0) : near + 1], np.diff(line[max(near - 1, 0) : near + 2], axis=0)
        start = start[: len(along)]
        share = np.clip(((point - start) * along).sum(1) / np.maximum((along**2).sum(1), 1e-30), 0, 1)
        most = max(most, float(np.linalg.norm(point - start - share[:, None] * along, axis=1).min()))
    return most


def unevenness(obj: bpy.types.Object, ease: str) -> float:
    """Return the largest deviation of Blender's speed from the intended speed, as a fraction of the mean."""
    keys, done = key_frames(obj), ways(places_of(obj))
    meant = np.diff(SHARES[ease]((MOMENTS - 1.0) / 80.0)) * done[-1]
    # Steps across a key cut the corner and say nothing about speed.
    whole = ~np.any((keys[:, None] > MOMENTS[:-1]) & (keys[:, None] < MOMENTS[1:]), axis=0)
    return float(np.abs(np.diff(done) - meant)[whole].max() / meant.mean())


@pytest.mark.parametrize(("mode", "ease"), in_turn(FOR_MODES, [*SHARES]))
def test_the_speed_is_even_and_the_path_stays(live_file, mode, ease):
    obj = tool(mode)
    expected = path_of(worlds(obj, FRAMES), mode)
    (result,) = equalise_speed(obj, ease, between_frames=True).values()
    places = places_of(obj)
    assert off_path(places[::4], expected) < 1e-5
    assert result.bend < 1e-4
    assert key_frames(obj)[[0, -1]].tolist() == [1.0, 81.0]
    assert modes_of(obj, key_frames(obj)[:-1]) == [mode] * 4
    uneven = unevenness(obj, ease)
    # Two handles describe a timing that is faster half-way almost exactly; here the body turns by up to 110 degrees.
    assert uneven < (0.08 if mode in BLENDS else 0.01)
    assert result.unevenness == pytest.approx(uneven, abs=0.005)
    assert result.speed == pytest.approx(ways(places)[-1] / 80.0, rel=1e-3)


@pytest.mark.parametrize("mode", FOR_MODES[::3])
def test_keys_stay_on_whole_frames_unless_asked_for(live_file, mode):
    obj = tool(mode)
    (result,) = equalise_speed(obj).values()
    frames = key_frames(obj)
    assert frames.tolist() == np.rint(frames).tolist()
    # A key is off by at most half a frame on either side of a segment.
    assert unevenness(obj, "CONSTANT") < 1.0 / np.diff(frames).min() + 0.01
    assert result.unevenness == pytest.approx(unevenness(obj, "CONSTANT"), abs=0.01)


@pytest.mark.parametrize("interpolation", ["LINEAR", "BEZIER", "SINE"])
def test_blenders_own_in_betweens_keep_their_path(live_file, interpolation):
    obj = tool("BLENDER", interpolation)
    before = places_of(obj)
    was = unevenness(obj, "CONSTANT")
    (result,) = equalise_speed(obj, between_frames=True).values()
    after = places_of(obj)
    assert off_path(after, before) < (2e-3 if interpolation == "BEZIER" else 1e-5)  # by chords of the samples
    # Where values stay, the two handles have only their times to shape the speed.
    assert unevenness(obj, "CONSTANT") < (0.25 * was if interpolation == "BEZIER" else 0.01)
    assert result.unevenness == pytest.approx(unevenness(obj, "CONSTANT"), abs=0.05)


@pytest.mark.parametrize("mode", [name for name, mode in KEYFRAME_MODES.items() if mode.is_smooth])
def test_a_smooth_mode_is_evened_and_how_far_it_bends_is_said(live_file, mode):
    obj = tool(mode)
    before = places_of(obj)
    was = unevenness(obj, "CONSTANT")
    (result,) = equalise_speed(obj, between_frames=True).values()
    assert unevenness(obj, "CONSTANT") < 0.2 < 0.05 * was
    assert result.bend == pytest.approx(off_path(places_of(obj), before), abs=0.02)


def test_between_two_keys_what_is_before_and_behind_them_stays(live_file):
    obj = tool("dq_sclerp")
    outside = MOMENTS[(MOMENTS <= 9.0) | (MOMENTS >= 41.0)]
    before = worlds(obj, outside)
    equalise_speed(obj, frames=(9.0, 33.0, 41.0))
    np.testing.assert_allclose(worlds(obj, outside), before, atol=1e-5)
    assert key_frames(obj)[[0, 1, 3, 4]].tolist() == [1.0, 9.0, 41.0, 81.0]
    assert key_frames(obj)[2] != 33.0


def test_what_rests_rests_as_long_as_before(live_file):
    obj = new_object()
    frames, places = np.array((1.0, 11.0, 31.0, 41.0)), np.array(((0, 0, 0), (1, 0, 0), (1, 0, 0), (5, 0, 0)), float)
    write(obj, "location", frames, places)
    set_mode(obj, "dq_sclerp")
    equalise_speed(obj)
    assert key_frames(obj).tolist() == [1.0, 5.0, 25.0, 41.0]
    at = worlds(obj, (3.0, 15.0, 33.0))
    assert at[:, 0, 3] == pytest.approx((0.5, 1.0, 3.0), abs=1e-5)


def test_what_only_turns_turns_evenly_and_its_turns_go_along(live_file):
    obj = new_object()
    turns = np.array([Euler((0.0, 0.0, angle)).to_quaternion() for angle in (0.0, 0.5, 1.5)])
    write(obj, "rotation_quaternion", np.array((1.0, 21.0, 31.0)), turns, "BEZIER")
    set_mode(obj, "dq_sclerp")
    (result,) = equalise_speed(obj).values()
    assert result.is_turning
    assert result.speed == pytest.approx(0.05, rel=1e-3)
    assert key_frames(obj).tolist() == [1.0, 11.0, 31.0]
    at = worlds(obj, (6.0, 21.0))
    assert np.arctan2(at[:, 1, 0], at[:, 0, 0]) == pytest.approx((0.25, 1.0), abs=1e-4)
    set_turns(obj, 1, (11.0,))
    equalise_speed(obj)
    keys = curves_of(obj)["rigid_motion.turns", 0].keyframe_points
    assert key_frames(obj).tolist() == [1.0, 3.0, 31.0]
    assert keys[-1].co.x in (3.0, 31.0)


def test_the_turning_is_evened_where_asked_for(live_file):
    obj = tool("lerp_slerp")
    equalise_speed(obj, turning=True, between_frames=True)
    frames, keys = MOMENTS[::16], key_frames(obj)
    turns = Poses.from_matrices(worlds(obj, frames)).quaternions
    turned = angle_between(turns[1:], turns[:-1])
    whole = ~np.any((keys[:, None] > frames[:-1]) & (keys[:, None] < frames[1:]), axis=0)
    assert np.ptp(turned[whole]) < 0.01 * turned.mean()


def without_a_key() -> bpy.types.Object:
    obj = key(new_object(), FEW_FRAMES)
    points = curves_of(obj)["location", 0].keyframe_points
    points.remove(points[2])
    return obj


def standing() -> bpy.types.Object:
    obj = new_object()
    write(obj, "location", np.array((1.0, 9.0)), np.array(((1.0, 0, 0), (1.0, 0, 0))))
    return obj


@pytest.mark.parametrize(
    ("make", "wishes", "said"),
    [
        (without_a_key, {}, "frame 24"),
        (new_object, {}, "key"),
        (standing, {}, "key"),
        (lambda: tool("dq_sclerp"), {"ease": "FAST"}, "FAST is not an easing"),
        (lambda: tool("dq_sclerp"), {"frames": ()}, "no two keys"),
    ],
)
def test_what_cannot_be_evened_is_refused_and_stays(live_file, make, wishes, said):
    obj = make()
    before = snapshot(obj)
    with pytest.raises(Refused, match=said):
        equalise_speed(obj, **wishes)
    assert snapshot(obj) == before


@pytest.mark.parametrize(
    ("frames", "expected"),
    [
        ((1.0, 1.2, 1.4, 9.0), (1.0, 2.0, 3.0, 9.0)),
        ((1.0, 8.6, 8.8, 9.0), (1.0, 7.0, 8.0, 9.0)),
        ((0.5, 0.6, 4.4, 6.5), (0.5, 1.0, 4.0, 6.5)),
        ((1.0, 1.2, 1.4, 3.0), (1.0, 1.2, 1.4, 3.0)),
        ((1.0, 9.0), (1.0, 9.0)),
    ],
)
def test_whole_frames_are_apart_as_long_as_there_is_room(frames, expected):
    assert on_whole_frames(np.array(frames)).tolist() == list(expected)
