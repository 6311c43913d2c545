"""Offset layers: the displayed pose is the motion below times the offset, and merging keeps it within the tolerance."""

from __future__ import annotations

import itertools
from functools import partial

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import Refused, add_layer, key_frames, merge_layer, modes_of, radius_of, write_channel
from tests.animation.body_oracle import channels
from tests.animation.bones.rigs import in_turn, new_rig
from tests.animation.keyed import MODE_IDS, curves_of
from tests.animation.layered import (
    FRAMES,
    KEYS,
    KINDS,
    OFFSET_KEYS,
    key_base,
    key_influence,
    key_offset,
    new,
    offsets,
    seen,
)
from tests.animation.scenes import key, new_object, push_down, put_into_library
from tests.balls import displaced

PRECISION = 1e-5
QUATERNION_PRECISION = 1e-3
"""Blender computes the power of a strip's quaternion by an arc cosine in single precision, which resolves no angle
below 0.04 degrees.
"""

WHOLE = np.arange(1.0, 41.0)
EIGHTHS = np.arange(1.0, 40.01, 0.125)


def layers_of(carrier):
    return carrier.id_data.animation_data.nla_tracks


def update(_=None):
    bpy.context.view_layer.update()


def give_layer(carrier, mode="BLENDER", **how):
    add_layer(carrier)
    key_offset(carrier, mode, **how)
    update()


def merge_unseen(*carriers, tolerance):
    """Merge the layer of the last of them, and check that all stay within the tolerance on frames."""
    expected = [seen(carrier, WHOLE) for carrier in carriers]
    merged = merge_layer(carriers[-1], tolerance)
    for carrier, before in zip(carriers, expected, strict=True):
        assert displaced(seen(carrier, WHOLE), before, radius_of(carrier)).max() < tolerance + 1e-4
    return merged


MODES = [*zip(MODE_IDS, (*MODE_IDS[3:], *MODE_IDS[:3]), strict=True)]
ORDERS = ("QUATERNION", "XYZ", "ZXY", "YZX")


@pytest.mark.parametrize(("kind", "how"), in_turn(KINDS, [*zip(MODES, itertools.cycle(ORDERS), strict=False)]))
def test_the_motion_below_times_the_offset_to_the_power_of_the_influence_is_seen_and_merged(live_file, kind, how):
    """Merged keys are within the tolerance on frames."""
    (below, above), order = how
    carrier = key_base(new(kind, order), below)
    names = {*bpy.data.objects.keys()}, {*bpy.data.actions.keys()}
    before, action, radius = seen(carrier), carrier.id_data.animation_data.action, radius_of(carrier)
    add_layer(carrier)
    assert np.abs(seen(carrier) - before).max() < PRECISION, "a layer at rest moves nothing"
    key_offset(carrier, above)
    key_influence(carrier.id_data, (1.0, 1.0), (20.0, 0.3), (40.0, 0.8))
    update()
    expected = before @ offsets(carrier)
    assert np.abs(expected - before).max() > 0.05
    error = np.abs(seen(carrier) - expected).max()
    assert error < (QUATERNION_PRECISION if order == "QUATERNION" else PRECISION)
    between = seen(carrier, EIGHTHS)
    merged = merge_unseen(carrier, tolerance=0.005)
    off = displaced(seen(carrier, EIGHTHS), between, radius).max()
    assert off < max(0.005, 2.0 * merged.between) + 1e-4
    assert {*bpy.data.objects.keys()} == names[0], "the Empty is gone"
    assert {*bpy.data.actions.keys()} == names[1], "and the Action of the layer"
    assert carrier.id_data.animation_data.action == action
    assert not len(layers_of(carrier))
    assert not len(carrier.constraints)
    assert {*KEYS, *OFFSET_KEYS} <= {*key_frames(carrier).tolist()}
    assert np.all(key_frames(carrier) % 1.0 == 0.0)
    assert len(key_frames(carrier)) == merged.after


