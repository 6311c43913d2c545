"""Damaged and hostile files: nothing is raised out of a handler, what cannot move rigidly keeps Blender's own motion.

Files are damaged while edits are not followed, saved, and opened with the extension switched on. Beside the damaged
object there is always a whole one, which gets its in-betweens whatever is wrong with the other.
"""

from __future__ import annotations

import re

import bpy
import numpy as np
import pytest

from rigid_motion.animation import MODE_IDS, channelbag_of, problem_of, set_mode
from tests.animation.hostile import (
    INF,
    LARGEST,
    LOCATION_Y,
    NAN,
    SEEN,
    TRANSFORMS,
    TURN_W,
    Damage,
    each,
    everywhere,
    make,
    mode_key,
    numbers,
    own_properties,
    reopened,
    soon,
    use,
)
from tests.animation.keyed import WIDTHS, curves_of, snapshot
from tests.animation.oracle import assert_shown, shown_worlds
from tests.thoroughness import sample

pytestmark = pytest.mark.usefixtures("following")


def easing_setting(name: str, interpolation: str, value: float) -> Damage:
    code = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items[interpolation].value
    return each(numbers(LOCATION_Y, "interpolation", code), numbers(LOCATION_Y, name, value, 1))


NUMBERS: dict[str, tuple[Damage, str]] = {
    f"{value} in {field} of {path} {index}, key {at}": (numbers((path, index), field, value, at), "not a finite number")
    for value in (NAN, INF)
    for field in ("co.x", "co.y")
    for path, index in (LOCATION_Y, TURN_W, ("scale", 2))
    for at in (0, 2, 3)
}
NUMBERS |= {
    f"{value} in {field}, key {at}": (numbers(LOCATION_Y, field, value, at), "handle of key .* not a finite number")
    for value in (NAN, -INF)
    for field in ("handle_left.x", "handle_left.y", "handle_right.x", "handle_right.y")
    for at in (0, 1)
}
REFUSED: dict[str, tuple[Damage, str]] = {
    "no frame is a number": (everywhere("co.x", NAN), "not a finite number"),
    "no value is a number": (everywhere("co.y", NAN), "not a finite number"),
    "an overshoot that is no number": (easing_setting("back", "BACK", NAN), "easing of key 2 .* not a finite number"),
    "a period that is no number": (easing_setting("period", "ELASTIC", INF), "easing of key 2 .* not a finite number"),
    "a last key far ahead": (numbers(LOCATION_Y, "co.x", 1e9, 3), "delete the keys that are far off"),
    "a first key far back": (numbers(LOCATION_Y, "co.x", -1e9, 0), "delete the keys that are far off"),
    "a last key at the end of numbers": (
        numbers(LOCATION_Y, "co.x", LARGEST, 3),
        "key 4 of Location Y has the frame 3.4.*no motion can be computed from: delete it",
    ),
    "a key in the middle far ahead": (numbers(LOCATION_Y, "co.x", 1e9, 1), "Location Y are not in the order"),
    "keys out of order": (numbers(LOCATION_Y, "co.x", 30.0, 1), "Location Y are not in the order"),
    "keys out of order everywhere": (
        each(*(numbers((path, i), "co.x", 30.0, 1) for path in TRANSFORMS for i in range(WIDTHS[path]))),
        "not in the order",
    ),
    "values at the end of numbers": (
        each(numbers(LOCATION_Y, "co.y", LARGEST, 0, 2), numbers(LOCATION_Y, "co.y", -LARGEST, 1, 3)),
        "key 1 of Location Y has the value 3.4.*no motion can be computed from: delete it",
    ),
}
REFUSED |= {
    f"mode {value} on a key": (mode_key(value), "key 2 of the mode channel has no mode")
    for value in (-1.0, float(len(MODE_IDS)), 1e30, NAN, INF, -INF)
}


@pytest.mark.parametrize("what", [*sample([*NUMBERS]), *REFUSED])
def test_what_cannot_move_rigidly_keeps_blenders_motion_and_says_why(tmp_path, what):
    damage, reason = (NUMBERS | REFUSED)[what]
    make(damage, "BLENDER")
    broken, _ = reopened(tmp_path, followed=False)
    native = shown_worlds([broken], SEEN)[0]
    make(damage)
    keys = repr(snapshot(bpy.data.objects["Broken"]))
    broken, whole = reopened(tmp_path)
    assert re.match(f"Broken.*{reason}", problem_of(broken)), problem_of(broken)
    assert repr(snapshot(broken)) == keys
    np.testing.assert_array_equal(shown_worlds([broken], SEEN)[0], native)
    assert_shown([whole], SEEN)
    use(broken)
    assert_shown([whole], SEEN)


