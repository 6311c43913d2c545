"""Refusals: a mode that cannot work names the object, the cause and the way out, and nothing changes."""

from __future__ import annotations

import re
from operator import itemgetter

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, problem_of, refresh, set_mode
from rigid_motion.animation.actions.modifiers import add_cycles
from rigid_motion.animation.fcurves.keys import Cycles
from tests.animation.keyed import curves_of, snapshot
from tests.animation.modified import is_term
from tests.animation.oracle import assert_shown, shown_worlds
from tests.animation.scenes import FRAMES, give_own_deltas, key, linked, new_object

PLAYED = np.arange(-2.0, 44.0)
DELTAS = ("delta_location", "delta_rotation_quaternion", "delta_rotation_euler", "delta_scale")


def state_of(obj: bpy.types.Object) -> tuple:
    """Return everything that setting a mode could change, and the displayed matrices."""
    action = obj.animation_data.action
    return (
        repr(snapshot(obj)),
        [(path, index, len(fcurve.modifiers)) for (path, index), fcurve in curves_of(obj).items()],
        obj.rigid_motion.mode,
        [tuple(getattr(obj, path)) for path in DELTAS],
        [group.name for bag in action.layers[0].strips[0].channelbags for group in bag.groups],
        sorted(block.name for block in bpy.data.actions),
        shown_worlds([obj], PLAYED)[0].tobytes(),
    )


def all_driven(obj: bpy.types.Object) -> None:
    for path, index in curves_of(obj):
        obj.driver_add(path, index).driver.expression = "0.1 * frame"


def repeating_apart(obj: bpy.types.Object) -> None:
    for fcurve in curves_of(obj).values():
        add_cycles(fcurve, Cycles("REPEAT", "REPEAT", 0, 0))
    curves_of(obj)["location", 2].keyframe_points[-1].co_ui.x += 1.0


HINDRANCES = {
    "envelope": (
        lambda obj: curves_of(obj)["location", 1].modifiers.new("ENVELOPE"),
        "Location Y has an Envelope.*mute or remove it, or bake the channel",
    ),
    "all driven": (all_driven, "Location X is driven: remove the driver, or bake it"),
    "all sampled": (
        lambda obj: [fcurve.convert_to_samples(1, 41) for fcurve in curves_of(obj).values()],
        "Location X is muted, or has samples.*Samples to Keys",
    ),
    "moving delta": (
        lambda obj: obj.keyframe_insert("delta_rotation_quaternion", frame=7),
        r"Delta Rotation \(Quaternion\) W is animated on top of.*to a parent",
    ),
    "cycles": (
        lambda obj: add_cycles(curves_of(obj)["location", 2], Cycles("REPEAT", "REPEAT", 0, 0)),
        "repeats, but its channels differ",
    ),
    "cycles of another length": (repeating_apart, "repeats, but its channels differ"),
}
"""What to do to an object, and the refusal it causes."""


def hindered(name: str, mode: str = "") -> tuple[bpy.types.Object, bpy.types.Object, str]:
    """Return another object, an object with a hindrance (with a mode, if given), and the expected message."""
    other, obj = key(new_object("Other"), scale="even"), new_object()
    give_own_deltas(obj)
    key(obj, scale="even")
    if mode:
        set_mode(obj, mode)
    hinder, message = HINDRANCES[name]
    hinder(obj)
    bpy.context.view_layer.update()
    return other, obj, f"^Tool.*{message}"


@pytest.mark.parametrize("frames", [None, FRAMES[:2]], ids=["whole object", "keys"])
@pytest.mark.parametrize("hindrance", HINDRANCES)
def test_a_mode_that_cannot_work_is_refused_by_name_and_nothing_changes(live_file, hindrance, frames):
    other, obj, message = hindered(hindrance)
    before = [state_of(other), state_of(obj)]
    for targets in (obj, [other, obj]):
        with pytest.raises(Refused, match=message):
            set_mode(targets, "dq_sclerp", frames)
    assert [state_of(other), state_of(obj)] == before
    set_mode(obj, "BLENDER")
    assert state_of(obj) == before[1], "Blender's own mode is always to be had"


