"""Operators that retime, insert, delete and select keys on paths.

`tests/animation/path_steps.py` compares the keys and the motion after such edits.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from rigid_motion.animation import key_frames, set_mode, write_channel
from rigid_motion.animation.edits.path_keys import KeyEdits
from rigid_motion.ui.trail.handles import handles_of, selected_spaces
from tests.animation.held import worlds
from tests.animation.keyed import curves_of, snapshot
from tests.animation.scenes import FRAMES, new_object
from tests.ui.conftest import select_keys
from tests.ui.trail.conftest import CARRIERS, MIDDLE, MOVE, choose

operators = bpy.ops.rigid_motion


@pytest.mark.parametrize(("by", "expected"), [(500.0, FRAMES[2] - 1.0), (-500.0, FRAMES[0] + 1.0)])
def test_a_retimed_key_has_the_same_pose_and_stops_at_its_neighbours(scene, by, expected):
    carrier = choose(CARRIERS["QUATERNION"](), MIDDLE)
    before = worlds(carrier, [MIDDLE])
    operators.retime_path_keys(frames=by)
    assert worlds(carrier, [expected]) == pytest.approx(before, abs=1e-5)
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


def test_a_key_is_inserted_and_selected_on_the_motion_and_none_on_another(scene):
    carrier, frames = choose(CARRIERS["QUATERNION"]()), np.arange(FRAMES[0], FRAMES[-1] + 1.0)
    motion = worlds(carrier, frames)
    assert operators.insert_path_key(frame=17.0) == {"FINISHED"}
    assert key_frames(carrier).tolist() == sorted((*FRAMES, 17.0))
    assert key_frames(carrier, selected=True).tolist() == [17.0]
    assert worlds(carrier, frames) == pytest.approx(motion, abs=1e-4)
    before = snapshot(carrier)
    assert operators.insert_path_key(frame=MIDDLE) == {"CANCELLED"}
    assert snapshot(carrier) == before


def test_selected_keys_and_all_keys_may_be_deleted(scene):
    carrier = choose(CARRIERS["QUATERNION"](), *FRAMES[1:3])
    set_mode(carrier, "motor_spline")
    operators.delete_path_keys()
    assert key_frames(carrier).tolist() == [FRAMES[0], FRAMES[-1]]
    select_keys(carrier, *FRAMES)
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