@pytest.mark.parametrize(("kind", "mode"), in_turn(["object", "child", "bone"], MODE_IDS))
def test_a_layer_at_rest_is_merged_into_the_keys_and_modes_that_there_were(live_file, kind, mode):
    carrier = key_base(new(kind, "QUATERNION"), mode)
    before, keys = seen(carrier), {place: curve.range()[:] for place, curve in curves_of(carrier).items()}
    add_layer(carrier)
    merged = merge_layer(carrier, 0.001)
    assert (merged.before, merged.after) == (len(KEYS), len(KEYS))
    assert key_frames(carrier).tolist() == [*KEYS]
    assert modes_of(carrier, key_frames(carrier)) == [mode] * len(KEYS)
    assert {place: curve.range()[:] for place, curve in curves_of(carrier).items()} == keys
    assert displaced(seen(carrier), before, radius_of(carrier)).max() < 0.001


def test_where_a_layer_leaves_the_motion_its_modes_stay_and_there_are_curves_elsewhere(live_file):
    tool = key_base(new("object", "XYZ"), "dq_sclerp")
    before = seen(tool, EIGHTHS)
    give_layer(tool, frames=(24.0, 30.0, 40.0), size=0.5)
    merge_layer(tool, 0.002)
    modes = dict(zip(key_frames(tool).tolist(), modes_of(tool, key_frames(tool)), strict=True))
    assert [frame for frame in modes if frame < 24.0] == [1.0, 11.0]
    assert modes[1.0] == modes[11.0] == "dq_sclerp"
    assert displaced(seen(tool, EIGHTHS), before, 1.0)[EIGHTHS <= 24.0].max() < 1e-4
    assert "BLENDER" in {mode for frame, mode in modes.items() if frame > 24.0}


def test_bones_share_a_layer_and_all_else_of_the_rig_plays_on(live_file):
    rig = new_rig("Rig")
    for bone in rig.pose.bones:
        key_base(bone, "dq_sclerp")
    rig["glow"] = 0.0
    write_channel(rig, '["glow"]', WHOLE[[0, -1]], np.array((0.0, 1.0)))
    poses = {bone.name: seen(bone) for bone in rig.pose.bones}
    bpy.context.scene.frame_set(1)
    add_layer([rig.pose.bones["Upper"]])
    add_layer([rig.pose.bones["Hand"], rig.pose.bones["Lower"]])
    assert len(layers_of(rig)) == 2
    for name in ("Upper", "Hand", "Lower"):
        key_offset(rig.pose.bones[name], "motor_spline")
    update()
    for bone in rig.pose.bones:
        added = offsets(bone) if bone.name != "Body" else np.eye(4)
        assert np.abs(seen(bone) - poses[bone.name] @ added).max() < QUATERNION_PRECISION
    bpy.context.scene.frame_set(40)
    assert rig["glow"] == 1.0
    merge_unseen(*rig.pose.bones, tolerance=0.005)
    assert not len(layers_of(rig))
    assert not any(len(bone.constraints) for bone in rig.pose.bones)
    bpy.context.scene.frame_set(40)
    assert rig["glow"] == 1.0
    assert key_frames(rig.pose.bones["Body"]).tolist() == [*KEYS]


def test_scale_stays_with_what_is_seen_or_goes_along_where_it_is_keyed_evenly(live_file):
    for how in (None, "even", "uneven"):
        tool = key_base(new_object(f"Tool {how}"), "cga_slerp", scale=how)
        if how is None:
            tool.scale = 1.0, 2.0, 0.5
        scale = np.array([np.diag((*values, 1.0)) for values in channels(tool, "scale", FRAMES)])
        before = seen(tool)
        give_layer(tool, "dq_sclerp")
        added = offsets(tool)
        expected = before @ added if how == "even" else before @ np.linalg.inv(scale) @ added @ scale
        assert np.abs(seen(tool) - expected).max() < 10.0 * QUATERNION_PRECISION
        merge_unseen(tool, tolerance=0.005)


def repeating():
    tool = key_base(new("object", "XYZ"), "dq_sclerp", (1.0, 6.0, 11.0))
    animation.repeat(tool, "REPEAT")
    bpy.context.scene.frame_end = 40
    return tool


