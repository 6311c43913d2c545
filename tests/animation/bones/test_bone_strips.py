"""Actions of rigs in NLA strips: each bone shows its mode, however its strip is placed, scaled, repeated and turned."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from tests.animation.bones.poses import Poses, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import ORDERS, in_turn, key_all, moving_rig, new_rig
from tests.animation.scenes import push_down

KEYS = (1.0, 11.0, 21.0, 41.0)
FRAMES = np.append(np.arange(1.0, 41.0, 0.375), 41.0)


def assert_at(rig: bpy.types.Object, scene_frames: np.ndarray, expected: Poses) -> None:
    (shown,) = shown_poses([rig], scene_frames)
    assert_same_poses(rig, scene_frames, shown, expected)


PLACES = [
    *((1, 1.0, 1.0, False), (101, 1.0, 1.0, False), (31, 4.0, 1.0, False), (7, 0.5, 1.0, False)),
    *((-57, 1.0, 1.0, False), (11, 1.0, 2.5, False), (11, 2.0, 3.0, False), (21, 1.0, 1.0, True), (21, 0.5, 2.0, True)),
]
"""Where a strip starts, how it is scaled, how often it repeats, and whether it runs backwards."""


@pytest.mark.parametrize(("place", "order"), in_turn(PLACES, ORDERS))
def test_a_strip_shows_the_modes_of_its_action(live_file, place, order):
    start, scale, repeat, reverse = place
    rig = moving_rig("dq_sclerp", order, frames=KEYS)
    strip = push_down(rig, start, scale=scale, repeat=repeat, use_reverse=reverse)
    since = np.arange(0.125, 40.0 * repeat, 0.375)
    # On a seam a strip may be on the first frame or on the last.
    since = since[since % 40.0 > 0.0]
    frames, since = start + scale * since, since % 40.0
    action_frames = 1.0 + (40.0 - since if reverse else since)
    rising, places = np.unique(action_frames, return_inverse=True)
    data = rig.animation_data
    data.action, data.action_slot = strip.action, strip.action_slot
    expected = {name: poses[places] for name, poses in expected_poses(rig, rising).items()}
    data.action = None
    bpy.context.view_layer.update()
    assert_at(rig, frames, expected)


@pytest.mark.parametrize("order", ["QUATERNION", "ZYX"])
@pytest.mark.parametrize("one_track", [True, False], ids=["one track", "two tracks"])
@pytest.mark.parametrize("modes", [("dq_sclerp", "pga_lerp"), ("BLENDER", "motor_spline")])
def test_two_strips_each_have_the_mode_that_is_keyed_in_their_action(live_file, modes, one_track, order):
    rig = new_rig(rotation_mode=order)
    data, made = rig.animation_data_create(), []
    for seed, mode in enumerate(modes):
        data.action = None
        key_all(rig, KEYS, seed=seed)
        set_mode(list(rig.pose.bones), mode)
        made.append((data.action, data.action_slot, expected_poses(rig, FRAMES)))
    data.action = None
    track = data.nla_tracks.new()
    for start, (action, slot, _) in zip((1, 101), made, strict=True):
        strip = (track if one_track else data.nla_tracks.new()).strips.new("Strip", start, action)
        strip.action_slot, strip.extrapolation = slot, "HOLD_FORWARD" if start > 1 else "HOLD"
    bpy.context.view_layer.update()
    assert refresh() == 0
    for start, (_, _, poses) in zip((1, 101), made, strict=True):
        assert_at(rig, FRAMES + start - 1, poses)
    assert_at(rig, np.array((60.0, 90.0)), {name: rows[[-1, -1]] for name, rows in made[0][2].items()})
