"""Operators on keys of paths. Moved keys go where they are dragged, as Blender shows them; other keys stay.

`tests/animation/path_steps.py` compares keys and motion after they are retimed, inserted and deleted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion

from rigid_motion.animation import add_layer, key_frames, set_mode, write_channel
from rigid_motion.animation.edits.path_keys import KeyEdits
from rigid_motion.ui.trail.handles import handles_of, selected_spaces
from tests.animation.bones.rigs import in_turn
from tests.animation.held import worlds
from tests.animation.keyed import Carrier, curves_of, snapshot
from tests.animation.layered import key_offset
from tests.animation.scenes import FRAMES, key, new_object
from tests.ui.conftest import select_keys
from tests.ui.trail.carriers import KINDS, MIDDLE, MOVE, TURN, about, carrier_of, choose, held_prop, new_hand

operators = bpy.ops.rigid_motion


@pytest.mark.parametrize(("by", "expected"), [(500.0, FRAMES[2] - 1.0), (-500.0, FRAMES[0] + 1.0)])
def test_a_retimed_key_has_the_same_pose_and_stops_at_its_neighbours(scene, by, expected):
    carrier = choose(carrier_of("QUATERNION"), MIDDLE)
    before = worlds(carrier, [MIDDLE])
    operators.retime_path_keys(frames=by)
    assert worlds(carrier, [expected]) == pytest.approx(before, abs=1e-5)
    assert key_frames(carrier).tolist() == [FRAMES[0], expected, *FRAMES[2:]]


def test_what_is_tried_first_has_no_say_in_what_comes_next(scene):
    carrier = choose(carrier_of("bone"), MIDDLE)
    edits = KeyEdits(selected_spaces(handles_of(bpy.context), leave_carried=True))
    before = snapshot(carrier)
    assert [edits.retime(by) for by in (4.0, 5.0, -3.0)] == [4.0, 5.0, -3.0]
    assert key_frames(carrier)[1] == MIDDLE - 3.0
    edits.move(lambda _: np.array(MOVE))
    assert key_frames(carrier)[1] == MIDDLE
    edits.cancel()
    assert snapshot(carrier) == before


def test_a_key_is_inserted_and_selected_on_the_motion_and_none_on_another(scene):
    carrier, frames = choose(carrier_of("QUATERNION")), np.arange(FRAMES[0], FRAMES[-1] + 1.0)
    motion = worlds(carrier, frames)
    assert operators.insert_path_key(frame=17.0) == {"FINISHED"}
    assert key_frames(carrier).tolist() == sorted((*FRAMES, 17.0))
    assert key_frames(carrier, selected=True).tolist() == [17.0]
    assert worlds(carrier, frames) == pytest.approx(motion, abs=1e-4)
    before = snapshot(carrier)
    assert operators.insert_path_key(frame=MIDDLE) == {"CANCELLED"}
    assert snapshot(carrier) == before


@pytest.mark.parametrize("frame", [24.0, 50.0, 75.0])
def test_the_motion_of_what_is_held_stays_where_a_key_is_inserted(scene, frame):
    prop = held_prop("free")
    before = worlds(prop)
    assert operators.insert_path_key(frame=frame) == {"FINISHED"}
    assert worlds(prop) == pytest.approx(before, abs=2e-5)


def test_selected_keys_and_all_keys_may_be_deleted(scene):
    carrier = choose(carrier_of("QUATERNION"), *FRAMES[1:3])
    set_mode(carrier, "motor_spline")
    operators.delete_path_keys()
    assert key_frames(carrier).tolist() == [FRAMES[0], FRAMES[-1]]
    select_keys(carrier, *FRAMES)
    operators.delete_path_keys()
    assert not [c for (path, _), c in curves_of(carrier).items() if path in ("location", "rotation_quaternion")]


def test_all_keys_are_selected_and_none(scene):
    carrier = choose(carrier_of("bone"))
    assert operators.select_all_path_keys() == {"FINISHED"}
    assert key_frames(carrier, selected=True).tolist() == list(FRAMES)
    operators.select_all_path_keys(deselect=True)
    assert not len(key_frames(carrier, selected=True))


def test_what_has_no_keys_of_its_place_is_refused_and_the_rest_is_done(scene):
    own, grown = carrier_of("QUATERNION"), new_object("Balloon")
    write_channel(grown, "scale", np.array(FRAMES), np.outer(FRAMES, np.ones(3)))
    choose(grown, MIDDLE)
    assert operators.move_path_keys(value=(1.0, 0.0, 0.0)) == {"CANCELLED"}
    select_keys(own, MIDDLE)
    own.select_set(True)
    before = worlds(own, [MIDDLE])
    assert operators.move_path_keys(value=(1.0, 0.0, 0.0)) == {"FINISHED"}
    assert worlds(own, [MIDDLE]) == pytest.approx(np.array(Matrix.Translation((1.0, 0.0, 0.0))) @ before, abs=1e-5)


NEAR = 2e-5
"""Tolerance in metres of places after a round trip through the channels, for places up to ten metres."""


def moved() -> set[str]:
    return operators.move_path_keys(value=MOVE.translation)


def turned() -> set[str]:
    return operators.rotate_path_keys(angle=TURN.angle, axis=TURN.axis)


EDITS = moved, turned


def assert_edited(carrier: Carrier, edit: Callable[[], set[str]], frames: Sequence[float], near: float = NEAR) -> None:
    """Check that the selected keys of an object or bone, on these frames, go where an edit moves them."""
    before = worlds(carrier, frames)
    middle = before[:, :3, 3].mean(axis=0)
    assert edit() == {"FINISHED"}
    expected = (np.array(MOVE) if edit is moved else about(middle, TURN)) @ before
    assert worlds(carrier, frames) == pytest.approx(expected, abs=near)


def assert_middle_edited_alone(carrier: Carrier, edit: Callable[[], set[str]]) -> None:
    """Edit the key in the middle; the others stay."""
    others = [frame for frame in FRAMES if frame != MIDDLE]
    stay = worlds(carrier, others)
    assert_edited(carrier, edit, [MIDDLE])
    assert worlds(carrier, others) == pytest.approx(stay, abs=NEAR)


@pytest.mark.parametrize(
    ("kind", "how"), in_turn(KINDS, tuple(product(("BLENDER", "dq_sclerp", "motor_spline"), EDITS)))
)
def test_a_key_goes_where_it_is_moved_to_and_the_others_stay(scene, kind, how):
    mode, edit = how
    carrier = choose(carrier_of(kind), MIDDLE)
    set_mode(carrier, mode)
    assert_middle_edited_alone(carrier, edit)
    assert key_frames(carrier).tolist() == list(FRAMES)


@pytest.mark.parametrize(("kind", "edit"), [("XYZ", turned), ("parented", moved), ("bone", turned)])
def test_a_key_of_a_layer_goes_where_it_is_moved_to_whatever_the_base_does(scene, kind, edit):
    carrier = carrier_of(kind)
    add_layer(carrier)
    key_offset(carrier, frames=FRAMES)
    bpy.context.view_layer.update()
    assert_edited(choose(carrier, MIDDLE), edit, [MIDDLE], 50 * NEAR)


@pytest.mark.parametrize("kind", ["XYZ", "parented", "bone"])
def test_several_keys_turn_about_their_middle(scene, kind):
    assert_edited(choose(carrier_of(kind), *FRAMES), turned, FRAMES)


@pytest.mark.parametrize(
    ("frame", "how"), in_turn((9.0, 20.0, 28.0, 40.0, 60.0, 70.0), tuple(product(("free", "parented", "bone"), EDITS)))
)
def test_keys_of_what_is_held_go_where_they_are_moved_to(scene, frame, how):
    kind, edit = how
    assert_edited(held_prop(kind, frame), edit, [frame], 5 * NEAR)


def test_a_bone_that_only_turns_points_where_its_tail_is_dragged(scene):
    hand = new_hand(use_connect=True)
    for index in range(3):
        curves_of(hand)  # read again: removing one moves the others
        fcurves = hand.id_data.animation_data.action.layers[0].strips[0].channelbags[0].fcurves
        fcurves.remove(fcurves.find(hand.path_from_id("location"), index=index))
    choose(hand, MIDDLE)
    (before,) = worlds(hand, [MIDDLE])
    assert moved() == {"FINISHED"}
    (after,) = worlds(hand, [MIDDLE])
    assert after[:3, 3] == pytest.approx(before[:3, 3], abs=NEAR)
    tail = before @ (0.0, hand.bone.length, 0.0, 1.0)
    goal = tail[:3] + MOVE.translation - before[:3, 3]
    assert after[:3, 1] / np.linalg.norm(after[:3, 1]) == pytest.approx(goal / np.linalg.norm(goal), abs=NEAR)


def test_nothing_is_done_without_selected_keys_or_paths(scene):
    carrier = choose(carrier_of("QUATERNION"))
    before = snapshot(carrier)
    assert moved() == {"CANCELLED"}
    scene.rigid_motion_overlay.show_paths = False
    assert moved() == {"CANCELLED", "PASS_THROUGH"}, "then G is Blender's own"
    assert snapshot(carrier) == before


POINT = np.array((0.3, -0.2, 0.9, 1.0))


@pytest.mark.parametrize(
    ("kind", "mode"),
    [("QUATERNION", "BLENDER"), ("with deltas", "motor_spline"), ("scaled", "BLENDER"), ("bone", "motor_spline")],
)
def test_the_path_is_that_of_the_point_that_leads_and_bodies_turn_about_it(scene, kind, mode):
    carrier = choose(carrier_of(kind), MIDDLE)
    set_mode(carrier, mode)
    scene.frame_set(17)
    (now,) = worlds(carrier, [17.0])
    scene.cursor.location = (now @ POINT)[:3]
    assert operators.set_path_point(point="CURSOR") == {"FINISHED"}
    (one,) = handles_of(bpy.context)
    line = one.in_world(one.path.line)
    frames = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
    expected_line = (worlds(carrier, frames) @ POINT)[:, :3]
    assert line[np.searchsorted(one.path.frames, frames)] == pytest.approx(expected_line, abs=5e-5)
    before = worlds(carrier, [MIDDLE])
    turned()
    assert worlds(carrier, [MIDDLE]) == pytest.approx(about((before[0] @ POINT)[:3], TURN) @ before, abs=5e-5)


@pytest.mark.parametrize("frame", [28.0, 40.0])
def test_a_point_of_what_is_held_leads(scene, frame):
    prop = held_prop("free", frame)
    prop.rigid_motion.lead = POINT[:3]
    bpy.context.view_layer.update()
    before = worlds(prop, [frame])
    turned()
    assert worlds(prop, [frame]) == pytest.approx(about((before[0] @ POINT)[:3], TURN) @ before, abs=1e-4)


def test_vertices_and_the_tail_lead(scene):
    mesh = bpy.data.meshes.new("Sword")
    mesh.from_pydata([(0, 0, 0), (0, 0, 2), (0.2, 0, 2)], [], [(0, 1, 2)])
    for vertex, is_selected in zip(mesh.vertices, (False, True, True), strict=True):
        vertex.select = is_selected
    sword = choose(new_object("Sword", data=mesh))
    operators.set_path_point(point="VERTICES")
    assert sword.rigid_motion.lead[:] == pytest.approx((0.1, 0.0, 2.0))
    operators.set_path_point(point="ORIGIN")
    assert sword.rigid_motion.lead[:] == (0.0, 0.0, 0.0)
    hand = choose(new_hand())
    operators.set_path_point(point="TAIL")
    assert hand.rigid_motion.lead[:] == pytest.approx((0.0, hand.length, 0.0))


@pytest.mark.parametrize(
    ("part", "mode", "edit"),
    [
        ("location", "BLENDER", moved),
        ("location", "dq_sclerp", turned),
        ("rotation_euler", "BLENDER", turned),
        ("rotation_euler", "dq_sclerp", moved),
    ],
)
def test_what_has_no_key_of_its_own_there_goes_along(scene, part, mode, edit):
    carrier = carrier_of("XYZ")
    for (path, _), fcurve in curves_of(carrier).items():
        if path == part:
            fcurve.keyframe_points.remove(fcurve.keyframe_points[1])
    set_mode(carrier, mode)
    choose(carrier, MIDDLE)
    assert_middle_edited_alone(carrier, edit)


@pytest.fixture
def proportional(scene):
    """Proportional Editing over 20 frames."""
    tools = scene.tool_settings
    tools.use_proportional_action, tools.proportional_size, tools.proportional_edit_falloff = True, 20.0, "LINEAR"


@pytest.mark.parametrize(
    ("kind", "how"),
    in_turn(
        ("QUATERNION", "XYZ", "with deltas", "parented", "hung", "bone"),
        tuple(product(("BLENDER", "motor_spline"), EDITS)),
    ),
)
def test_keys_around_follow_the_less_the_more_frames_they_are_away(proportional, kind, how):
    mode, edit = how
    carrier = choose(carrier_of(kind), MIDDLE)
    set_mode(carrier, mode)
    before = worlds(carrier, FRAMES)
    edit()
    for frame, old, new in zip(FRAMES, before, worlds(carrier, FRAMES), strict=True):
        share = max(1.0 - abs(frame - MIDDLE) / 20.0, 0.0)
        middle = before[FRAMES.index(MIDDLE), :3, 3]
        whole = about(middle, Quaternion(TURN.axis, share * TURN.angle))
        delta = np.array(Matrix.Translation(share * MOVE.translation)) if edit is moved else whole
        assert new == pytest.approx(delta @ old, abs=NEAR), f"on frame {frame}, by {share}"


def test_keys_that_what_carries_them_takes_along_do_not_follow_twice(proportional):
    prop = choose(carrier_of("parented"), MIDDLE)
    table = prop.parent
    table.animation_data_clear()
    select_keys(key(table), MIDDLE)
    table.select_set(True)
    prop.select_set(True)
    in_table = [np.linalg.inv(a) @ b for a, b in zip(worlds(table, FRAMES), worlds(prop, FRAMES), strict=True)]
    before = worlds(table, FRAMES)[:, :3, 3]
    moved()
    shares = np.clip(1.0 - np.abs(np.array(FRAMES) - MIDDLE) / 20.0, 0.0, 1.0)
    assert worlds(table, FRAMES)[:, :3, 3] - before == pytest.approx(np.outer(shares, MOVE.translation), abs=NEAR)
    now = [np.linalg.inv(a) @ b for a, b in zip(worlds(table, FRAMES), worlds(prop, FRAMES), strict=True)]
    assert now == pytest.approx(np.array(in_table), abs=NEAR)


def test_keys_in_time_do_not_follow(proportional):
    carrier = choose(carrier_of("QUATERNION"), MIDDLE)
    operators.retime_path_keys(frames=2.0)
    assert key_frames(carrier).tolist() == [FRAMES[0], MIDDLE + 2.0, *FRAMES[2:]]
