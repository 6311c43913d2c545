"""Where a mode cannot work it is refused: the message names object, hindrance and way out, and nothing changes."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import Refused, bake, problem_of, refresh, set_mode
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import assert_shown, expected_bases, shown_worlds
from tests.animation.scenes import FRAMES, give_own_deltas, key, linked, new_object

PLAYED = np.arange(-2.0, 44.0)
DELTAS = ("delta_location", "delta_rotation_quaternion", "delta_rotation_euler", "delta_scale")


def state_of(obj: bpy.types.Object) -> tuple:
    """All that choosing a mode may ever touch, and what is to be seen."""
    action = obj.animation_data.action
    return (
        repr(snapshot(obj)),
        [(fcurve.data_path, fcurve.array_index) for fcurve in curves_of(obj).values()],
        obj.rigid_motion.mode,
        tuple(obj.rigid_motion.filled),
        [tuple(getattr(obj, path)) for path in DELTAS],
        [(slot.handle, slot.digest) for slot in action.rigid_motion.slots],
        [group.name for bag in action.layers[0].strips[0].channelbags for group in bag.groups],
        sorted(block.name for block in bpy.data.actions),
        shown_worlds([obj], PLAYED)[0].tobytes(),
    )


def modifier(kind: str, path: str = "location", **settings: object) -> Callable[[bpy.types.Object], None]:
    def add(obj: bpy.types.Object) -> None:
        added = curves_of(obj)[path, 1].modifiers.new(kind)
        for name, value in settings.items():
            setattr(added, name, value)

    return add


def driver(path: str, index: int = 0) -> Callable[[bpy.types.Object], None]:
    def add(obj: bpy.types.Object) -> None:
        obj.driver_add(path, index).driver.expression = "0.1 * frame"

    return add


def all_driven(obj: bpy.types.Object) -> None:
    for path, index in (("location", 0), ("location", 1), ("location", 2), ("rotation_quaternion", 3), ("scale", 1)):
        driver(path, index)(obj)


def sampled(obj: bpy.types.Object) -> None:
    curves_of(obj)["location", 2].convert_to_samples(1, 41)


def keyed_delta(path: str) -> Callable[[bpy.types.Object], None]:
    return lambda obj: obj.keyframe_insert(path, index=1, frame=5)


def turned_by_axis_and_angle(obj: bpy.types.Object) -> None:
    obj.rotation_mode = "AXIS_ANGLE"


HINDRANCES = {
    "axis and angle": (turned_by_axis_and_angle, "turns by axis and angle.*set its rotation mode to Quaternion"),
    "noise": (
        modifier("NOISE", blend_type="MULTIPLY"),
        "Location Y has a modifier of type Noise that does not just add.*mute or remove it, or bake",
    ),
    "generator": (modifier("GENERATOR"), "Location Y has a modifier of type Generator.*mute or remove"),
    "limits": (modifier("LIMITS", "rotation_quaternion"), "Rotation Quaternion X has a modifier of type Limits"),
    "stepped alone": (modifier("STEPPED"), "Location X and Location Y have different Stepped modifiers"),
    "stepped in part": (
        modifier("STEPPED", use_influence=True, influence=0.5),
        "Location Y has a modifier of type Stepped Interpolation with a restricted range or influence",
    ),
    "cycles in a range": (modifier("CYCLES", use_restricted_range=True), "type Cycles with a restricted range"),
    "cycles in part": (modifier("CYCLES", use_influence=True, influence=0.5), "with a restricted range or influence"),
    "all driven": (all_driven, "Location X is driven: remove the driver, or bake it"),
    "driven delta": (driver("delta_location", 0), "Delta Location X is driven"),
    "animated delta location": (keyed_delta("delta_location"), "Delta Location Y is animated already: move"),
    "animated delta rotation": (keyed_delta("delta_rotation_quaternion"), "Delta Rotation Quaternion X is animated"),
    "animated delta scale": (keyed_delta("delta_scale"), "Delta Scale Y is animated already"),
    "sampled keys": (sampled, "Location Z is sampled and has no keys.*Samples to Keys"),
}
"""What to do to an object, and what it is told."""


@pytest.mark.parametrize("frames", [None, FRAMES[:2]], ids=["whole object", "keys"])
@pytest.mark.parametrize("hindrance", HINDRANCES)
def test_a_mode_that_cannot_work_is_refused_by_name_and_nothing_changes(live_file, hindrance, frames):
    obj = new_object()
    give_own_deltas(obj)
    key(obj, scale="even")
    hinder, message = HINDRANCES[hindrance]
    hinder(obj)
    bpy.context.view_layer.update()
    before = state_of(obj)
    with pytest.raises(Refused, match=f"^Tool.*{message}"):
        set_mode(obj, "dq_sclerp", frames)
    assert state_of(obj) == before
    set_mode(obj, "BLENDER")
    assert state_of(obj) == before, "Blender's own mode is always to be had"
    with pytest.raises(Refused):
        bake(obj)
    assert state_of(obj) == before


@pytest.mark.parametrize("hindrance", [name for name in HINDRANCES if "animated delta" not in name])
def test_what_comes_in_the_way_later_gives_blenders_own_motion_and_a_reason(live_file, hindrance):
    other, obj = key(new_object("Other"), scale="even"), new_object()
    own = give_own_deltas(obj)
    key(obj, scale="even")
    set_mode(obj, "dq_sclerp")
    HINDRANCES[hindrance][0](obj)
    keys = repr(snapshot(obj))
    bpy.context.view_layer.update()
    refresh()
    assert not any(path.startswith("delta") for path, _ in curves_of(obj))
    assert re.match(f"Tool.*{HINDRANCES[hindrance][1]}", problem_of(obj))
    assert repr(snapshot(obj)) == keys
    assert tuple(obj.delta_scale) == own.scale
    if hindrance != "driven delta":
        assert tuple(obj.delta_location) == own.location
    set_mode(other, "dq_sclerp")
    assert_shown([other], PLAYED)


def turn_by_eulers(obj: bpy.types.Object) -> None:
    obj.rotation_mode = "XYZ"


def move_its_delta(obj: bpy.types.Object) -> None:
    obj.rigid_motion.own_location = obj.delta_location = (1.0, 2.0, 3.0)


DIFFERENCES = {"rotation mode": turn_by_eulers, "delta transform": move_its_delta}


def twins() -> tuple[bpy.types.Object, bpy.types.Object]:
    """Two objects that move by the same slot."""
    obj, twin = key(new_object("One")), new_object("Twin")
    twin.animation_data_create().action = obj.animation_data.action
    twin.animation_data.action_slot = obj.animation_data.action_slot
    return obj, twin


@pytest.mark.parametrize("first", ["the mode", "the difference"])
@pytest.mark.parametrize("difference", DIFFERENCES)
def test_of_objects_that_share_a_slot_and_differ_one_leads_and_the_other_is_told(live_file, difference, first):
    obj, twin = twins()
    if first == "the mode":
        set_mode(obj, "dq_sclerp")
        bpy.context.view_layer.update()
    DIFFERENCES[difference](twin)
    bpy.context.view_layer.update()
    set_mode(obj, "dq_sclerp")
    assert_shown([obj], PLAYED)
    assert problem_of(obj) == ""
    assert re.match("Twin moves by the same Action slot as One.*an Action of its own", problem_of(twin))
    twin.animation_data.action = obj.animation_data.action.copy()
    bpy.context.view_layer.update()
    assert problem_of(twin) == ""


@pytest.fixture
def library(live_file, tmp_path) -> Path:
    """A file with an object that has the screw mode, and where that is on the frames played."""
    set_mode(key(new_object("Door")), "dq_sclerp")
    np.save(tmp_path / "door.npy", expected_bases(bpy.data.objects["Door"], PLAYED))
    path = tmp_path / "library.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


def assert_refused_unchanged(obj: bpy.types.Object, message: str) -> None:
    before = state_of(obj)
    for frames in (None, FRAMES[:2]):
        with pytest.raises(Refused, match=message):
            set_mode(obj, "pga_lerp", frames)
        assert state_of(obj) == before


def assert_as_in_the_library(obj: bpy.types.Object, library: Path) -> None:
    expected = np.load(library.with_name("door.npy"))
    assert np.abs(shown_worlds([obj], PLAYED)[0] - expected).max() < 1e-5 * np.abs(expected).max()


def test_a_linked_object_is_refused_and_keeps_the_in_betweens_of_its_library(library):
    obj = linked(library, "Door")
    assert_as_in_the_library(obj, library)
    assert_refused_unchanged(obj, r"^Door is linked from another file: make it local first \(Object > Relations")
    refresh()
    assert_as_in_the_library(obj, library)


def test_an_object_whose_action_is_linked_is_refused(library):
    obj = linked(library, "Door").make_local()
    assert obj.library is None
    assert obj.animation_data.action.library is not None
    assert_refused_unchanged(obj, "^DoorAction is linked from another file: make it local first")
    refresh()
    assert_as_in_the_library(obj, library)
