"""Keys as data: their bytes for a digest, and the codes of Blender that runs."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation.curves.evaluation import evaluate
from rigid_motion.animation.curves.keys import EASINGS, INTERPOLATIONS
from tests.animation.curves.examples import as_fcurve, evaluate_one, joined, keys_of, read_one

EDITS: dict[str, Callable[[bpy.types.FCurve], None]] = {
    "frame": lambda fcurve: setattr(fcurve.keyframe_points[1].co, "x", 6.0),
    "value": lambda fcurve: setattr(fcurve.keyframe_points[1].co, "y", 6.0),
    "left handle": lambda fcurve: setattr(fcurve.keyframe_points[1].handle_left, "y", 6.0),
    "right handle": lambda fcurve: setattr(fcurve.keyframe_points[0].handle_right, "x", 3.0),
    "interpolation": lambda fcurve: setattr(fcurve.keyframe_points[0], "interpolation", "CONSTANT"),
    "easing": lambda fcurve: setattr(fcurve.keyframe_points[2], "easing", "EASE_IN"),
    "amplitude": lambda fcurve: setattr(fcurve.keyframe_points[2], "amplitude", 6.0),
    "key": lambda fcurve: fcurve.keyframe_points.insert(7.0, 1.0),
    "extrapolation": lambda fcurve: setattr(fcurve, "extrapolation", "LINEAR"),
    "cycles": lambda fcurve: fcurve.modifiers.new("CYCLES"),
}


@pytest.mark.parametrize("edit", EDITS)
def test_every_edit_shows_in_the_raw_bytes(edit):
    keys = keys_of((1, 5, 9), (2, 3, 4), ("BEZIER", "LINEAR", "ELASTIC"))
    with as_fcurve(keys) as fcurve:
        before = read_one(fcurve).raw
        fcurve.keyframe_points[0].select_control_point = True
        fcurve.select = True
        assert read_one(fcurve).raw == before
        EDITS[edit](fcurve)
        assert read_one(fcurve).raw != before


def test_the_keys_of_some_channels_have_the_values_that_those_had():
    easing = {"easing": np.zeros(2, np.int32), "easing_settings": ((1.7, 1.7), (0, 0), (0, 0))}
    channels = [keys_of((1, 9), (row, row + 2), kind, **easing) for row, kind in enumerate(("BACK", "LINEAR", "SINE"))]
    frames = np.arange(12.0)
    for rows in ([0], [2, 0], [1, 2]):
        (result,) = evaluate([joined(channels).only(rows)], [frames])
        np.testing.assert_array_equal(result, [evaluate_one(channels[row], frames) for row in rows])


@pytest.mark.parametrize(("name", "codes"), [("interpolation", INTERPOLATIONS), ("easing", EASINGS)])
def test_codes_are_those_of_blender(name, codes):
    items = bpy.types.Keyframe.bl_rna.properties[name].enum_items
    assert codes == {item.value: item.identifier for item in items}
