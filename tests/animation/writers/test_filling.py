"""In-betweens in delta transforms, beside what the animator has there."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation import problem_of, refresh, set_mode
from tests.animation.keyed import curves_of, snapshot
from tests.animation.scenes import key, new_object


def delta_keys(obj: bpy.types.Object, path: str) -> list[list[tuple[float, ...]]]:
    return [
        [tuple(point.co) for point in fcurve.keyframe_points]
        for (own, _), fcurve in curves_of(obj).items()
        if own == path and len(fcurve.keyframe_points)
    ]


@pytest.mark.parametrize(("path", "in_the_way"), [("delta_scale", True), ("delta_rotation_euler", False)])
def test_delta_transforms_that_the_animator_keys_later_stay(live_file, path, in_the_way):
    obj = key(new_object())
    set_mode(obj, "dq_sclerp")
    setattr(obj, path, (1.0, 2.0, 3.0))
    for frame in (5, 20):
        obj.keyframe_insert(path, frame=frame)
        bpy.context.view_layer.update()
    keyed, keys = delta_keys(obj, path), snapshot(obj)
    assert keyed == [[(5.0, value), (20.0, value)] for value in (1.0, 2.0, 3.0)]
    assert (f"{obj.name}: Delta Scale X is animated already" in problem_of(obj)) is in_the_way
    refresh()
    fcurve = curves_of(obj)["location", 0]
    fcurve.keyframe_points[1].co_ui.y += 1.0
    fcurve.update()
    bpy.context.view_layer.update()
    set_mode(obj, "BLENDER")
    assert delta_keys(obj, path) == keyed
    assert set(snapshot(obj)) == set(keys)
