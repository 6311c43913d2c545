"""Where keys cannot be reduced, it says why and the way out, and changes nothing."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, reduce_keys_of, reduction_of
from tests.animation.bones.rigs import key_all, new_rig
from tests.animation.keyed import curves_of, snapshot
from tests.animation.reduced import recorded
from tests.animation.scenes import key, linked, new_object


def moved_by_a_simulation():
    mesh = bpy.data.meshes.new("Stone")
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], [], [(0, 1, 2), (0, 1, 3), (0, 2, 3), (1, 2, 3)])
    obj = new_object(data=mesh)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.rigidbody.object_add(type="ACTIVE")
    return obj


def with_(change):
    def make():
        obj = recorded()
        change(obj)
        return obj

    return make


def driven(obj):
    obj.driver_add("location", 2)
    return obj


def solved():
    obj = new_object(data=bpy.data.cameras.new("Camera"))
    obj.constraints.new("CAMERA_SOLVER")
    return obj


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (new_object, "Tool has no keys of location, rotation or scale: there is nothing to reduce"),
        (moved_by_a_simulation, r"Tool has no keys.*Object > Rigid Body > Bake to Keyframes"),
        (lambda: key(moved_by_a_simulation(), [1.0]), r"Tool has 1 key of.*a simulation moves it"),
        (lambda: driven(new_object()), r"Tool has no keys.*drivers move it"),
        (lambda: key_all(new_rig("Tool")), r"Tool has no keys.*its bones have"),
        (solved, r"Tool has no keys.*Constraint to F-Curve"),
        (with_(driven), r"Tool: Location Z is driven"),
        (
            with_(lambda obj: curves_of(obj)["location", 1].modifiers.new("NOISE")),
            r"Tool has F-curve modifiers of yours: mute them",
        ),
        (with_(lambda obj: curves_of(obj)["location", 1].convert_to_samples(1, 50)), r"Samples to Keys"),
        (lambda: key(new_object(), [1.0]), "Tool has 1 key of location, rotation or scale: there is nothing to reduce"),
        (
            lambda: key(new_object(), [1.0, 9.0]),
            "Tool has 2 keys of location, rotation or scale: there is nothing to reduce",
        ),
        (lambda: key(new_object(), [1.0, 5.0, 9.0]), "Tool needs its 3 keys to stay within the tolerance"),
        (lambda: key(new_object(), np.arange(1.0, 30.0), scale="uneven"), r"its scale changes differently"),
    ],
)
def test_where_nothing_can_be_reduced_it_says_why_and_the_way_out_and_changes_nothing(live_file, make, message):
    obj = make()
    before, actions = snapshot(obj), list(bpy.data.actions)
    with pytest.raises(Refused, match=message):
        reduce_keys_of(obj)
    assert snapshot(obj) == before
    assert list(bpy.data.actions) == actions
    assert not len(obj.rigid_motion.bakes)
    assert reduction_of(obj) is None


@pytest.mark.parametrize("tolerance", [0.0, float("nan")])
def test_a_tolerance_that_is_none_is_refused(live_file, tolerance):
    with pytest.raises(Refused, match="the tolerance has to be a number above zero"):
        reduce_keys_of(recorded(), tolerance=tolerance)


def test_linked_keys_are_refused(live_file, tmp_path):
    recorded()
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {bpy.data.objects["Tool"]})
    bpy.ops.wm.read_factory_settings(use_empty=True)
    obj = linked(tmp_path / "library.blend", "Tool")
    with pytest.raises(Refused, match="Tool is linked from another file: make it local first"):
        reduce_keys_of(obj)
