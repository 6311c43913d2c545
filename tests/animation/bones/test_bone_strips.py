"""Actions of rigs in NLA strips: each bone shows its mode, however its strip is placed, scaled, repeated and mixed.

In-betweens are exact on the whole frames of the Action, so strips are looked at where they show those.
"""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import refresh, set_mode
from tests.animation.bones.poses import assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import ORDERS, in_turn, key_all, moving_rig, new_rig
from tests.animation.scenes import new_strip, push_down

KEYS = (1.0, 11.0, 21.0, 41.0)
ACTION_FRAMES = np.arange(1.0, 42.0)

Poses = dict[str, np.ndarray]


def rows(poses: Poses, which: np.ndarray | slice) -> Poses:
    return {name: matrices[which] for name, matrices in poses.items()}


def assert_at(rig: bpy.types.Object, scene_frames: np.ndarray, expected: Poses) -> None:
    (shown,) = shown_poses([rig], scene_frames)
    assert_same_poses(rig, scene_frames, shown, expected)


def filled(mode: str = "dq_sclerp", order: str = "QUATERNION", **settings: object) -> tuple[bpy.types.Object, Poses]:
    """A rig whose bones have a mode, and where they have to be on each frame of their Action."""
    rig = moving_rig(mode, order, frames=KEYS, **settings)
    return rig, expected_poses(rig, ACTION_FRAMES)


PLACES = [
    *((1, 1.0, 1.0, False), (101, 1.0, 1.0, False), (31, 2.0, 1.0, False), (7, 0.5, 1.0, False)),
    *((-57, 1.0, 1.0, False), (11, 1.0, 2.5, False), (11, 2.0, 3.0, False), (21, 1.0, 1.0, True), (21, 0.5, 2.0, True)),
]
"""Where a strip starts, how it is scaled, how often it repeats, and whether it runs backwards."""


@pytest.mark.parametrize(("place", "order"), in_turn(PLACES, ORDERS))
def test_a_strip_shows_the_modes_of_its_action(live_file, place, order):
    start, scale, repeat, reverse = place
    rig, expected = filled(order=order)
    strip = push_down(rig, start, scale=scale, repeat=repeat, use_reverse=reverse)
    frames = np.arange(strip.frame_start, strip.frame_end)
    since = ((frames - start) / scale) % 40.0
    # On a seam a reversed strip may be on the first frame or on the last.
    whole = (since % 1.0 == 0.0) & ((since > 0.0) | (not reverse))
    assert whole.sum() >= 19
    action_frames = since[whole].astype(int)
    assert_at(rig, frames[whole], rows(expected, 40 - action_frames if reverse else action_frames))


def several(
    *modes: str, order: str = "QUATERNION"
) -> tuple[bpy.types.Object, list[tuple[bpy.types.Action, bpy.types.ActionSlot]], list[Poses]]:
    """A rig, an Action for each of these modes with its slot, and where the bones have to be in each."""
    rig, actions, expected = new_rig(rotation_mode=order), [], []
    data = rig.animation_data_create()
    for seed, mode in enumerate(modes):
        data.action = None
        key_all(rig, KEYS, seed=seed)
        set_mode(list(rig.pose.bones), mode, KEYS)
        actions.append((data.action, data.action_slot))
        expected.append(expected_poses(rig, ACTION_FRAMES))
    data.action = None
    return rig, actions, expected


def put_into_strips(
    rig: bpy.types.Object,
    actions: list[tuple[bpy.types.Action, bpy.types.ActionSlot]],
    starts: tuple[float, ...],
    *,
    one_track: bool = False,
) -> list[bpy.types.NlaStrip]:
    data, strips = rig.animation_data_create(), []
    track = data.nla_tracks.new()
    for start, (action, slot) in zip(starts, actions, strict=True):
        strip = (track if one_track else data.nla_tracks.new()).strips.new("Strip", int(start), action)
        strip.action_slot, strip.extrapolation = slot, "HOLD_FORWARD" if start > 1 else "HOLD"
        strips.append(strip)
    bpy.context.view_layer.update()
    return strips


@pytest.mark.parametrize("order", ["QUATERNION", "ZYX"])
@pytest.mark.parametrize("one_track", [True, False], ids=["one track", "two tracks"])
@pytest.mark.parametrize("modes", [("dq_sclerp", "pga_lerp"), ("dq_sclerp", "BLENDER"), ("BLENDER", "motor_spline")])
def test_two_strips_each_have_the_mode_that_is_keyed_in_their_action(live_file, modes, one_track, order):
    rig, actions, expected = several(*modes, order=order)
    put_into_strips(rig, actions, (1, 101), one_track=one_track)
    assert refresh() == 0
    for start, poses in zip((1, 101), expected, strict=True):
        assert_at(rig, ACTION_FRAMES + start - 1, poses)
    assert_at(rig, np.array((60.0, 90.0)), rows(expected[0], np.array((-1, -1))))


@pytest.mark.parametrize("name", ["Before", "Zulu"])
def test_a_strip_beside_another_shows_the_action_that_a_rig_without_strips_plays(live_file, name):
    rig, expected = filled()
    rig.name = name
    walk = rig.animation_data
    other = moving_rig(name="Runner", seed=5, frames=KEYS)
    own = expected_poses(other, ACTION_FRAMES)
    push_down(other)
    new_strip(other, 100, walk.action, walk.action_slot, last=41)
    for track in other.animation_data.nla_tracks:
        track.strips[0].extrapolation = "NOTHING"
    bpy.context.view_layer.update()
    assert_at(other, ACTION_FRAMES + 99.0, expected)
    assert_at(other, ACTION_FRAMES, own)
    assert_at(rig, ACTION_FRAMES, expected)
    assert refresh() == 0