def unknown_mode(obj: bpy.types.Object) -> None:
    own_properties(obj.animation_data.action)["rigid_motion"]["slots"][0]["mode"] = 77


def own_delta_that_is_no_number(obj: bpy.types.Object) -> None:
    own_properties(obj)["rigid_motion"]["own_quaternion"] = (NAN, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (unknown_mode, "has a mode that this version does not know: choose another"),
        (own_delta_that_is_no_number, "delta transform is not a finite number: set it anew"),
    ],
)
def test_settings_that_make_no_sense_leave_an_object_its_own_motion(tmp_path, damage, reason):
    make(damage)
    broken, whole = reopened(tmp_path)
    assert reason in problem_of(broken)
    assert problem_of(broken).startswith("Broken")
    assert not [path for path, _ in curves_of(broken) if path.startswith("delta_")]
    assert_shown([whole], SEEN)
    use(broken)
    set_mode(broken, "BLENDER")
    assert_shown([whole], SEEN)


def test_choosing_a_mode_for_the_object_mends_a_mode_channel(tmp_path):
    make(mode_key(NAN))
    broken, _ = reopened(tmp_path)
    set_mode(broken, "pga_lerp")
    assert problem_of(broken) == ""
    assert_shown([broken], SEEN)


# What can be mended, or never mattered


def without_deltas(*some: int) -> Damage:
    """In-betweens are gone: these of the F-curves, or all of them."""

    def damage(obj: bpy.types.Object) -> None:
        channelbag = channelbag_of(obj)
        gone = [fcurve for fcurve in channelbag.fcurves if fcurve.data_path.startswith("delta_")]
        for fcurve in [gone[place] for place in some] or gone:
            channelbag.fcurves.remove(fcurve)

    return damage


def garbage_records(obj: bpy.types.Object) -> None:
    records = obj.animation_data.action.rigid_motion.slots
    for handle in (-1, 0, 2**31 - 1, *[record.handle for record in records], *range(500)):
        record = records.add()
        record.handle, record.digest = handle, "\N{PILE OF POO}" * 40


def right_record_without_deltas(obj: bpy.types.Object) -> None:
    without_deltas()(obj)
    obj.rigid_motion.filled = (False,) * 13


def no_records(obj: bpy.types.Object) -> None:
    obj.animation_data.action.rigid_motion.slots.clear()


def records_of_another_kind(obj: bpy.types.Object) -> None:
    kept = own_properties(obj.animation_data.action)
    del kept["rigid_motion"]
    kept["rigid_motion"] = "nonsense"


def curves_that_mean_nothing(obj: bpy.types.Object) -> None:
    channelbag = channelbag_of(obj)
    for path, index in (("location", 7), ("]][[", 0), ("rigid_motion.nothing", 3), ('["\n"]', 2), ("scale", 90)):
        channelbag.fcurves.new(path, index=index).keyframe_points.insert(5.0, NAN)
    channelbag.fcurves.new("delta_rotation_euler", index=1)
    channelbag.fcurves.new("rigid_motion.mode")


MENDED: dict[str, Damage] = {
    "in-betweens gone": without_deltas(),
    "an in-between gone": without_deltas(4),
    "garbage records": garbage_records,
    "a right record without in-betweens": right_record_without_deltas,
    "no records": no_records,
    "records of another kind": records_of_another_kind,
    "F-curves that mean nothing": curves_that_mean_nothing,
    "an interpolation that there is not": numbers(LOCATION_Y, "interpolation", 77, 1),
    "an easing that there is not": each(numbers(LOCATION_Y, "interpolation", 5), numbers(LOCATION_Y, "easing", 77, 1)),
    "a quaternion without length": each(*(numbers((TURN_W[0], index), "co.y", 0.0, 1) for index in range(4))),
    "no quaternion with a length": each(*(numbers((TURN_W[0], index), "co.y", 0.0) for index in range(4))),
    "a scale of zero": each(*(numbers(("scale", index), "co.y", 0.0, 1) for index in range(3))),
    "no scale but zero": each(*(numbers(("scale", index), "co.y", 0.0) for index in range(3))),
    "handles far off": each(
        numbers(LOCATION_Y, "handle_right.x", 1e9, 0), numbers(LOCATION_Y, "handle_left.x", -1e9, 1)
    ),
}


@pytest.mark.parametrize("what", MENDED)
def test_what_can_be_mended_moves_rigidly(tmp_path, what):
    make(MENDED[what])
    objects = reopened(tmp_path)
    assert [problem_of(obj) for obj in objects] == ["", ""]
    assert_shown(objects, SEEN)
    use(objects[0])
    assert_shown(objects, SEEN)


