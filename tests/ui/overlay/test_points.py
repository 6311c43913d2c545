"""Points of a path are where Blender shows the object, or would show it in the mode."""

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
    SMOOTH_EXTENT_WIDTHS,
    DrawnPath,
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