@pytest.mark.parametrize("hindrance", sorted(HINDRANCES.keys() - {"all sampled"}))  # without keys it says no mode
def test_what_comes_in_the_way_later_gives_blenders_own_motion_and_a_reason(live_file, hindrance):
    other, obj, message = hindered(hindrance, "dq_sclerp")
    keys = repr(snapshot(obj))
    refresh()
    assert not any(map(is_term, (item for fcurve in curves_of(obj).values() for item in fcurve.modifiers)))
    assert re.match(message, problem_of(obj))
    assert repr(snapshot(obj)) == keys
    set_mode(other, "dq_sclerp")
    assert_shown([other], PLAYED)


def test_deltas_that_move_themselves_are_on_top_of_the_mode(live_file):
    obj, plain = (key(new_object(name), scale="even") for name in ("Tool", "Plain"))
    for frame in (1, 40):
        obj.delta_location, obj.delta_scale = (0.1 * frame, 0.0, 0.0), (1.0 + 0.1 * frame,) * 3
        obj.keyframe_insert("delta_location", frame=frame)
        obj.keyframe_insert("delta_scale", frame=frame)
    set_mode([obj, plain], "cga_slerp")
    for frame in (7, 33):
        live_file.scene.frame_set(frame)
        assert refresh() == 0
        for path in ("location", "rotation_quaternion", "scale"):
            assert tuple(getattr(obj, path)) == pytest.approx(tuple(getattr(plain, path)), abs=1e-5)


@pytest.mark.parametrize(("first", "leaves"), [("the mode", "its Action"), ("the difference", "its slot")])
@pytest.mark.parametrize(
    "difference", [("rotation_mode", "XYZ"), ("delta_rotation_quaternion", (1.0, 2.0, 3.0, 0.0))], ids=itemgetter(0)
)
def test_of_objects_that_share_a_slot_and_differ_one_leads_and_the_other_is_told_until_it_leaves(
    live_file, difference, first, leaves
):
    obj, twin = key(new_object("One")), new_object("Twin")
    twin.animation_data_create().action = obj.animation_data.action
    twin.animation_data.action_slot = obj.animation_data.action_slot
    if first == "the mode":
        set_mode(obj, "dq_sclerp")
        bpy.context.view_layer.update()
    setattr(twin, *difference)
    bpy.context.view_layer.update()
    set_mode(obj, "dq_sclerp")
    assert_shown([obj], PLAYED)
    assert problem_of(obj) == ""
    assert re.match("Twin moves by the same Action slot as One.*an Action of its own", problem_of(twin))
    if leaves == "its Action":
        obj.animation_data.action = None
    else:
        obj.animation_data.action_slot = obj.animation_data.action.slots.new("OBJECT", "Other")
    bpy.context.view_layer.update()
    assert problem_of(twin) == ""
    assert_shown([twin], PLAYED)
    assert any(map(is_term, (item for curve in curves_of(twin).values() for item in curve.modifiers)))


@pytest.mark.parametrize("is_local", [False, True], ids=["linked", "with a linked Action"])
def test_what_belongs_to_another_file_is_refused(live_file, tmp_path, is_local):
    set_mode(key(new_object("Door")), "dq_sclerp")
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = linked(tmp_path / "library.blend", "Door")
    if is_local:
        obj = obj.make_local()
    before, name = state_of(obj), "DoorAction" if is_local else "Door"
    for frames in (None, FRAMES[:2]):
        with pytest.raises(Refused, match=rf"^{name} is linked from another file: make it local first \(Object >"):
            set_mode(obj, "pga_lerp", frames)
        assert state_of(obj) == before
