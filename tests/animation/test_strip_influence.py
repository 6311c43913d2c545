"""A strip with less than full influence, or that blends in, shows what it would with the same keys baked."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import bake, set_mode
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import new_object, push_down

FRAMES = np.arange(5.0, 61.0)
POINTS = np.array(((0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 1.0), (0.0, 1.0, 0.0, 1.0), (0.0, 0.0, 1.0, 1.0))).T
ALIKE = 1e-4

How = Callable[[bpy.types.NlaStrip], None]


def animated(*points: tuple[float, float]) -> How:
    def animate(strip: bpy.types.NlaStrip) -> None:
        strip.use_animated_influence = True
        fcurve = strip.fcurves.find("influence")
        for point in list(fcurve.keyframe_points):
            fcurve.keyframe_points.remove(point)
        for point in points:
            fcurve.keyframe_points.insert(*point)
        fcurve.update()

    return animate


def blends(*, into: float = 0.0, out: float = 0.0) -> How:
    def blend(strip: bpy.types.NlaStrip) -> None:
        strip.use_auto_blend = False
        strip.blend_in, strip.blend_out = into, out

    return blend


INFLUENCES = {
    "half": animated((1.0, 0.5)),
    "animated": animated((10.0, 0.2), (45.0, 1.0)),
    "blending in": blends(into=20.0),
    "blending out": blends(out=15.0),
}


def keyed(obj: bpy.types.Object, *, scale: bool = False) -> bpy.types.Object:
    """Three keys, each turned by less than a quarter from the one before."""
    for number, frame in enumerate((1.0, 20.0, 41.0)):
        turned = Euler(np.array((0.5, -0.4, 0.9)) * number, "YXZ")
        obj.location = (2.0 * number, number * (1 - number), 0.5)
        if obj.rotation_mode == "QUATERNION":
            obj.rotation_quaternion = turned.to_quaternion()
        else:
            obj.rotation_euler = turned.to_quaternion().to_euler(obj.rotation_mode)
        obj.scale = (1.0 + 0.3 * number * scale,) * 3
        turns = "rotation_quaternion" if obj.rotation_mode == "QUATERNION" else "rotation_euler"
        for path in ("location", turns, *(("scale",) if scale else ())):
            obj.keyframe_insert(path, frame=frame)
    return obj


def played(order: str, mode: str, how: How | None, *, baked: bool, scale: bool = False) -> np.ndarray:
    """The four points of an object whose keys are in a strip from frame 10 on, shape (m, 3, 4)."""
    obj = keyed(new_object(f"Tool {baked}", order), scale=scale)
    set_mode(obj, mode)
    if baked:
        bake(obj)
    strip = push_down(obj, 10)
    if how is not None:
        how(strip)
    bpy.context.view_layer.update()
    return (shown_worlds([obj], FRAMES)[0] @ POINTS)[:, :3]


@pytest.mark.parametrize("how", INFLUENCES)
@pytest.mark.parametrize("order", ["QUATERNION", "XYZ", "ZXY"])
def test_it_shows_what_baked_keys_show(live_file, order, how):
    mode, scale = ("cga_slerp", True) if order == "QUATERNION" else ("dq_sclerp", False)
    live, baked = (played(order, mode, INFLUENCES[how], baked=baked, scale=scale) for baked in (False, True))
    assert np.abs(live - baked).max() < ALIKE


def test_a_change_of_the_influence_is_followed(live_file):
    baked = played("QUATERNION", "dq_sclerp", INFLUENCES["half"], baked=True)
    full = played("QUATERNION", "dq_sclerp", None, baked=False)
    obj = bpy.data.objects["Tool False"]
    (strip,) = obj.animation_data.nla_tracks[0].strips
    INFLUENCES["half"](strip)
    obj.update_tag()
    bpy.context.view_layer.update()
    assert np.abs((shown_worlds([obj], FRAMES)[0] @ POINTS)[:, :3] - baked).max() < ALIKE
    strip.use_animated_influence = False
    obj.update_tag()
    bpy.context.view_layer.update()
    assert np.abs((shown_worlds([obj], FRAMES)[0] @ POINTS)[:, :3] - full).max() < 1e-5
