"""Speeds as Blender shows them, and *Equalise Speed* from the interface."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import key_frames, set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.ui.speed import speeds_of
from tests.animation.bones.rigs import select_only
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object, write

pytestmark = pytest.mark.any_blender

operators = bpy.ops.rigid_motion
FRAMES = np.array((1.0, 11.0, 21.0, 41.0))


def keyed(mode: str = "dq_sclerp") -> bpy.types.Object:
    obj = key(new_object(), FRAMES.tolist(), seed=4)
    set_mode(obj, mode)
    select_only(obj)
    return obj


@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline", "BLENDER"])
@pytest.mark.parametrize("under", [False, True])
def test_speeds_are_those_that_blender_shows(extension, mode, under):
    obj = keyed(mode)
    if under:
        parent = key(new_object("Parent"), FRAMES.tolist(), seed=8)
        obj.parent = parent
    bpy.context.view_layer.update()
    speeds = speeds_of(transform_of(obj), bpy.context)
    worlds = shown_worlds([obj], speeds.frames)[0]
    durations = np.diff(speeds.frames)
    going = np.linalg.norm(np.diff(worlds[:, :3, 3], axis=0), axis=1) / durations
    assert speeds.going == pytest.approx(going, abs=2e-3 * going.max())
    axes = worlds[:, :3, :3] / np.linalg.norm(worlds[:, :3, :3], axis=1, keepdims=True)
    cosines = (np.einsum("nij,nij->n", axes[1:], axes[:-1]) - 1.0) / 2.0
    turning = np.arccos(np.clip(cosines, -1.0, 1.0)) / durations
    assert speeds.turning == pytest.approx(turning, abs=5e-3 * turning.max())


def test_what_has_no_motion_has_no_speed(extension):
    obj = new_object()
    select_only(obj)
    assert speeds_of(transform_of(obj), bpy.context) is None
    assert not operators.equalise_speed.poll()


def test_it_says_how_even_it_is(extension, capfd):
    obj = keyed()
    capfd.readouterr()
    assert operators.equalise_speed(between_frames=True) == {"FINISHED"}
    said = capfd.readouterr().out
    assert "m/s from frame 1 to 41, even to " in said
    assert key_frames(obj)[[0, -1]].tolist() == [1.0, 41.0]


def test_selected_keys_alone(extension):
    obj = keyed()
    for fcurve in obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
        for point in fcurve.keyframe_points:
            point.select_control_point = point.co.x > 5.0
    operators.equalise_speed(selected=True)
    frames = key_frames(obj)
    assert frames[[0, 1, 3]].tolist() == [1.0, 11.0, 41.0]
    assert frames[2] != 21.0


def test_smooth_screw_says_how_far_its_path_is_off(extension, capfd):
    keyed("motor_spline")
    capfd.readouterr()
    operators.equalise_speed()
    assert "the path of Smooth Screw, which depends on the frames of its keys, is up to " in capfd.readouterr().out


def test_a_body_that_stands_is_refused_with_the_way_out(extension, capfd):
    obj = new_object()
    write(obj, "location", FRAMES, np.zeros((4, 3)))
    select_only(obj)
    with pytest.raises(RuntimeError, match="select more keys, or key it"):
        operators.equalise_speed()
