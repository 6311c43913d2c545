"""A driver has its channel; what it does not move keeps its mode."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, problem_of, set_mode
from tests.animation.keyed import curves_of, snapshot
from tests.animation.modified import is_term
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
    for frame in (17, 33):
        bpy.context.scene.frame_set(frame)
        for name in ("location", "rotation_euler", "scale"):
            if name != path:
                assert tuple(getattr(obj, name)) == pytest.approx(tuple(getattr(other, name)), abs=1e-5)
    with_modes = {name for (name, _), fcurve in curves_of(obj).items() if fcurve.modifiers}
    assert "location" in with_modes, "there is a mode in it"
    assert path not in with_modes
    assert problem_of(obj) == ""


@pytest.mark.parametrize(("path", "index"), [("location", 2), ("rotation_euler", 1)])
def test_a_muted_channel_is_left_alone_and_takes_all_of_a_rotation_to_blender(live_file, path, index):
    obj, other = (key(new_object(name, "XYZ")) for name in ("Tool", "Other"))
    curves_of(obj)[path, index].mute = True
    obj.location[2] = 3.0
    for (name, row), fcurve in curves_of(other).items():
        if name == path and (row == index or path != "location"):
            for point in fcurve.keyframe_points:
                point.co_ui.y = obj.location[2] if path == "location" else 0.0
            fcurve.update()
    native = shown(obj)
    for carrier in (obj, other):
        set_mode(carrier, "dq_sclerp")
    filled = {name for name, fcurve in curves_of(obj).items() if any(map(is_term, fcurve.modifiers))}
    axes = (0, 1) if path == "location" else (0, 1, 2)
    assert {row for name, row in filled if name == "location"} == set(axes)
    assert path == "location" or not {name for name in filled if name[0] == path}
    now, then = shown(obj), shown(other)
    np.testing.assert_allclose(now[:, axes, 3], then[:, axes, 3], atol=1e-5)
    turned = then if path == "location" else native
    np.testing.assert_allclose(now[:, :3, :3], turned[:, :3, :3], atol=1e-5)


def test_its_motion_is_baked_and_the_driver_stays(live_file):
    obj = key(new_object())
    drive(obj, "location", 2)
    set_mode(obj, "dq_sclerp")
    before, keyed = shown(obj), snapshot(obj)["location", 2]
    bake(obj)
    assert snapshot(obj)["location", 2] == keyed
    assert np.abs(shown(obj) - before).max() < 1e-5
    assert len(obj.animation_data.drivers) == 1
