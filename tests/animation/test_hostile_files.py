"""Damaged and hostile files: handlers raise nothing, and damaged objects keep Blender's own motion.

Files are damaged while edits are not followed, saved, and opened with the extension switched on. A second, intact
object always gets its in-betweens, whatever is wrong with the damaged one.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator
from itertools import cycle, product
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import MODE_IDS, channelbag_of, modes_of, problem_of, set_mode
from rigid_motion.animation.actions.marks import write_marks
from rigid_motion.animation.fcurves.keys import ELASTIC
from tests.animation.keyed import WIDTHS, curves_of, snapshot
from tests.animation.modified import is_term
from tests.animation.oracle import assert_shown, shown_worlds
from tests.animation.scenes import FRAMES, key, new_object
from tests.blank import blank

SEEN = range(-2, 46, 3)

NAN, INF = float("nan"), float("inf")
LARGEST = float(np.finfo(np.float32).max)

TRANSFORMS = ("location", "rotation_quaternion", "scale")
LOCATION_Y, TURN_W = ("location", 1), ("rotation_quaternion", 0)

Damage = Callable[[bpy.types.Object], object]


def make(damage: Damage, mode: str = "dq_sclerp") -> None:
    """Set up a new file with a damaged and an intact object."""
    animation.set_enabled(True)
    blank()
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 40
    broken, whole = key(new_object("Broken"), seed=1, scale="even"), key(new_object("Whole"), seed=2)
    set_mode(broken, mode)
    set_mode(whole, mode, FRAMES)
    animation.set_enabled(False)
    damage(broken)


def reopened(folder: Path, *, followed: bool = True) -> tuple[bpy.types.Object, bpy.types.Object]:
    """Save and reopen the file. Return the damaged and the intact object, followed by the extension or not."""
    path = str(folder / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    animation.set_enabled(followed)
    bpy.ops.wm.open_mainfile(filepath=path)
    bpy.context.view_layer.update()
    whole = bpy.data.objects["Whole"]
    return next(obj for obj in bpy.data.objects if obj != whole), whole


@pytest.fixture(autouse=True)
def soon(live_file) -> Iterator[None]:
    """Check that everything takes far less time than an animator would wait."""
    began = time.process_time()
    yield
    assert time.process_time() - began < 10.0


def use(obj: bpy.types.Object) -> None:
    """Do the next actions of an animator, and the panel's queries."""
    for (path, _), fcurve in curves_of(obj).items():
        if path == "location" and len(fcurve.keyframe_points):
            fcurve.keyframe_points[-1].select_control_point = True
            fcurve.keyframe_points[-1].co_ui.y += 1.0
            fcurve.update()
    bpy.context.view_layer.update()
    obj.location.x += 1.0
    bpy.context.view_layer.update()
    for frame in (5, 30, 12):
        bpy.context.scene.frame_set(frame)
    assert set(modes_of(obj, np.array(FRAMES))) <= set(MODE_IDS)
    problem_of(obj)
    animation.refresh()


# Damage


def numbers(channel: tuple[str, int], field: str, value: float, *at: int) -> Damage:
    """Damage one number of these keys of a channel (all keys by default); nothing else is updated."""
    name, _, axis = field.partition(".")

    def damage(obj: bpy.types.Object) -> None:
        points = curves_of(obj)[channel].keyframe_points
        width, dtype = (2, np.float32) if axis else (1, np.int32 if name in ("interpolation", "easing") else np.float32)
        result = np.empty(width * len(points), dtype)
        points.foreach_get(name, result)
        result.reshape(-1, width)[list(at) or slice(None), int(axis == "y")] = value
        points.foreach_set(name, result)

    return damage


def everywhere(field: str, value: float, *at: int, paths: tuple[str, ...] = TRANSFORMS) -> Damage:
    """Damage the same number in all channels of these properties."""
    return each(*(numbers((path, index), field, value, *at) for path in paths for index in range(WIDTHS[path])))


def each(*damages: Damage) -> Damage:
    return lambda obj: [damage(obj) for damage in damages]


