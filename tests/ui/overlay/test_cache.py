"""The path cache: a path is computed once, and again only after an edit that it depends on.

Without a window, drawing stays silent or logs an error once, and never raises.
"""

from __future__ import annotations

import logging

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.ui.overlay import drawing
from rigid_motion.ui.overlay.cache import MAX_SPARE_PATHS, keep_only, notice_selection, path_of
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object
from tests.complaints import complaints


def test_without_a_path_no_graphics_card_is_needed(scene, caplog):
    new_object().select_set(True)
    drawing.draw_paths()
    assert complaints(caplog) == []


def test_what_is_wrong_is_told_once_and_never_raised(scene, caplog):
    key(new_object()).select_set(True)
    assert bpy.app.background
    with caplog.at_level(logging.ERROR):
        drawing.draw_paths()
        drawing.draw_paths()
    assert complaints(caplog) == ["The paths could not be drawn"]
    caplog.clear()


@pytest.fixture
def obj(scene) -> bpy.types.Object:
    return key(new_object())


def report_edits() -> None:
    """Let Blender report the edits to its handlers."""
    bpy.context.view_layer.update()


def test_an_edit_that_does_not_matter_leaves_the_path(scene, obj):
    obj.parent = key(new_object("Table"))
    report_edits()
    path = path_of(obj, bpy.context)
    scene.frame_set(20)
    obj.color = (1, 0, 0, 1)
    obj["note"] = 7
    report_edits()
    assert path_of(obj, bpy.context) is path


def key_of(obj: bpy.types.Object) -> bpy.types.Keyframe:
    return curves_of(obj)["location", 0].keyframe_points[1]


def select(obj: bpy.types.Object) -> None:
    for fcurve in curves_of(obj).values():
        fcurve.keyframe_points[1].select_control_point = not fcurve.keyframe_points[1].select_control_point


EDITS = {
    "a key moved": lambda obj, overlay: setattr(key_of(obj).co, "y", 7.0),
    "a key eased": lambda obj, overlay: setattr(key_of(obj), "interpolation", "BOUNCE"),
    "a key selected": lambda obj, overlay: select(obj),
    "no Action": lambda obj, overlay: setattr(obj.animation_data, "action", None),
    "other rotations": lambda obj, overlay: setattr(obj, "rotation_mode", "XYZ"),
    "a delta transform": lambda obj, overlay: setattr(obj.delta_location, "x", 3.0),
    "a size": lambda obj, overlay: setattr(obj, "empty_display_size", 3.0),
    "a mode": lambda obj, overlay: set_mode(obj, "dq_sclerp"),
    "a mode to compare": lambda obj, overlay: setattr(overlay, "mode", "cga_lerp"),
    "a step of ticks": lambda obj, overlay: setattr(overlay, "tick_step", 7),
    "a size of axes": lambda obj, overlay: setattr(overlay, "axes_size", 2.5),
}


@pytest.mark.parametrize("edit", EDITS)
def test_an_edit_that_matters_gives_another_path(scene, obj, edit):
    report_edits()
    path = path_of(obj, bpy.context)
    EDITS[edit](obj, scene.rigid_motion_overlay)
    report_edits()
    assert path_of(obj, bpy.context) is not path


def test_a_path_goes_along_with_a_component_that_is_not_keyed(scene, obj):
    fcurves = obj.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    fcurves.remove(fcurves.find("location", index=2))
    report_edits()
    before = path_of(obj, bpy.context).native
    obj.location.z += 5.0
    report_edits()
    assert path_of(obj, bpy.context).native - before == pytest.approx(np.broadcast_to((0.0, 0.0, 5.0), before.shape))


def test_keys_selected_without_a_word_from_blender_are_noticed_when_asked_for(scene, obj):
    """In the Dope Sheet, for example, selecting is no edit."""
    path = path_of(obj, bpy.context)
    assert not notice_selection([obj])
    select(obj)
    assert path_of(obj, bpy.context) is path
    assert notice_selection([obj])
    assert (path_of(obj, bpy.context).selected != path.selected).tolist() == [False, True, False, False]
    assert not notice_selection([obj])


def test_paths_that_were_not_drawn_for_long_are_dropped(scene):
    objects = [key(new_object(f"Tool {number}")) for number in range(MAX_SPARE_PATHS + 20)]
    report_edits()
    paths = [path_of(obj, bpy.context) for obj in objects]
    path_of(objects[0], bpy.context)
    keep_only(drawn=1)
    assert path_of(objects[0], bpy.context) is paths[0]
    kept = [path_of(obj, bpy.context) is path for obj, path in zip(objects[20:], paths[20:], strict=True)]
    assert all(kept)
    assert path_of(objects[1], bpy.context) is not paths[1]
