"""What Blender tells of edits, and which channels they were about."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_enabled, set_mode, set_turns
from rigid_motion.animation.actions.slots import slots_in
from rigid_motion.animation.following.changes import Snapshot, edited_objects, graphs_of
from tests.animation.bones.rigs import Rest, new_rig, select_only
from tests.animation.keyed import curves_of
from tests.animation.oracle import expected_bases, world_now
from tests.animation.scenes import FRAMES, key, linked, new_object
from tests.blank import blank

X = ("location", 0)
EDITS: dict[str, Callable[[bpy.types.FCurve], object]] = {
    "a value": lambda curve: setattr(curve.keyframe_points[1].co, "y", 7.0),
    "a handle": lambda curve: setattr(curve.keyframe_points[1].handle_right, "y", 7.0),
    "an interpolation": lambda curve: setattr(curve.keyframe_points[0], "interpolation", "SINE"),
    "an easing": lambda curve: setattr(curve.keyframe_points[0], "easing", "EASE_OUT"),
    "a setting of an easing, which has the mode": lambda curve: setattr(curve.keyframe_points[0], "back", 3.0),
    "a breakdown": lambda curve: setattr(curve.keyframe_points[1], "type", "BREAKDOWN"),
    "muted": lambda curve: setattr(curve, "mute", True),
    "going on": lambda curve: setattr(curve, "extrapolation", "LINEAR"),
    "a modifier": lambda curve: curve.modifiers.new("NOISE"),
}


@pytest.fixture
def tool(live_file) -> bpy.types.Object:
    """An object whose edits nobody else follows."""
    set_enabled(False)
    yield key(new_object())
    set_enabled(True)


def snapshot_of(obj: bpy.types.Object) -> tuple[Snapshot, Callable[[], set]]:
    (slot,) = slots_in([obj.animation_data.action])
    snapshot = Snapshot(slot)
    return snapshot, lambda: snapshot.look(slot)


@pytest.mark.parametrize("edit", EDITS)
def test_the_channel_that_was_edited_is_found_alone_and_once(tool, edit):
    _, look = snapshot_of(tool)
    assert look() == set()
    EDITS[edit](curves_of(tool)[X])
    assert look() == {X}
    assert look() == set()


def test_channels_that_come_and_go_are_found_as_far_as_they_matter(tool):
    _, look = snapshot_of(tool)
    tool.keyframe_insert("hide_render")
    assert look() == set()
    tool.keyframe_insert("scale", index=2)
    curves_of(tool)["location", 1].keyframe_points.insert(15.0, 1.0)
    fcurves = tool.animation_data.action.layers[0].strips[0].channelbag(tool.animation_data.action_slot).fcurves
    fcurves.remove(curves_of(tool)[X])
    assert look() == {("scale", 2), ("location", 1), X}
    fcurves.new(*X[:1], index=X[1]).keyframe_points.insert(1.0, 0.5)
    assert X in look()


def test_turns_are_found_and_what_was_written_is_not(tool):
    snapshot, look = snapshot_of(tool)
    curve = curves_of(tool)[X]
    curve.modifiers.new("GENERATOR")
    curve.keyframe_points.insert(15.0, 1.0)
    snapshot.note({X: curve})
    assert look() == set()
    set_turns(tool, 0, [1.0])
    for fcurve in curves_of(tool).values():
        fcurve.keyframe_points[0].back = 2.0
    look()
    tool.keyframe_insert("rigid_motion.turns")
    assert look() == {("rigid_motion.turns", 0)}


def test_where_keys_of_several_bones_are_edited_modes_of_others_are_found(tool):
    rig = new_rig("Rig", [Rest(name, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)) for name in "ABC"])
    curves = []
    for bone in rig.pose.bones:
        bone.keyframe_insert("location", index=0)
        curves.append(curves_of(bone)[X])
    _, look = snapshot_of(rig)
    for curve in curves[:2]:
        curve.keyframe_points[0].co.y = 7.0
    curves[2].keyframe_points[0].back = 3.0
    assert look() == {(curve.data_path, 0) for curve in curves}


@pytest.mark.parametrize("number", [0, 1])
def test_of_two_objects_with_one_name_that_is_found_which_was_edited(tmp_path: Path, number):
    blank()
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {new_object("Tool")})
    blank()
    namesakes = [new_object("Tool"), linked(tmp_path / "library.blend", "Tool")]
    found: list[bpy.types.Object] = []

    def note(scene: bpy.types.Scene, *_: object) -> None:
        found.extend(edited_objects(*graphs_of(scene)))

    bpy.app.handlers.depsgraph_update_pre.append(note)
    namesakes[number].update_tag()
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_pre.remove(note)
    # An evaluated copy does not say safely which library it is of: that may be gone.
    assert namesakes[number] in found
    namesakes[1].update_tag()
    bpy.data.libraries.remove(bpy.data.libraries[0])
    bpy.context.view_layer.update()


@pytest.mark.parametrize("frame", [15, 16])
def test_what_was_made_single_user_is_followed_at_once_or_with_another_frame(live_file, frame):
    obj = key(new_object("Tool"), FRAMES)
    set_mode(obj, "dq_sclerp")
    single, shared = obj.copy(), obj.animation_data.action
    live_file.collection.objects.link(single)
    live_file.view_layer.update()
    live_file.scene.frame_set(15)
    select_only(single)
    # As Object > Relations > Make Single User > Object Animation does.
    bpy.ops.object.make_single_user(
        type="SELECTED_OBJECTS", animation=True, obdata_animation=False, object=False, obdata=False
    )
    assert single.animation_data.action not in (shared, None)
    before = expected_bases(single, [frame])
    for index in range(3):
        curves_of(single)["location", index].keyframe_points[1].co.y += 1.5
    live_file.view_layer.update()
    if frame != 15:
        live_file.scene.frame_set(frame)
    for one in (obj, single):
        assert np.abs(world_now(one.name) - expected_bases(one, [frame])[0]).max() < 2e-5
    assert np.abs(expected_bases(single, [frame]) - before).max() > 0.5