def marks(*of_keys: int) -> Damage:
    """Write these marks to the keys of all channels. Numbers above those of existing modes mean nothing."""
    return lambda obj: [write_marks(fcurve, np.array(of_keys)) for fcurve in curves_of(obj).values()]


def terms(change: Callable[[bpy.types.FCurve, bpy.types.FModifierGenerator], object]) -> Damage:
    """Change the terms of all channels, one after the other."""
    return lambda obj: [
        change(fcurve, term) for fcurve in curves_of(obj).values() for term in list(fcurve.modifiers) if is_term(term)
    ]


def called(name: str) -> Damage:
    def damage(obj: bpy.types.Object) -> None:
        obj.name = obj.animation_data.action.name = obj.animation_data.action_slot.name_display = name

    return damage


# What cannot move rigidly

NAMES = ('"', "\\", '["x"]', "a\nb", "\N{PILE OF POO}" * 15, "rigid_motion.mode")
FIELDS = ("co.x", "co.y", "handle_left.x", "handle_left.y", "handle_right.x", "handle_right.y")
LABELS = ((LOCATION_Y, "Location Y"), (TURN_W, "Quaternion Rotation W"), (("scale", 2), "Scale Z"))
NUMBERS: dict[str, tuple[Damage, str]] = {
    f"{value} in {field} of {label}, key {at}": (
        numbers(channel, field, -value if field.startswith("handle") else value, at),
        f"key {at + 1} of {label} has a",
    )
    for (field, value), (channel, label), at in zip(
        product(FIELDS, (NAN, INF)), cycle(LABELS), cycle(range(4)), strict=False
    )
}
"""NaN or infinity in each field, in one channel and key after the other."""

REFUSED: dict[str, tuple[Damage, str]] = {
    "a period that is not a number": (
        each(numbers(LOCATION_Y, "interpolation", ELASTIC), numbers(LOCATION_Y, "period", INF, 1)),
        "key 2 of Location Y has an invalid frame, value, handle or easing",
    ),
    "a last key far ahead": (numbers(LOCATION_Y, "co.x", 1e9, 3), "delete distant keys"),
    "keys out of order everywhere": (everywhere("co.x", 30.0, 1), "key 3 of Location X has a.*or move it and back"),
    "values at the end of numbers": (
        each(numbers(LOCATION_Y, "co.y", LARGEST, 0, 2), numbers(LOCATION_Y, "co.y", -LARGEST, 1, 3)),
        "key 1 of Location Y has an invalid frame.*: delete it",
    ),
    "a mode that there is not": (
        marks(3, 15, 3, 3),
        "keys have a mode that is unknown to this version: choose another",
    ),
    "a delta transform that is not a number": (
        lambda obj: setattr(obj, "delta_scale", (1.0, NAN, 1.0)),
        "delta transform is not a finite number: set it again",
    ),
    **{
        f"{name!r}": (each(called(name), numbers(LOCATION_Y, "co.y", NAN, 1)), "key 2 of Location Y has a")
        for name in NAMES
    },
}


@pytest.mark.parametrize("what", [*NUMBERS, *REFUSED])
def test_what_cannot_move_rigidly_keeps_blenders_motion_and_says_why(tmp_path, what):
    damage, reason = (NUMBERS | REFUSED)[what]
    make(damage, "BLENDER")
    broken, _ = reopened(tmp_path, followed=False)
    native, keys = shown_worlds([broken], SEEN)[0], repr(snapshot(broken))
    make(damage)
    broken, whole = reopened(tmp_path)
    assert re.match(f"{re.escape(broken.name)}.*{reason}", problem_of(broken)), problem_of(broken)
    assert repr(snapshot(broken)) == keys
    np.testing.assert_array_equal(shown_worlds([broken], SEEN)[0], native)
    assert_shown([whole], SEEN)
    use(broken)
    assert_shown([whole], SEEN)


