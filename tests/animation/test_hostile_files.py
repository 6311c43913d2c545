"""Damaged and hostile files: nothing is raised out of a handler, what cannot move rigidly keeps Blender's own motion.

Files are damaged while edits are not followed, saved, and opened with the extension switched on. Beside the damaged
object there is always a whole one, which gets its in-betweens whatever is wrong with the other.
"""

from __future__ import annotations

import re

import bpy
import numpy as np
import pytest

from rigid_motion.animation import channelbag_of, problem_of, set_mode
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
    marks,
    numbers,
    reopened,
    soon,
    terms,
    use,
)
from tests.animation.keyed import WIDTHS, curves_of, snapshot
from tests.animation.modified import is_term
from tests.animation.oracle import assert_shown, shown_worlds
from tests.thoroughness import sample

pytestmark = pytest.mark.usefixtures("following")


def easing_setting(name: str, interpolation: str, value: float) -> Damage:
    code = bpy.types.Keyframe.bl_rna.properties["interpolation"].enum_items[interpolation].value
    return each(numbers(LOCATION_Y, "interpolation", code), numbers(LOCATION_Y, name, value, 1))


def nowhere(obj: bpy.types.Object) -> None:
    obj.delta_scale.y = NAN


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
    "a period that is no number": (easing_setting("period", "ELASTIC", INF), "easing of key 2 .* not a finite number"),
    "a last key far ahead": (numbers(LOCATION_Y, "co.x", 1e9, 3), "delete the keys that are far off"),
    "a last key at the end of numbers": (
        numbers(LOCATION_Y, "co.x", LARGEST, 3),
        "key 4 of Location Y has the frame 3.4.*no motion can be computed from: delete it",
    ),
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
    "a mode that there is not": (
        marks(3, 15, 3, 3),
        "keys have a mode that this version does not know: choose another",
    ),
    "a delta transform that is no number": (nowhere, "delta transform is not a finite number: set it anew"),
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


def test_choosing_a_mode_mends_keys_with_one_that_there_is_not(tmp_path):
    make(marks(15, 15, 15, 15))
    broken, _ = reopened(tmp_path)
    assert problem_of(broken) != ""
    set_mode(broken, "pga_lerp")
    assert problem_of(broken) == ""
    assert_shown([broken], SEEN)


# What can be mended, or never mattered


def without_terms(obj: bpy.types.Object) -> None:
    terms(lambda fcurve, term: fcurve.modifiers.remove(term))(obj)


def with_term(**settings: object) -> Damage:
    """The terms have other settings."""

    def change(_: bpy.types.FCurve, term: bpy.types.FModifierGenerator) -> None:
        for name, value in settings.items():
            setattr(term, name, value)

    return terms(change)


def doubled(fcurve: bpy.types.FCurve, term: bpy.types.FModifierGenerator) -> None:
    copy = fcurve.modifiers.new("GENERATOR")
    copy.mode, copy.poly_order = term.mode, term.poly_order
    for name in ("coefficients", "use_additive", "use_restricted_range", "frame_start", "frame_end", "influence"):
        setattr(copy, name, getattr(term, name))


def scaled(_: bpy.types.FCurve, term: bpy.types.FModifierGenerator) -> None:
    term.coefficients = [*term.coefficients[:-1], NAN]


def a_thousand_terms(obj: bpy.types.Object) -> None:
    fcurve = curves_of(obj)[LOCATION_Y]
    for _ in range(1000):
        doubled(fcurve, next(item for item in fcurve.modifiers if is_term(item)))


def curves_that_mean_nothing(obj: bpy.types.Object) -> None:
    channelbag = channelbag_of(obj)
    for path, index in (("location", 7), ("]][[", 0), ("rigid_motion.nothing", 3), ('["\n"]', 2), ("scale", 90)):
        channelbag.fcurves.new(path, index=index).keyframe_points.insert(5.0, NAN)
    channelbag.fcurves.new("delta_rotation_euler", index=1)
    channelbag.fcurves.new("rigid_motion.turns", index=3)


MENDED: dict[str, Damage] = {
    "no terms": without_terms,
    "terms twice": terms(doubled),
    "a thousand terms": a_thousand_terms,
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


LATER: dict[str, Damage] = {
    "terms that are no numbers": terms(scaled),
    "terms at the wrong time": with_term(frame_end=1e6),
    "terms of a range that is none": with_term(frame_end=NAN),
    "terms that are muted": with_term(mute=True),
    "terms in part": with_term(use_influence=True, influence=0.3),
    "terms that blend in": with_term(blend_in=4.0, blend_out=2.0),
}
"""What nobody sees before the next edit of a key."""


@pytest.mark.parametrize("what", [*MENDED, *LATER])
def test_what_can_be_mended_moves_rigidly(tmp_path, what):
    make((MENDED | LATER)[what])
    objects = reopened(tmp_path)
    assert [problem_of(obj) for obj in objects] == ["", ""]
    if what in MENDED:
        assert_shown(objects, SEEN)
    use(objects[0])
    assert_shown(objects, SEEN)


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
def test_without_keys_there_is_nothing_to_say(tmp_path, damage):
    make(damage)
    broken, whole = reopened(tmp_path)
    assert problem_of(broken) == ""
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


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        (over_a_million_frames, " has keys over 999999 frames, at most 250000 can be filled in"),
        (goes_on_for_a_million_frames, " goes on outside of its keys"),
    ],
)
def test_what_is_too_long_is_refused_soon(tmp_path, damage, reason):
    make(damage)
    broken, whole = reopened(tmp_path)
    with soon():
        assert re.match(f"Broken{reason}", problem_of(broken)), problem_of(broken)
    assert not any(is_term(item) for fcurve in curves_of(broken).values() for item in fcurve.modifiers)
    assert_shown([whole], SEEN)
    use(broken)
