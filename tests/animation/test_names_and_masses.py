"""Files with odd names, with a million keys, frames or modes: in-betweens are right, or refused soon."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import problem_of
from tests.animation.hostile import (
    LOCATION_Y,
    NAN,
    SEEN,
    TRANSFORMS,
    Damage,
    make,
    numbers,
    reopened,
    soon,
    use,
)
from tests.animation.keyed import WIDTHS, curves_of
from tests.animation.oracle import assert_shown
from tests.thoroughness import sample

pytestmark = pytest.mark.usefixtures("following")

# Names


@pytest.mark.parametrize(
    "name",
    sample(
        [
            *(
                '"',
                "'",
                "\\",
                "]",
                '["x"]',
                "a\nb",
                "\t",
                " ",
                "%s{0}",
                "../..",
                "\N{PILE OF POO}" * 15,
                "x" * 63,
                "\u202e",
            ),
            *("Ä" * 31, "OBBroken", "rigid_motion.mode", "\x7f\x01"),
        ]
    ),
    ids=repr,
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


# Masses


def keys_on(frames: np.ndarray, *channels: tuple[str, int]) -> Damage:
    """Very many keys: Blender itself takes its time where they are not all alike."""

    def damage(obj: bpy.types.Object) -> None:
        for (path, index), fcurve in curves_of(obj).items():
            if (path, index) in (channels or [(path, index) for path in TRANSFORMS for index in range(WIDTHS[path])]):
                points = fcurve.keyframe_points
                points.clear()
                points.add(len(frames))
                values = np.sin(frames * 0.01 + index) + 1.5
                points.foreach_set("co", np.stack((frames, values), axis=1).astype(np.float32).ravel())
                points.foreach_set("interpolation", np.ones(len(frames), np.int32))

    return damage


MILLION = np.arange(1e6)


def test_a_million_keys_in_a_few_frames_are_taken_as_they_are(tmp_path):
    make(keys_on(1.0 + MILLION * 39e-6, LOCATION_Y))
    objects = reopened(tmp_path)
    with soon():
        assert problem_of(objects[0]) == ""
    assert_shown(objects[1:], SEEN)
    use(objects[0])


def test_keys_over_a_million_frames_are_too_many(tmp_path):
    make(keys_on(MILLION, LOCATION_Y))
    broken, whole = reopened(tmp_path)
    with soon():
        assert problem_of(broken).startswith("Broken has keys over 999999 frames, at most 250000 can be filled in")
    assert not [path for path, _ in curves_of(broken) if path.startswith("delta_")]
    assert_shown([whole], SEEN)
    use(broken)


def test_a_motion_that_goes_on_for_a_million_frames_is_too_long(tmp_path):
    def damage(obj: bpy.types.Object) -> None:
        bpy.context.scene.frame_end = 1_000_000
        for fcurve in curves_of(obj).values():
            fcurve.extrapolation = "LINEAR"

    make(damage)
    broken, whole = reopened(tmp_path)
    assert problem_of(broken).startswith("Broken goes on outside of its keys")
    assert_shown([whole], SEEN)
    use(broken)


@pytest.mark.parametrize("frames", [1e-3, 0.02, 1.0])
def test_a_cycle_of_next_to_no_time_ends(tmp_path, frames):
    def damage(obj: bpy.types.Object) -> None:
        bpy.context.scene.frame_end = 50_000
        keys_on(1.0 + frames * np.arange(4) / 3.0)(obj)
        for (path, _), fcurve in curves_of(obj).items():
            if path in TRANSFORMS:
                fcurve.modifiers.new("CYCLES")

    make(damage)
    broken, whole = reopened(tmp_path)
    with soon():
        assert problem_of(broken) == "" or problem_of(broken).startswith("Broken")
    assert_shown([whole], SEEN)
    use(broken)
