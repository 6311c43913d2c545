"""Operators called from scripts, acting on the selected objects."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import (
    key_frames,
    modes_of,
    problem_of,
    set_mode,
)
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.sizes import first_tolerance
from rigid_motion.ui.operators import axis_of_turns
from tests.animation.keyed import curves_of
from tests.animation.scenes import editor, new_object
from tests.ui.conftest import FRAMES, keyed, select_keys

operators = bpy.ops.rigid_motion


def modes(obj):
    """Return the modes of the three segments."""
    return modes_of(obj, FRAMES[:-1])


def turns(obj):
    """Return the keys of the channel of whole turns: values by frames."""
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
    assert turns(tool)[FRAMES[2]] == 1.0
    assert axis_of_turns(transform_of(tool)) == "X"
    operators.set_turns(turns=2, on="SELECTED")
    assert turns(tool)[FRAMES[2]] == 2.0
    assert axis_of_turns(transform_of(tool)) == "X"


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
    stubborn = keyed("Stubborn")
    curves_of(stubborn)["location", 1].modifiers.new("ENVELOPE")
    assert operators.set_mode(mode="dq_sclerp") == {"FINISHED"}
    assert modes(tool) == ["dq_sclerp"] * 3
    assert modes(stubborn) == ["BLENDER"] * 3
    said = capfd.readouterr().out
    assert "1 of 2 objects: Screw. But" in said
    assert "Stubborn: Location Y has an Envelope" in said


@pytest.mark.parametrize(
    "name", ["set_mode", "clear", "bake", "unbake", "reduce_keys", "restore_keys", "discard_dense_keys", "add_cycles"]
)
def test_without_any_object_an_operator_says_why_not(extension, name):
    operator = getattr(operators, name)
    assert not operator.poll()
    with pytest.raises(RuntimeError, match="Select objects or bones with keys first"):
        operator()


def refusal_of(name: str) -> str:
    """Return why an operator is greyed out, "" if it is not."""
    operator = getattr(operators, name)
    if operator.poll():
        return ""
    with pytest.raises(RuntimeError) as refused:
        operator()
    return str(refused.value)


def test_buttons_with_nothing_to_do_are_greyed_out_with_the_reason(tool):
    assert "choose a mode" in refusal_of("bake")
    assert "All keys already have Blender's own in-betweens" in refusal_of("clear")
    assert "Nothing here is baked" in refusal_of("unbake")
    assert "neither reduced nor cleaned" in refusal_of("restore_keys")
    assert refusal_of("reduce_keys") == ""
    operators.set_mode(mode="dq_sclerp")
    assert refusal_of("bake") == refusal_of("clear") == ""
    operators.bake()
    assert "choose a mode" in refusal_of("bake")
    assert refusal_of("unbake") == ""
    operators.unbake()
    assert refusal_of("bake") == ""
    operators.clear()
    assert "All keys already have Blender's own in-betweens" in refusal_of("clear")


def test_keys_get_the_modes_that_the_active_one_has_on_their_frames(extension):
    alike, other, model = keyed("Alike"), keyed("Other"), keyed("Model")
    for fcurve in curves_of(other).values():
        fcurve.keyframe_points[1].co_ui.x += 3.0
    other.animation_data.action.update_tag()
    set_mode(model, "pga_lerp", FRAMES[1:2])
    set_mode(model, "dq_sclerp", FRAMES[2:3])
    assert operators.copy_mode() == {"FINISHED"}
    assert modes(alike) == modes(model) == ["BLENDER", "pga_lerp", "dq_sclerp"]
    assert modes_of(other, key_frames(other)) == ["BLENDER", "pga_lerp", "dq_sclerp", "BLENDER"]
    set_mode(model, "BLENDER")
    operators.copy_mode()
    assert modes(alike) == modes(other) == ["BLENDER"] * 3
    model.select_set(False)
    alike.select_set(False)
    other.select_set(False)
    assert "Select the ones to receive the mode" in refusal_of("copy_mode")


def test_what_has_no_keys_yet_waits_for_them_with_the_mode_that_is_copied(extension):
    waiting = new_object("Waiting")
    set_mode(keyed("Model"), "dq_sclerp")
    waiting.select_set(True)
    operators.copy_mode()
    assert waiting.rigid_motion.mode == "dq_sclerp"


def test_cycles_are_on_all_channels_and_in_front(tool):
    operators.set_mode(mode="dq_sclerp")
    assert operators.add_cycles(mode="MIRROR") == {"FINISHED"}
    assert {(first.type, first.mode_before, first.mode_after) for first in first_modifiers(tool)} == {
        ("CYCLES", "MIRROR", "MIRROR")
    }
    assert problem_of(tool) == ""
    curves_of(tool)["location", 0].keyframe_points.insert(50.0, 3.0)
    with pytest.raises(RuntimeError, match="first and last keys on the same frames"):
        operators.add_cycles(mode="MIRROR")


def first_modifiers(obj):
    return [fcurve.modifiers[0] for fcurve in curves_of(obj).values()]


def test_blenders_make_cyclic_works_on_channels_with_a_mode(tool):
    operators.set_mode(mode="dq_sclerp")
    with editor("GRAPH_EDITOR", "FCURVES"):
        bpy.ops.graph.select_all(action="SELECT")
        bpy.ops.graph.extrapolation_type(type="MAKE_CYCLIC")
    bpy.context.view_layer.update()
    # Before 5.2, Blender adds no cycles to channels that have modifiers.
    assert all(first.type == "CYCLES" for first in first_modifiers(tool)) == (bpy.app.version >= (5, 2))


def test_a_breakdown_is_keyed_by_its_factor(tool):
    operators.set_mode(mode="dq_sclerp")
    bpy.context.scene.frame_set(14)
    for factor, x in ((0.0, 2.0), (1.0, 4.0)):
        assert operators.breakdown(factor=factor) == {"FINISHED"}
        assert tool.location[:] == pytest.approx((x, 0.0, 0.0), abs=1e-5)
    assert key_frames(tool).tolist() == sorted([*FRAMES.tolist(), 14.0])


def test_the_tolerance_to_begin_with_is_a_millimetre_in_any_unit(tool):
    bpy.context.scene.unit_settings.scale_length = 0.01
    assert first_tolerance(bpy.context.scene, [transform_of(tool)]) == pytest.approx(0.1)