def test_in_betweens_that_were_turned_into_keys_are_left_alone_and_named(tmp_path):
    def damage(obj: bpy.types.Object) -> None:
        curves_of(obj)["delta_location", 0].convert_to_keyframes(1, 41)

    make(damage)
    broken, whole = reopened(tmp_path)
    assert re.match("Broken.*Delta Location X.*delete that channel", problem_of(broken)), problem_of(broken)
    assert [name for name in curves_of(broken) if name[0].startswith("delta_")] == [("delta_location", 0)]
    assert len(curves_of(broken)["delta_location", 0].keyframe_points) == 40
    assert_shown([whole], SEEN)
    use(broken)
    channelbag_of(broken).fcurves.remove(curves_of(broken)["delta_location", 0])
    bpy.context.view_layer.update()
    assert problem_of(broken) == ""
    assert_shown([broken, whole], SEEN)


# Actions without what an Action has


def action_without_layers(obj: bpy.types.Object) -> None:
    action = obj.animation_data.action
    action.layers.remove(action.layers[0])


def slot_gone(obj: bpy.types.Object) -> None:
    obj.animation_data.action.slots.remove(obj.animation_data.action_slot)


def keys_gone(obj: bpy.types.Object) -> None:
    for fcurve in curves_of(obj).values():
        if len(fcurve.keyframe_points):
            fcurve.keyframe_points.clear()


def action_gone(obj: bpy.types.Object) -> None:
    bpy.data.actions.remove(obj.animation_data.action)


@pytest.mark.parametrize("damage", [action_without_layers, slot_gone, keys_gone, action_gone])
def test_without_keys_an_object_rests_with_its_own_delta_transforms(tmp_path, damage):
    def with_deltas(obj: bpy.types.Object) -> None:
        obj.rigid_motion.own_location = (1.0, 2.0, 3.0)
        damage(obj)

    make(with_deltas)
    broken, whole = reopened(tmp_path)
    assert problem_of(broken) == ""
    assert tuple(broken.delta_location) == (1.0, 2.0, 3.0)
    assert not any(broken.rigid_motion.filled)
    assert_shown([whole], SEEN)
    use(broken)


# Names and masses


@pytest.mark.parametrize(
    "name", sample(['"', "\\", '["x"]', "a\nb", "\N{PILE OF POO}" * 15, "rigid_motion.mode"]), ids=repr
)
def test_odd_names_change_nothing(tmp_path, name):
    def rename(obj: bpy.types.Object) -> None:
        obj.animation_data.action.name = obj.animation_data.action_slot.name_display = name

    make(rename, name=name)
    objects = reopened(tmp_path)
    assert objects[0].name == name
    assert_shown(objects, SEEN)
    use(objects[0])
    assert_shown(objects, SEEN)
    numbers(LOCATION_Y, "co.y", NAN, 1)(objects[0])
    assert problem_of(objects[0]).startswith(name)


def set_keys(fcurve: bpy.types.FCurve, frames: np.ndarray) -> None:
    points = fcurve.keyframe_points
    points.clear()
    points.add(len(frames))
    points.foreach_set("co", np.stack((frames, np.sin(0.01 * frames)), axis=1).astype(np.float32).ravel())
    # Blender itself takes its time where they are not all alike.
    points.foreach_set("interpolation", np.ones(len(frames), np.int32))


def over_a_million_frames(obj: bpy.types.Object) -> None:
    set_keys(curves_of(obj)[LOCATION_Y], 1.0 + np.arange(1e6))


def goes_on_for_a_million_frames(obj: bpy.types.Object) -> None:
    bpy.context.scene.frame_end = 1_000_000
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"


def repeats_itself_all_the_time(obj: bpy.types.Object) -> None:
    bpy.context.scene.frame_end = 50_000
    for (path, _), fcurve in curves_of(obj).items():
        if path in TRANSFORMS:
            set_keys(fcurve, 1.0 + 1e-3 * np.arange(4) / 3.0)
            fcurve.modifiers.new("CYCLES")


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (over_a_million_frames, " has keys over 999999 frames, at most 250000 can be filled in"),
        (goes_on_for_a_million_frames, " goes on outside of its keys"),
        (repeats_itself_all_the_time, ": [0-9]* rounds of 0.001.* frames are too many: give Cycles a count"),
    ],
)
def test_what_is_too_long_is_refused_soon(tmp_path, damage, reason):
    make(damage)
    broken, whole = reopened(tmp_path)
    with soon():
        assert re.match(f"Broken{reason}", problem_of(broken)), problem_of(broken)
    assert not [path for path, _ in curves_of(broken) if path.startswith("delta_")]
    assert_shown([whole], SEEN)
    use(broken)