def stepped():
    return key_base(new("object", "QUATERNION"), "BLENDER", interpolation="CONSTANT")


@pytest.mark.parametrize("make", [repeating, stepped])
def test_a_base_that_repeats_is_merged_over_the_scene_and_one_that_steps_on_frames(live_file, make):
    tool = make()
    give_layer(tool)
    merge_unseen(tool, tolerance=0.002)
    assert not any(modifier.type == "CYCLES" for curve in curves_of(tool).values() for modifier in curve.modifiers)


def snapshot():
    return (
        sorted(bpy.data.objects.keys()),
        sorted(bpy.data.actions.keys()),
        [(obj.name, obj.parent, obj.animation_data and len(obj.animation_data.nla_tracks)) for obj in bpy.data.objects],
    )


def shared(tool):
    other = new_object("Other")
    other.animation_data_create().action = tool.animation_data.action
    other.animation_data.action_slot = tool.animation_data.action_slot


NOT_IN_LAYERS = (
    add_layer,
    partial(animation.hold_in, holder=None),
    animation.bake,
    animation.unbake,
    animation.reduce_keys_of,
    animation.clean_motion,
)
"""What is not done to something that has a layer."""


def on_vertices(tool):
    tool.parent, tool.parent_type = new_object("Mesh", data=bpy.data.meshes.new("Mesh")), "VERTEX"


def test_a_layer_with_keys_of_what_has_no_base_is_not_merged(live_file):
    rig = new_rig("Rig")
    for bone in rig.pose.bones:
        key(bone)
    bpy.context.scene.frame_set(1)
    add_layer(rig.pose.bones["Hand"])
    rig.pose.bones["Body"].keyframe_insert("location", frame=5)
    with pytest.raises(Refused, match="Body"):
        merge_layer(rig)
    add_layer(rig.pose.bones["Body"])
    assert merge_layer(rig).after


def with_a_copy(tool):
    add_layer(tool)
    bpy.context.scene.collection.objects.link(tool.copy())


def with_an_action_on_top(tool):
    add_layer(tool)
    tool.animation_data.use_tweak_mode = False
    tool.keyframe_insert("location", frame=5)


def tool_with(spoil):
    """Return a function that makes a keyed object and spoils it."""

    def make():
        spoil(tool := key(new_object("Tool")))
        return tool

    return make


@pytest.mark.parametrize(
    ("make", "act", "reason"),
    [
        (tool_with(lambda tool: animation.hold_in(tool, new_object("Hand"))), add_layer, "held"),
        (tool_with(lambda tool: tool.constraints.new("TRACK_TO")), add_layer, "constraint"),
        (tool_with(lambda tool: setattr(tool, "delta_location", (1.0, 0.0, 0.0))), add_layer, "delta transforms"),
        (tool_with(lambda tool: tool.driver_add("location", 0)), add_layer, "driven"),
        (tool_with(shared), add_layer, "shares its Action"),
        (tool_with(push_down), add_layer, "enter a strip"),
        (tool_with(on_vertices), add_layer, "vertices"),
        (lambda: put_into_library(key(new_object("Tool"))), add_layer, "linked"),
        (lambda: key(new_rig("Rig", use_inherit_rotation=False).pose.bones["Hand"]), add_layer, "Inherit Rotation"),
        (tool_with(update), merge_layer, "no layer alone"),
        (tool_with(add_layer), partial(merge_layer, tolerance=0.0), "tolerance"),
        (tool_with(with_a_copy), merge_layer, "Single User"),
        (tool_with(with_an_action_on_top), merge_layer, "on top"),
        *((tool_with(add_layer), act, "merge it first") for act in NOT_IN_LAYERS),
    ],
)
def test_what_cannot_be_done_to_layers_says_why_and_changes_nothing(live_file, make, act, reason):
    target = make()
    update()
    before = snapshot()
    with pytest.raises(Refused, match=reason):
        act(target)
    assert snapshot() == before
