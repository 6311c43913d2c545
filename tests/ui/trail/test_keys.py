"""Keys on paths are retimed, inserted, deleted and selected, with Blender's F-curves as the reference."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from rigid_motion.animation import key_frames, set_mode, write_channel
from rigid_motion.animation.edits.path_keys import KeyEdits
from rigid_motion.ui.trail.handles import handles_of, selected_spaces
from tests.animation.bones.rigs import in_turn
from tests.animation.held import handled, in_holder, new_hands, new_prop, worlds
from tests.animation.keyed import curves_of, mode_at, snapshot
from tests.animation.scenes import FRAMES, new_object
from tests.ui.conftest import select_keys
from tests.ui.trail.conftest import CARRIERS, MIDDLE, MOVE, choose, held_prop

operators = bpy.ops.rigid_motion

KINDS = ("QUATERNION", "XYZ", "parented", "bone")


@pytest.mark.parametrize("kind", KINDS)
def test_a_retimed_key_has_the_same_pose_later(scene, kind):
    carrier = choose(CARRIERS[kind](), MIDDLE)
    set_mode(carrier, "dq_sclerp")
    carrier.id_data.parent = None
    bases = basis(carrier, MIDDLE)
    others = [basis(carrier, frame) for frame in FRAMES if frame != MIDDLE]
    assert operators.retime_path_keys(frames=5.0) == {"FINISHED"}
    assert key_frames(carrier).tolist() == [FRAMES[0], MIDDLE + 5.0, *FRAMES[2:]]
    assert basis(carrier, MIDDLE + 5.0) == pytest.approx(bases, abs=1e-5)
    for frame, other in zip((f for f in FRAMES if f != MIDDLE), others, strict=True):
        assert basis(carrier, frame) == pytest.approx(other, abs=1e-5)


def basis(carrier, frame: float) -> np.ndarray:
    bpy.context.scene.frame_set(int(frame))
    return np.array(carrier.matrix_basis)


@pytest.mark.parametrize(("by", "expected"), [(500.0, FRAMES[2] - 1.0), (-500.0, FRAMES[0] + 1.0)])
def test_a_retimed_key_stops_at_its_neighbours(scene, by, expected):
    carrier = choose(CARRIERS["QUATERNION"](), MIDDLE)
    operators.retime_path_keys(frames=by)
    assert key_frames(carrier).tolist() == [FRAMES[0], expected, *FRAMES[2:]]


def test_what_is_tried_first_has_no_say_in_what_comes_next(scene):
    carrier = choose(CARRIERS["bone"](), MIDDLE)
    edits = KeyEdits(selected_spaces(handles_of(bpy.context), leave_carried=True))
    before = snapshot(carrier)
    assert [edits.retime(by) for by in (4.0, 5.0, -3.0)] == [4.0, 5.0, -3.0]
    assert key_frames(carrier)[1] == MIDDLE - 3.0
    edits.move(lambda _: np.array(MOVE))
    assert key_frames(carrier)[1] == MIDDLE
    edits.cancel()
    assert snapshot(carrier) == before


@pytest.mark.parametrize(("kind", "mode"), in_turn(KINDS, ("BLENDER", "dq_sclerp", "lerp_slerp", "motor_spline")))
def test_the_motion_stays_where_a_key_is_inserted(scene, kind, mode):
    carrier = choose(CARRIERS[kind]())
    set_mode(carrier, mode)
    frames = np.arange(FRAMES[0], FRAMES[-1] + 1.0)
    before = worlds(carrier, frames)
    assert operators.insert_path_key(frame=17.0) == {"FINISHED"}
    assert key_frames(carrier).tolist() == sorted((*FRAMES, 17.0))
    assert key_frames(carrier, selected=True).tolist() == [17.0]
    assert worlds(carrier, frames) == pytest.approx(before, abs=1e-4 if mode == "BLENDER" else 1e-5)


@pytest.mark.parametrize("frame", [28.0, 40.0])
def test_what_is_held_is_so_as_before_on_the_frame_that_its_key_comes_to(scene, frame):
    prop = new_prop("free")
    hands = new_hands()
    handled(prop, *hands)
    choose(prop, frame)
    holder, others = hands[frame >= 40.0], [9.0, 20.0, 60.0, 70.0]
    before, stay = in_holder(prop, holder, [frame]), worlds(prop, others)
    assert operators.retime_path_keys(frames=2.0) == {"FINISHED"}
    assert in_holder(prop, holder, [frame + 2.0]) == pytest.approx(before, abs=2e-5)
    assert worlds(prop, others) == pytest.approx(stay, abs=2e-5)


def test_no_key_is_inserted_on_another(scene):
    carrier = choose(CARRIERS["QUATERNION"]())
    before = snapshot(carrier)
    assert operators.insert_path_key(frame=MIDDLE) == {"CANCELLED"}
    assert snapshot(carrier) == before


@pytest.mark.parametrize("frame", [24.0, 50.0, 75.0])
def test_the_motion_of_what_is_held_stays_where_a_key_is_inserted(scene, frame):
    prop = held_prop("free")
    before = worlds(prop)
    assert operators.insert_path_key(frame=frame) == {"FINISHED"}
    assert worlds(prop) == pytest.approx(before, abs=2e-5)


@pytest.mark.parametrize("kind", ["XYZ", "bone"])
def test_deleted_keys_are_gone_and_the_others_stay(scene, kind):
    carrier = choose(CARRIERS[kind](), *FRAMES[1:3])
    set_mode(carrier, "dq_sclerp")
    stay = worlds(carrier, [FRAMES[0], FRAMES[-1]])
    assert operators.delete_path_keys() == {"FINISHED"}
    assert key_frames(carrier).tolist() == [FRAMES[0], FRAMES[-1]]
    assert worlds(carrier, [FRAMES[0], FRAMES[-1]]) == pytest.approx(stay, abs=1e-5)
    assert mode_at(carrier, FRAMES[0]) == "dq_sclerp"


def test_all_keys_may_be_deleted(scene):
    carrier = choose(CARRIERS["QUATERNION"](), *FRAMES)
    set_mode(carrier, "motor_spline")
    operators.delete_path_keys()
    assert not [c for (path, _), c in curves_of(carrier).items() if path in ("location", "rotation_quaternion")]


def test_all_keys_are_selected_and_none(scene):
    carrier = choose(CARRIERS["bone"]())
    assert operators.select_all_path_keys() == {"FINISHED"}
    assert key_frames(carrier, selected=True).tolist() == list(FRAMES)
    operators.select_all_path_keys(deselect=True)
    assert not len(key_frames(carrier, selected=True))


def test_what_has_no_keys_of_its_place_is_refused_and_the_rest_is_done(scene):
    own, grown = CARRIERS["QUATERNION"](), new_object("Balloon")
    write_channel(grown, "scale", np.array(FRAMES), np.outer(FRAMES, np.ones(3)))
    choose(grown, MIDDLE)
    assert operators.move_path_keys(value=(1.0, 0.0, 0.0)) == {"CANCELLED"}
    select_keys(own, MIDDLE)
    own.select_set(True)
    before = worlds(own, [MIDDLE])
    assert operators.move_path_keys(value=(1.0, 0.0, 0.0)) == {"FINISHED"}
    assert worlds(own, [MIDDLE]) == pytest.approx(np.array(Matrix.Translation((1.0, 0.0, 0.0))) @ before, abs=1e-5)
