"""A path is worked out once, and again only after an edit that it depends on."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.ui.overlay import cache
from rigid_motion.ui.overlay.cache import SPARE, keep_only, notice_selection, path_of
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object


@pytest.fixture
def obj(scene) -> bpy.types.Object:
    return key(new_object())


def updated() -> None:
    """Let Blender tell what was edited."""
    bpy.context.view_layer.update()


def test_an_edit_that_does_not_matter_leaves_the_path(scene, obj):
    path = path_of(obj, scene)
    obj.color = (1, 0, 0, 1)
    obj["note"] = 7
    updated()
    assert path_of(obj, scene) is path


def move_key(obj, scene):
    curves_of(obj)["location", 0].keyframe_points[1].co.y += 1


def ease(obj, scene):
    curves_of(obj)["location", 0].keyframe_points[1].interpolation = "BOUNCE"


def select(obj, scene):
    for fcurve in curves_of(obj).values():
        fcurve.keyframe_points[1].select_control_point = not fcurve.keyframe_points[1].select_control_point


def unkey(obj, scene):
    obj.animation_data.action = None


def turn_otherwise(obj, scene):
    obj.rotation_mode = "XYZ"


def give_delta(obj, scene):
    obj.delta_location.x = 3


def enlarge(obj, scene):
    obj.empty_display_size = 3


def choose_mode(obj, scene):
    set_mode(obj, "dq_sclerp")


def compare(obj, scene):
    scene.rigid_motion_overlay.mode = "cga_lerp"


def step_ticks(obj, scene):
    scene.rigid_motion_overlay.tick_step = 7


def size_axes(obj, scene):
    scene.rigid_motion_overlay.axes_size = 2.5


EDITS = [
    *(move_key, ease, select, unkey, turn_otherwise, give_delta, enlarge, choose_mode),
    *(compare, step_ticks, size_axes),
]


@pytest.mark.parametrize("edit", EDITS, ids=lambda edit: edit.__name__)
def test_an_edit_that_matters_gives_another_path(scene, obj, edit):
    updated()
    path = path_of(obj, scene)
    edit(obj, scene)
    updated()
    assert path_of(obj, scene) is not path


def test_a_path_goes_along_with_a_component_that_is_not_keyed(scene, obj):
    fcurves = obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    fcurves.remove(fcurves.find("location", index=2))
    updated()
    before = path_of(obj, scene).native
    obj.location.z += 5.0
    updated()
    assert path_of(obj, scene).native - before == pytest.approx(np.broadcast_to((0.0, 0.0, 5.0), before.shape))


def test_a_script_that_edits_and_goes_to_another_frame_is_noticed(scene, obj):
    path = path_of(obj, scene)
    move_key(obj, scene)
    scene.frame_set(9)
    assert path_of(obj, scene) is not path


def test_keys_selected_without_a_word_from_blender_are_noticed_when_asked_for(scene, obj):
    """As in the Dope Sheet, where selecting is no edit."""
    path = path_of(obj, scene)
    assert not notice_selection([obj])
    select(obj, scene)
    assert path_of(obj, scene) is path
    assert notice_selection([obj])
    assert (path_of(obj, scene).selected != path.selected).tolist() == [False, True, False, False]
    assert not notice_selection([obj])


def test_undo_shows_the_path_from_before(scene, obj):
    updated()
    bpy.ops.ed.undo_push(message="keyed")
    before = path_of(obj, scene).keys
    move_key(obj, scene)
    updated()
    bpy.ops.ed.undo_push(message="moved")
    assert (path_of(obj, scene).keys != before).any()
    bpy.ops.ed.undo()
    obj, scene = bpy.data.objects["Tool"], bpy.context.scene
    assert (path_of(obj, scene).keys == before).all()


def test_paths_that_were_not_drawn_for_long_are_dropped(scene):
    objects = [new_object(f"Tool {number}") for number in range(SPARE + 20)]
    for obj in objects:
        path_of(obj, scene)
    path_of(objects[0], scene)
    keep_only(drawn=1)
    assert len(cache._entries) == SPARE + 1
    assert (objects[0].session_uid, "") in cache._entries
    assert (objects[1].session_uid, "") not in cache._entries
