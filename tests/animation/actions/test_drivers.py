"""Drivers keep their channels, muted or sampled channels are left alone, and all other channels keep their mode."""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, channelbag_of, problem_of, set_mode
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, snapshot
from tests.animation.modified import is_term
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object

FRAMES = np.arange(1.0, 41.0)
PARTS = ("location", "rotation_euler", "scale")


def drive(obj, path: str, index: int) -> None:
    obj.driver_add(path, index).driver.expression = "0.1 * frame"


SILENT = {
    "driven": drive,
    "muted": lambda obj, *channel: setattr(curves_of(obj)[channel], "mute", True),
    "sampled": lambda obj, *channel: curves_of(obj)[channel].convert_to_samples(1, 41),
}


def shown(obj) -> np.ndarray:
    """Return location, angles and scale on each frame, shape (m, 3, 3)."""
    result = []
    for frame in FRAMES.tolist():
        bpy.context.scene.frame_set(int(frame))
        result.append([tuple(getattr(obj, path)) for path in PARTS])
    return np.array(result)


@pytest.mark.parametrize(
    ("case", "when"),
    in_turn(
        itertools.product(SILENT, [("location", 2), ("rotation_euler", 1), ("scale", 1)]),
        [(False, "dq_sclerp"), (True, "cga_lerp"), (False, "motor_spline"), (True, "dq_sclerp")],
    ),
)
def test_what_is_left_alone_is_blenders_and_the_rest_moves_as_if_it_were_still(live_file, case, when):
    """A constant added to a coordinate shifts the whole path. The other channels cannot know that constant."""
    (how, (path, index)), (is_later, mode) = case, when
    obj, still = (key(new_object(name, "XYZ"), scale="even") for name in ("Tool", "Still"))
    for (name, row), fcurve in curves_of(still).items():
        if name == path and (row == index or path != "location"):
            channelbag_of(still).fcurves.remove(fcurve)
    set_mode(still, mode)
    if is_later:
        set_mode(obj, mode)
    SILENT[how](obj, path, index)
    bpy.context.view_layer.update()
    set_mode(obj, mode)
    now, then = shown(obj), shown(still)
    filled = {channel for channel, fcurve in curves_of(obj).items() if any(map(is_term, fcurve.modifiers))}
    assert problem_of(obj) == ""
    set_mode(obj, "BLENDER")
    left = [index] if path == "location" else [0, 1, 2]
    part = PARTS.index(path)
    then[:, part, left] = shown(obj)[:, part, left]
    np.testing.assert_allclose(now, then, atol=1e-5)
    assert {row for name, row in filled if name == "location"} == {0, 1, 2} - set(left if path == "location" else ())


def test_its_motion_is_baked_and_the_driver_stays(live_file):
    obj = key(new_object())
    drive(obj, "location", 2)
    set_mode(obj, "dq_sclerp")
    before, keyed = shown_worlds([obj], FRAMES)[0], snapshot(obj)["location", 2]
    bake(obj)
    assert snapshot(obj)["location", 2] == keyed
    assert np.abs(shown_worlds([obj], FRAMES)[0] - before).max() < 1e-5
    assert len(obj.animation_data.drivers) == 1
