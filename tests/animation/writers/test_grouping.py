"""Channels that are put into other groups, those of in-betweens among them: the motion stays live."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from tests.animation.bones.poses import assert_posed
from tests.animation.bones.rigs import moving_rig
from tests.animation.keyed import curves_of
from tests.animation.scenes import give_own_deltas, key, new_object, own_deltas

PLAYED = np.arange(-3.0, 46.0)


def channelbags(action: bpy.types.Action) -> list[bpy.types.ActionChannelbag]:
    return list(action.layers[0].strips[0].channelbags)


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
