"""Operators, called as scripts do: on the selected objects."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake_poses, is_baked, key_frames, modes_of, read_poses, reduction_of
from rigid_motion.motion import MODES, Poses, interpolate, shell_error
from rigid_motion.ui import CLASSES, gltf_export, live, pose_operators
from tests.animation.keyed import curves_of, snapshot
from tests.animation.scenes import new_object
from tests.ui.conftest import FRAMES, keyed, select_keys

operators = bpy.ops.rigid_motion

OPERATORS = [cls for cls in CLASSES if issubclass(cls, bpy.types.Operator)]


def modes(obj):
    """The modes of the three segments."""
    return modes_of(obj, FRAMES[:-1])


def turns(obj):
    """The keys of the channel of turns, frames and values."""
    fcurve = curves_of(obj).get(("rigid_motion.turns", 0))
    return {} if fcurve is None else {key.co.x: key.co.y for key in fcurve.keyframe_points}


def test_turns_are_of_the_segment_under_the_playhead_or_of_all(tool):
    operators.set_mode(mode="dq_sclerp")
    bpy.context.scene.frame_set(int(FRAMES[1]) + 2)
    assert operators.set_turns(turns=2) == {"FINISHED"}
    assert turns(tool) == {FRAMES[0]: 0.0, FRAMES[1]: 2.0, FRAMES[2]: 0.0}
    assert operators.set_turns(turns=-1, on="WHOLE") == {"FINISHED"}
    assert set(turns(tool).values()) <= {-1.0, 0.0}
    assert [value for frame, value in turns(tool).items() if frame < FRAMES[-1]] == [-1.0] * (len(turns(tool)) - 1)
    assert operators.set_turns(turns=0, on="WHOLE") == {"FINISHED"}
    assert turns(tool) == {}


def test_turns_of_selected_keys_keep_the_axis_unless_there_is_another(tool):
    operators.set_mode(mode="dq_sclerp")
    select_keys(tool, FRAMES[2])
    operators.set_turns(turns=1, on="SELECTED", axis="X")
    record = tool.animation_data.action.rigid_motion.slots[0]
    assert turns(tool)[FRAMES[2]] == 1.0
    assert record.turns_axis == "X"
    operators.set_turns(turns=2, on="SELECTED")
    assert turns(tool)[FRAMES[2]] == 2.0
    assert record.turns_axis == "X"


def test_a_mode_key_is_selected_with_its_pose_and_the_one_that_ends_it_is_not(tool):
    select_keys(tool, 11.0)
    operators.set_mode(mode="dq_sclerp", on="SELECTED")
    slot = tool.animation_data.action_slot
    curve = tool.animation_data.action.layers[0].strips[0].channelbag(slot).fcurves.find("rigid_motion.mode")
    parts = ("select_control_point", "select_left_handle", "select_right_handle")
    selected = {key.co.x: {getattr(key, part) for part in parts} for key in curve.keyframe_points}
    assert selected[11.0] == {True}
    assert selected[21.0] == {False}


@pytest.mark.parametrize(("frame", "segment"), [(1, 0), (5, 0), (11, 1), (20.5, 1), (30, 2), (41, 2)])
def test_the_segment_under_the_playhead_gets_the_mode(tool, frame, segment):
    bpy.context.scene.frame_set(int(frame), subframe=frame % 1)
    operators.set_mode(mode="pga_lerp", on="CURRENT")
    assert modes(tool) == ["pga_lerp" if place == segment else "BLENDER" for place in range(3)]


def test_without_selected_keys_nothing_changes(tool):
    select_keys(tool)
    with pytest.raises(RuntimeError, match="Select keys of location, rotation or scale"):
        operators.set_mode(mode="dq_sclerp", on="SELECTED")
    assert modes(tool) == ["BLENDER"] * 3


def test_one_that_refuses_is_named_and_the_others_are_done(tool, capfd):
    stubborn = keyed("Stubborn", "AXIS_ANGLE")
    assert operators.set_mode(mode="dq_sclerp") == {"FINISHED"}
    assert modes(tool) == ["dq_sclerp"] * 3
    assert stubborn.rigid_motion.mode == "BLENDER"
    said = capfd.readouterr().out
    assert "1 of 2 objects: Screw (Dual Quaternion). But" in said
    assert "Stubborn turns by axis and angle" in said


def test_without_a_selection_the_active_object_is_meant(tool):
    tool.select_set(False)
    operators.set_mode(mode="dq_sclerp")
    assert tool.rigid_motion.mode == "dq_sclerp"


@pytest.mark.parametrize(
    "name", ["set_mode", "clear", "bake", "unbake", "reduce_keys", "restore_keys", "discard_dense_keys"]
)
def test_without_any_object_an_operator_says_why_not(extension, name):
    operator = getattr(operators, name)
    assert not operator.poll()
    with pytest.raises(RuntimeError, match="Select an object with keys first"):
        operator()


@pytest.mark.parametrize(
    ("options", "frames"),
    [
        ({"step": 10.0}, [1, 11, 21, 31, 41]),
        ({"frames": "CUSTOM", "first": 12.0, "last": 13.0, "step": 2.5}, [1, 11, 13.5, 16, 18.5, 21, 41]),
        ({"frames": "SCENE", "step": 5.0}, [1, 6, 11, 21, 41]),
    ],
    ids=["action", "custom", "scene"],
)
def test_what_is_baked_is_the_range_asked_for_in_whole_segments(tool, options, frames):
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 2, 9
    operators.set_mode(mode="dq_sclerp")
    operators.bake(**options)
    assert key_frames(tool).tolist() == frames


def test_a_range_that_ends_before_its_start_is_refused(tool):
    operators.set_mode(mode="dq_sclerp")
    with pytest.raises(RuntimeError, match="before its start"):
        operators.bake(frames="CUSTOM", first=20.0, last=10.0)
    assert not is_baked(tool)


def refusal_of(name: str) -> str:
    """Why an operator is greyed out; "" where it is not."""
    operator = getattr(operators, name)
    if operator.poll():
        return ""
    with pytest.raises(RuntimeError) as refused:
        operator()
    return str(refused.value)


def test_buttons_with_nothing_to_do_are_greyed_out_with_the_reason(tool):
    assert "choose a mode" in refusal_of("bake")
    assert "Blender's own in-betweens already" in refusal_of("clear")
    assert "None of these objects is baked" in refusal_of("unbake")
    assert "not reduced" in refusal_of("restore_keys")
    assert refusal_of("reduce_keys") == ""
    operators.set_mode(mode="dq_sclerp")
    assert refusal_of("bake") == refusal_of("clear") == ""
    operators.bake()
    assert "choose a mode" in refusal_of("bake")
    assert refusal_of("unbake") == ""
    operators.unbake()
    assert refusal_of("bake") == ""
    operators.clear()
    assert "Blender's own in-betweens already" in refusal_of("clear")


def test_a_mode_that_waits_for_keys_can_be_cleared_and_has_nothing_to_bake(extension):
    obj = new_object()
    obj.select_set(True)
    operators.set_mode(mode="dq_sclerp")
    assert refusal_of("clear") == ""
    assert "choose a mode" in refusal_of("bake")


def recorded(name: str = "Tool", size: float = 1.0) -> bpy.types.Object:
    """A selected, active object with a key on every frame of a wild motion about a metre wide, times a size."""
    random = np.random.default_rng(3)
    keys = Poses(size * random.normal(size=(9, 3)), random.normal(size=(9, 4)))
    frames = np.arange(1.0, 252.0)
    obj = new_object(name)
    bake_poses(obj, frames, interpolate(np.linspace(1.0, 251.0, 9), keys, frames, "motor_spline"))
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def test_the_best_mode_of_each_segment_is_said_and_is_one_step_to_undo(extension, capfd):
    obj = recorded()
    before = snapshot(obj)
    bpy.ops.ed.undo_push(message="recording")
    assert operators.reduce_keys(mode="lerp_slerp", tolerance=0.1, radius=0.5, best_of=True) == {"FINISHED"}
    bpy.ops.ed.undo_push(message="reduction")
    segments = reduction_of(obj).segments
    assert sum(segments.values()) == len(key_frames(obj)) - 1
    assert len(segments) > 1
    said = capfd.readouterr().out
    assert "; segments: " in said
    for mode, count in segments.items():
        assert f"{count} {MODES[mode].short_label}" in said
    bpy.ops.ed.undo()
    assert snapshot(bpy.data.objects["Tool"]) == before


def test_the_tolerance_is_a_millimetre_in_any_unit(extension):
    bpy.context.scene.unit_settings.scale_length = 0.01
    obj = recorded(size=100.0)
    frames = key_frames(obj)
    truth = read_poses(obj, frames)
    operators.reduce_keys(radius=10.0)
    error = shell_error(read_poses(obj, frames), truth, 10.0).max()
    assert 0.02 < error < 0.1 * 1.001


def test_each_object_has_the_radius_of_its_own_size(extension):
    frames = np.arange(1.0, 252.0)
    sizes = {"Small": 0.01, "Large": 3.0}
    truths = {}
    for name, size in sizes.items():
        obj = recorded(name)
        obj.empty_display_size = size
        truths[name] = read_poses(obj, frames)
    operators.reduce_keys(tolerance=0.02)
    for name, size in sizes.items():
        obj = bpy.data.objects[name]
        assert shell_error(read_poses(obj, frames), truths[name], size).max() <= 0.02001
    assert len(key_frames(bpy.data.objects["Large"])) > len(key_frames(bpy.data.objects["Small"]))


def test_reduced_keys_are_restored_or_the_others_discarded(extension):
    obj = recorded()
    before = snapshot(obj)
    operators.reduce_keys(tolerance=0.02)
    assert operators.restore_keys() == {"FINISHED"}
    assert snapshot(obj) == before
    assert not operators.restore_keys.poll()
    operators.reduce_keys(tolerance=0.02)
    reduced = snapshot(obj)
    assert operators.discard_dense_keys() == {"FINISHED"}
    assert snapshot(obj) == reduced
    assert not operators.restore_keys.poll()
    assert not operators.discard_dense_keys.poll()
    assert [action.name for action in bpy.data.actions] == ["ToolAction Reduced"]


@pytest.mark.parametrize("operator", OPERATORS, ids=lambda operator: operator.bl_idname)
def test_every_operator_and_property_says_what_it_is_for(extension, operator):
    assert operator.bl_idname.startswith("rigid_motion.")
    assert len(operator.bl_description) > 20
    assert not operator.bl_description.endswith(".")
    # Blender's operator that is called makes the step of undo, if it makes one; an export and a port change nothing.
    without_undo = {*pose_operators.CLASSES, *gltf_export.CLASSES, *live.CLASSES}
    assert {"REGISTER", "UNDO"} - operator.bl_options <= ({"UNDO"} if operator in without_undo else set())
    kind = getattr(bpy.ops.rigid_motion, operator.bl_idname.partition(".")[2]).get_rna_type()
    for prop in kind.properties:
        if prop.identifier != "rna_type":
            assert prop.name, prop.identifier
            assert prop.description, prop.identifier
            assert all(item.description for item in getattr(prop, "enum_items", ())), prop.identifier
