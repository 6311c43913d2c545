"""Points of a path are where Blender shows the object, or would show it in the mode; ticks leave the line visible."""

from __future__ import annotations

import math
from itertools import cycle

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.evaluation.components import ROWS
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion.ui.overlay.cache import path_of
from rigid_motion.ui.overlay.points import (
    MAX_PATH_SAMPLES,
    MAX_SAMPLES_PER_FRAME,
    MAX_TICKS,
    MIN_PATH_SAMPLES,
    MIN_TICK_DISTANCE_PX,
    SMOOTH_EXTENT_WIDTHS,
    TICK_GAP,
    DrawnPath,
    on_screen,
    readable,
    sample_frames,
    thinned,
    tick_frames,
)
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import FRAMES, key, new_object
from tests.ui.overlay.seen import assert_where_it_is_seen

WHOLE = np.arange(FRAMES[0], FRAMES[-1] + 1)
ORDERS = ("QUATERNION", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")


def on(path: DrawnPath, line: np.ndarray, frames: np.ndarray) -> np.ndarray:
    """Return the points of a path's line on these frames."""
    assert np.isin(frames, path.frames).all()
    return line[np.searchsorted(path.frames, frames)]


def shown_origins(obj: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    return shown_worlds([obj], frames)[0][:, :3, 3]


def mesh() -> bpy.types.Object:
    """Return a triangle off the origin, 2 by 3 by 1 units large."""
    data = bpy.data.meshes.new("Ground")
    data.from_pydata([(0, 0, 0), (2, 0, 0), (0, 3, 1)], [], [(0, 1, 2)])
    obj = new_object("Ground", data=data)
    obj.location = (3, 2, 1)
    return obj


@pytest.mark.parametrize(("mode", "order"), [*zip(KEYFRAME_MODES, cycle(ORDERS), strict=False)])
def test_a_modes_path_shows_beforehand_where_the_object_will_be(scene, mode, order):
    obj = key(new_object(rotation_mode=order), scale="even")
    scene.rigid_motion_overlay.mode = mode
    before = path_of(obj, bpy.context)
    native = shown_origins(obj, WHOLE)
    set_mode(obj, mode)
    assert on(before, before.desired, WHOLE) == pytest.approx(shown_origins(obj, WHOLE), abs=2e-5)
    assert on(before, before.native, WHOLE) == pytest.approx(native, abs=1e-5)


def test_each_segment_runs_in_its_own_mode(scene):
    obj = key(new_object())
    set_mode(obj, "lerp_slerp", [FRAMES[1]])
    path = path_of(obj, bpy.context)
    same = np.isclose(path.native, path.desired, atol=1e-9).all(axis=1)
    inside = (path.frames > FRAMES[1]) & (path.frames < FRAMES[2])
    assert same[~inside].all()
    assert not same[inside].any()
    assert on(path, path.desired, WHOLE) == pytest.approx(shown_origins(obj, WHOLE), abs=1e-5)


@pytest.mark.parametrize("parenting", ["vertex", "inverse"])
def test_the_world_is_where_the_parent_takes_the_path(scene, parenting):
    obj = key(new_object())
    if parenting == "inverse":
        obj.parent = parent = new_object("Table")
        parent.location, parent.rotation_quaternion, parent.scale = (1, 2, 3), (0.5, 0.5, -0.5, 0.5), (2, 1, 1)
        bpy.context.view_layer.update()
        obj.matrix_parent_inverse = parent.matrix_world.inverted()
        parent.location = (0, 5, 0)
    else:
        obj.parent, obj.parent_type, obj.parent_vertices = mesh(), "VERTEX", (2, 0, 0)
    set_mode(obj, "dq_sclerp")
    assert_where_it_is_seen(obj, scene)


def test_keys_off_whole_frames_are_on_the_path(scene):
    obj = key(new_object(), frames=(1.25, 10.5, 20.0))
    set_mode(obj, "dq_sclerp")
    path = path_of(obj, bpy.context)
    keyed = source_of(obj).values_at(np.array((1.25, 10.5, 20.0)))[ROWS["location"]].T
    assert path.keys == pytest.approx(keyed, abs=1e-6)
    for frame, place in zip((1.25, 10.5, 20.0), keyed, strict=True):
        native, expected = path.at(frame)
        assert native == pytest.approx(place, abs=1e-6)
        assert expected == pytest.approx(place, abs=1e-6)


def test_ticks_are_on_the_same_frames_in_all_paths(scene):
    obj = key(new_object())
    scene.rigid_motion_overlay.tick_step, scene.rigid_motion_overlay.mode = 5, "dq_sclerp"
    path = path_of(obj, bpy.context)
    fives = np.arange(5.0, 41.0, 5.0)
    assert (path.native_ticks == on(path, path.native, fives)).all()
    assert (path.desired_ticks == on(path, path.desired, fives)).all()


@pytest.mark.parametrize(
    ("length", "step"), [(1, 1), (60, 1), (61, 2), (240, 5), (600, 10), (1000, 20), (100_000, 2000)]
)
def test_as_many_ticks_as_can_be_read(length, step):
    ticks = tick_frames(3, 3 + length)
    assert len(ticks) <= MAX_TICKS + 1
    assert (np.diff(ticks) == step).all()
    assert (ticks % step == 0).all()


@pytest.mark.parametrize("length", [1, 2, 39, 300, 7000, 200_000])
def test_samples_run_evenly_from_end_to_end_over_whole_frames_as_many_as_a_round_path_needs(length):
    frames = sample_frames(-7, -7 + length)
    assert (frames[0], frames[-1]) == (-7, -7 + length)
    assert (np.diff(frames) > 0).all()
    assert len(frames) <= 2 * MAX_PATH_SAMPLES
    if length <= MAX_PATH_SAMPLES:
        assert np.isin(np.arange(-7, -7 + length + 1), frames).all()
        assert (
            min(MIN_PATH_SAMPLES, length * MAX_SAMPLES_PER_FRAME) < len(frames) <= max(2 * MIN_PATH_SAMPLES, length + 1)
        )


def test_what_has_no_second_key_or_is_refused_or_driven_has_no_path(scene):
    still, enveloped, driven = new_object("Faded"), key(new_object("Enveloped")), key(new_object("Driven"))
    still.keyframe_insert("hide_viewport", frame=1)
    curves_of(enveloped)["location", 0].modifiers.new("ENVELOPE")
    driven.driver_add("location", 0)
    for obj in (new_object("None"), key(new_object("One"), frames=(7,)), still, enveloped, driven):
        assert path_of(obj, bpy.context) is None, obj.name


def test_a_line_that_leads_back_is_not_thinned_to_a_point():
    there_and_back = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    assert thinned(there_and_back).tolist() == there_and_back.tolist()


def test_a_thinned_line_looks_the_same():
    turns = np.linspace(0, 3 * math.pi, 1001)
    line = np.stack((np.cos(turns), np.sin(turns), 0.1 * turns), axis=1)
    thin = thinned(line)
    assert len(thin) < 300
    assert (thin[[0, -1]] == line[[0, -1]]).all()
    start, chord = thin[:-1], np.diff(thin, axis=0)
    offset = line[:, None] - start
    share = np.clip((offset * chord).sum(axis=2) / (chord * chord).sum(axis=1), 0, 1)
    away = np.linalg.norm(offset - share[..., None] * chord, axis=2).min(axis=1)
    assert away.max() < 2 * 2.0 / SMOOTH_EXTENT_WIDTHS


SIZE = (1000.0, 500.0)


def straight(frames: int, places: np.ndarray | None = None, *, mode: bool = False, keys: tuple = (0, -1)) -> DrawnPath:
    """Return a path along x with a tick on each of its frames, one unit long in all, or with these places."""
    at = np.arange(1.0, frames + 1.0)
    line = np.zeros((frames, 3))
    line[:, 0] = np.linspace(0.0, 1.0, frames) if places is None else places
    return DrawnPath(
        frames=at,
        native=line,
        desired=line if mode else None,
        key_frames=at[list(keys)],
        keys=line[list(keys)],
        selected=np.zeros(len(keys), dtype=bool),
        tick_frames=at,
        native_ticks=line,
        desired_ticks=line if mode else None,
        axis_frames=at,
        axes=np.repeat(line[:, None, None], 3, axis=1).repeat(2, axis=2),
    )


def view(width: float) -> np.ndarray:
    """Return an orthographic projection in which a unit is `width` pixels wide."""
    return np.diag((2.0 * width / SIZE[0], 2.0 * width / SIZE[1], 0.0, 1.0))


def ticks(path: DrawnPath, width: float, **options: object) -> np.ndarray:
    """Return the frames of the ticks that are drawn."""
    return path.tick_frames[readable(path, view(width), SIZE, **options).native_ticks]


def test_behind_the_viewer_there_is_no_place_on_the_screen():
    projection = np.eye(4)[[0, 1, 2, 2]]
    assert np.isnan(on_screen(np.array([[0.0, 0.0, -1.0]]), projection, SIZE)).all()


@pytest.mark.parametrize(("gap", "step"), [(TICK_GAP, 1), (TICK_GAP / 2, 2), (TICK_GAP / 3, 5), (TICK_GAP / 8, 10)])
def test_the_shorter_a_path_the_fewer_ticks_and_all_are_evenly_timed(gap, step):
    result = ticks(straight(101), 100 * gap)
    assert (np.diff(result) == step).all()
    assert (result % step == 0.0).all()
    assert len(result) >= 100 // step - 2


def test_a_path_that_is_seen_as_a_dot_has_no_ticks():
    assert not len(ticks(straight(41), 3.0))
    assert not len(ticks(straight(41, np.zeros(41)), 1000.0))


def test_no_tick_touches_another_or_a_key_where_the_object_slows_down():
    eased = 0.5 - 0.5 * np.cos(np.linspace(0.0, np.pi, 61))
    path = straight(61, eased)
    chosen = readable(path, view(900.0), SIZE).native_ticks
    drawn = 900.0 * eased[chosen]
    assert (np.diff(drawn) >= MIN_TICK_DISTANCE_PX).all()
    assert drawn.min() >= MIN_TICK_DISTANCE_PX
    assert drawn.max() <= 900.0 - MIN_TICK_DISTANCE_PX
    # In the middle, where the object is fast, there is a tick on every frame.
    assert chosen[20:40].all()


def test_on_a_screen_of_twice_the_resolution_it_is_the_same():
    one = readable(straight(41), view(200.0), SIZE)
    two = readable(straight(41), view(200.0), (2 * SIZE[0], 2 * SIZE[1]), 2.0)
    assert (one.native_ticks == two.native_ticks).all()


def test_ticks_that_somebody_asked_for_are_all_there():
    assert len(ticks(straight(41), 3.0, every_tick=True)) == 41
