"""Keys as data: their bytes for a digest, and the codes of Blender that runs."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import pytest

from rigid_motion.animation.curves.keys import EASINGS, INTERPOLATIONS
from tests.animation.curves.examples import as_fcurve, keys_of, read_one

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


@pytest.mark.parametrize(("name", "codes"), [("interpolation", INTERPOLATIONS), ("easing", EASINGS)])
def test_codes_are_those_of_blender(name, codes):
    items = bpy.types.Keyframe.bl_rna.properties[name].enum_items
    assert codes == {item.value: item.identifier for item in items}
