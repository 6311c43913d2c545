"""Speeds as Blender shows them, and deviations: pops and kinks on paths; with *Equalise Speed*."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake_poses, key_frames, set_mode
from rigid_motion.animation.transforms import transform_of
from rigid_motion.motion import Poses
from rigid_motion.ui.deviations import frames_of
from rigid_motion.ui.speed import speeds_of
from tests.animation.bones.rigs import select_only
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object, write
from tests.ui.conftest import select_keys

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
    select_keys(obj, *FRAMES[1:])
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


EVERY_FRAME = np.arange(1.0, 81.0)


def circling(pop: float = 0.0, turned: float = 0.0) -> bpy.types.Object:
    """Return an object keyed on every frame of a circle; on frame 30 it is displaced by `pop`, and turned."""
    angles = EVERY_FRAME / 30.0
    places = np.stack((3.0 * np.cos(angles), 3.0 * np.sin(angles), 0.0 * angles), axis=1)
    places[29] += pop
    turns = np.stack((np.cos(angles / 2.0), 0 * angles, 0 * angles, np.sin(angles / 2.0)), axis=1)
    turns[29] = (np.cos((angles[29] + turned) / 2.0), 0.0, 0.0, np.sin((angles[29] + turned) / 2.0))
    obj = new_object()
    bake_poses(obj, EVERY_FRAME, Poses(places, turns))
    select_only(obj)
    return obj


@pytest.mark.parametrize(("pop", "turned", "found"), [(0.0, 0.0, []), (0.1, 0.0, [30.0]), (0.0, 0.3, [30.0])])
def test_a_pop_of_place_or_turn_is_found(extension, pop, turned, found):
    circling(pop, turned)
    assert frames_of(bpy.context).tolist() == found


def test_the_threshold_says_what_counts(extension):
    circling(0.02)
    settings = bpy.context.scene.rigid_motion_overlay
    settings.deviation_threshold = 50.0
    assert frames_of(bpy.context).tolist() == []
    settings.deviation_threshold = 3.0
    assert frames_of(bpy.context).tolist() == [30.0]


def test_corners_of_a_mode_are_found_and_those_that_it_rounds_are_not(extension):
    obj = key(new_object(), (1.0, 21.0, 41.0), seed=2, interpolation="LINEAR")
    select_only(obj)
    set_mode(obj, "dq_sclerp")
    bpy.context.view_layer.update()
    assert frames_of(bpy.context).tolist() == [21.0]
    set_mode(obj, "motor_spline")
    bpy.context.view_layer.update()
    assert frames_of(bpy.context).tolist() == []
    bpy.context.scene.rigid_motion_overlay.mode = "dq_sclerp"
    assert frames_of(bpy.context).tolist() == [21.0], "as the path shows it"


def test_it_goes_from_one_to_the_next_and_says_where_there_is_none(extension, capfd):
    obj = new_object()
    places = np.array(((0, 0, 0), (3, 0, 0), (3, 3, 0), (0, 3, 1)), float)
    write(obj, "location", np.array((1.0, 21.0, 41.0, 61.0)), places)
    select_only(obj)
    scene = bpy.context.scene
    scene.frame_set(1)
    seen = []
    for step in (1, 1, -1):
        assert operators.go_to_deviation(step=step) == {"FINISHED"}
        seen.append(scene.frame_current)
    assert seen == [21, 41, 21]
    assert operators.go_to_deviation(step=-1) == {"CANCELLED"}
    assert "No more deviations in this direction" in capfd.readouterr().out
    assert scene.frame_current == 21
