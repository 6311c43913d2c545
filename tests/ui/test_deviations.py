"""Deviations: pops and kinks on paths are found, and the playhead jumps to them; smooth motion has none."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake_poses, set_mode
from rigid_motion.motion import Poses
from rigid_motion.ui.deviations import frames_of
from tests.animation.bones.rigs import select_only
from tests.animation.scenes import key, new_object, write

pytestmark = pytest.mark.any_blender

operators = bpy.ops.rigid_motion
FRAMES = np.arange(1.0, 81.0)


def circling(pop: float = 0.0, turned: float = 0.0) -> bpy.types.Object:
    """Return an object keyed on every frame of a circle; on frame 30 it is displaced by `pop`, and turned."""
    angles = FRAMES / 30.0
    places = np.stack((3.0 * np.cos(angles), 3.0 * np.sin(angles), 0.0 * angles), axis=1)
    places[29] += pop
    turns = np.stack((np.cos(angles / 2.0), 0 * angles, 0 * angles, np.sin(angles / 2.0)), axis=1)
    turns[29] = (np.cos((angles[29] + turned) / 2.0), 0.0, 0.0, np.sin((angles[29] + turned) / 2.0))
    obj = new_object()
    bake_poses(obj, FRAMES, Poses(places, turns))
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
