"""Which channels an edit was about, by a snapshot of their slot."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import pytest

from rigid_motion.animation import set_enabled, set_turns
from rigid_motion.animation.actions.slots import slots_in
from rigid_motion.animation.following.changes import Snapshot
from rigid_motion.animation.following.follower import follower
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object

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


def test_turns_and_the_modifiers_that_were_written_are_told_apart(tool):
    snapshot, look = snapshot_of(tool)
    curve = curves_of(tool)[X]
    curve.modifiers.new("GENERATOR")
    assert snapshot.note_modifiers({X: curve})
    assert look() == set()
    curve.keyframe_points.insert(15.0, 1.0)
    assert not snapshot.note_modifiers({X: curve})
    set_turns(tool, 0, [1.0])
    for fcurve in curves_of(tool).values():
        fcurve.keyframe_points[0].back = 2.0
    look()
    tool.keyframe_insert("rigid_motion.turns")
    assert look() == {("rigid_motion.turns", 0)}


def test_an_undo_step_is_no_edit_that_was_followed(tool):
    follower.snapshots = dict.fromkeys([(0, 0)])
    follower.after_undo()
    assert follower.snapshots == {}
