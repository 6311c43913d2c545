"""A driver has its channel; what it does not move keeps its mode."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, problem_of, set_mode
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object

FRAMES = np.arange(1.0, 41.0)
MODES = ["dq_sclerp", "cga_lerp", "motor_spline"]


def drive(carrier, path: str, index: int) -> None:
    carrier.driver_add(path, index).driver.expression = "0.1 * frame"
    bpy.context.view_layer.update()


def shown(obj) -> np.ndarray:
    return shown_worlds([obj], FRAMES)[0]


@pytest.mark.parametrize("later", [False, True], ids=["before the mode", "after it"])
@pytest.mark.parametrize("mode", MODES)
def test_what_is_not_driven_moves_as_if_the_driven_coordinate_were_still(live_file, mode, later):
    """A constant added to a coordinate moves a whole path along: the others cannot know what it is."""
    obj, still = key(new_object()), key(new_object("Still"))
    still_z = curves_of(still)["location", 2]
    for point in still_z.keyframe_points:
        point.co_ui.y = 3.0
    still_z.update()
    set_mode(still, mode)
    if later:
        set_mode(obj, mode)
        drive(obj, "location", 2)
    else:
        drive(obj, "location", 2)
        set_mode(obj, mode)
    now, then = shown(obj), shown(still)
    np.testing.assert_allclose(now[:, 2, 3], 0.1 * FRAMES, atol=1e-5)
    then[:, 2, 3] = now[:, 2, 3]
    assert np.abs(now - then).max() < 1e-5
    assert problem_of(obj) == ""


@pytest.mark.parametrize(("path", "index"), [("rotation_euler", 2), ("scale", 1)])
def test_a_driven_angle_or_scale_takes_all_of_it_to_blender_and_the_rest_keeps_its_mode(live_file, path, index):
    obj, other = (key(new_object(name, "XYZ"), scale="even") for name in ("Tool", "Other"))
    drive(obj, path, index)
    set_mode(obj, "dq_sclerp")
    for fcurve in [c for (name, _), c in curves_of(other).items() if name == path]:
        fcurve.mute = True
    set_mode(other, "dq_sclerp")
    bpy.context.scene.frame_set(17)
    parts = [name for name in ("location", "rotation_euler", "scale") if name != path]
    for name in parts:
        delta = f"delta_{name}"
        np.testing.assert_allclose(getattr(obj, delta), getattr(other, delta), atol=1e-6)
    assert path not in {name.removeprefix("delta_") for name, _ in curves_of(obj) if name.startswith("delta_")}
    assert np.abs(obj.delta_location).max() > 1e-3, "there is a mode in it"
    assert problem_of(obj) == ""


def test_its_motion_is_baked_and_the_driver_stays(live_file):
    obj = key(new_object())
    drive(obj, "location", 2)
    set_mode(obj, "dq_sclerp")
    before, keyed = shown(obj), snapshot(obj)["location", 2]
    bake(obj)
    assert snapshot(obj)["location", 2] == keyed
    assert np.abs(shown(obj) - before).max() < 1e-5
    assert len(obj.animation_data.drivers) == 1
