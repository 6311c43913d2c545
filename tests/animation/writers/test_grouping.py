"""Channels that are put into other groups, those of in-betweens among them: the motion stays live."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import problem_of, refresh, set_mode
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rig_editing import channelbags
from tests.animation.bones.rigs import moving_rig
from tests.animation.keyed import curves_of, snapshot
from tests.animation.scenes import give_own_deltas, key, new_object, own_deltas

PLAYED = np.arange(-3.0, 46.0)


def group(action: bpy.types.Action) -> None:
    """Select all channels and press Ctrl G."""
    for channelbag in channelbags(action):
        mine = channelbag.groups.new("Mine")
        for fcurve in channelbag.fcurves:
            fcurve.group = mine


def ungroup(action: bpy.types.Action) -> None:
    """Select all channels and press Ctrl Alt G."""
    for channelbag in channelbags(action):
        for own in list(channelbag.groups):
            channelbag.groups.remove(own)


DEEDS = pytest.mark.parametrize("deed", [group, ungroup], ids=lambda deed: deed.__name__)


@DEEDS
def test_blenders_in_betweens_take_away_what_is_in_other_groups(live_file, deed: Callable):
    obj = new_object("Tool", "QUATERNION")
    own = give_own_deltas(obj)
    set_mode(key(obj), "dq_sclerp")
    deed(obj.animation_data.action)
    set_mode(obj, "BLENDER")
    bpy.context.view_layer.update()
    assert not any(path.startswith("delta_") for path, _ in curves_of(obj))
    assert own_deltas(obj) == own


@DEEDS
def test_bones_are_followed_whatever_group_their_channels_are_in(live_file, deed: Callable):
    rig = moving_rig()
    deed(rig.animation_data.action)
    curves_of(rig.pose.bones["Lower"])["location", 0].keyframe_points[1].co_ui.y += 1.0
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)
    set_mode(rig.pose.bones["Hand"], "pga_lerp")
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)
    assert refresh() == 0


def test_delta_transforms_that_the_animator_has_sampled_are_left_alone(live_file):
    obj = key(new_object("Tool", "QUATERNION"))
    obj.delta_location.x = 1.0
    obj.keyframe_insert("delta_location", index=0, frame=1)
    sampled = curves_of(obj)["delta_location", 0]
    sampled.convert_to_samples(1, 40)
    with pytest.raises(ValueError, match="animated already"):
        set_mode(obj, "dq_sclerp")
    assert len(curves_of(obj)["delta_location", 0].sampled_points) == 39


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