def test_choosing_a_mode_mends_keys_with_one_that_there_is_not(tmp_path):
    make(marks(15, 15, 15, 15))
    broken, _ = reopened(tmp_path)
    assert problem_of(broken) != ""
    set_mode(broken, "pga_lerp")
    assert problem_of(broken) == ""
    assert_shown([broken], SEEN)


# What can be mended, or never mattered


def curves_that_mean_nothing(obj: bpy.types.Object) -> None:
    channelbag = channelbag_of(obj)
    for path, index in (("location", 7), ("]][[", 0), ("rigid_motion.nothing", 3), ('["\n"]', 2), ("scale", 90)):
        channelbag.fcurves.new(path, index=index).keyframe_points.insert(5.0, NAN)
    channelbag.fcurves.new("delta_rotation_euler", index=1)
    channelbag.fcurves.new("rigid_motion.turns", index=3)


MENDED: dict[str, Damage] = {
    "no terms": terms(lambda fcurve, term: fcurve.modifiers.remove(term)),
    "F-curves that mean nothing": curves_that_mean_nothing,
    "an interpolation that there is not": numbers(LOCATION_Y, "interpolation", 77, 1),
    "an easing that there is not": each(numbers(LOCATION_Y, "interpolation", 5), numbers(LOCATION_Y, "easing", 77, 1)),
    "a quaternion without length": everywhere("co.y", 0.0, 1, paths=TRANSFORMS[1:2]),
    "no quaternion with a length": everywhere("co.y", 0.0, paths=TRANSFORMS[1:2]),
    "a scale of zero": everywhere("co.y", 0.0, 1, paths=TRANSFORMS[2:]),
    "no scale but zero": everywhere("co.y", 0.0, paths=TRANSFORMS[2:]),
    "handles far off": each(
        numbers(LOCATION_Y, "handle_right.x", 1e9, 0), numbers(LOCATION_Y, "handle_left.x", -1e9, 1)
    ),
    "no layer": lambda obj: obj.animation_data.action.layers.remove(obj.animation_data.action.layers[0]),
    "no slot": lambda obj: obj.animation_data.action.slots.remove(obj.animation_data.action_slot),
    "no Action": lambda obj: bpy.data.actions.remove(obj.animation_data.action),
    **{f"{name!r}": called(name) for name in NAMES},
}
LATER: dict[str, Damage] = {
    "terms that are no numbers": terms(lambda _, term: setattr(term, "coefficients", [*term.coefficients[:-1], NAN])),
    "terms at the wrong time": terms(lambda _, term: setattr(term, "frame_end", 1e6)),
    "terms of a range that is none": terms(lambda _, term: setattr(term, "frame_end", NAN)),
}
"""Damage without visible effect before the next edit of a key."""


@pytest.mark.parametrize("what", [*MENDED, *LATER])
def test_what_can_be_mended_moves_rigidly(tmp_path, what):
    make((MENDED | LATER)[what])
    objects = reopened(tmp_path)
    assert [problem_of(obj) for obj in objects] == ["", ""]
    if what in MENDED:
        assert_shown(objects, SEEN)
    use(objects[0])
    assert_shown(objects, SEEN)


# Too much


def test_three_hundred_thousand_keys_are_refused_soon(tmp_path):
    def damage(obj: bpy.types.Object) -> None:
        points, frames = curves_of(obj)[LOCATION_Y].keyframe_points, 1.0 + np.arange(3e5)
        points.clear()
        points.add(len(frames))
        points.foreach_set("co", np.stack((frames, np.sin(0.01 * frames)), axis=1).astype(np.float32).ravel())
        # Blender itself is slow if interpolations differ.
        points.foreach_set("interpolation", np.ones(len(frames), np.int32))

    make(damage)
    broken, whole = reopened(tmp_path)
    assert problem_of(broken).startswith("Broken needs in-betweens on 299999 frames, and 250000 is the limit: ")
    assert not any(is_term(item) for fcurve in curves_of(broken).values() for item in fcurve.modifiers)
    assert_shown([whole], SEEN)
    use(broken)
