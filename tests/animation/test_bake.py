"""Baking: baked poses are shown as before, with any modifiers or cycles, and Un-Bake restores all keys.

Poses are read back from the evaluated scene. Bones, Actions and names may change before Un-Bake.
"""

from __future__ import annotations

import json
import re
from functools import partial
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import (
    Refused,
    bake,
    bake_poses,
    bake_to_world,
    hold_in,
    is_baked,
    key_frames,
    reduce_keys_of,
    set_mode,
    unbake,
)
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import angle_between
from tests.animation.bones.poses import shown_of
from tests.animation.bones.rigs import PLAYED, in_turn, key_all, new_rig, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale
from tests.animation.held import KINDS, handled, holders_on, new_hands, new_prop, raise_keys, worlds
from tests.animation.keyed import Carrier, curves_of, snapshot
from tests.animation.oracle import assert_near
from tests.animation.scenes import FRAMES, editor, enabled, key, new_object, new_strip, push_down, tweak
from tests.motion.bodies import matrices

OF_BOTH = pytest.mark.parametrize("of_bones", [False, True], ids=["object", "bones"])


def moving(
    of_bones: bool, mode: str = "dq_sclerp", name: str = "Mover", order: str = "QUATERNION", **settings: object
) -> tuple[bpy.types.Object, list]:
    """Return a rig or an object, and its carriers with this mode. `settings` are those of `key` and `key_all`."""
    make, give = (new_rig, key_all) if of_bones else (new_object, key)
    obj = give(make(name, rotation_mode=order), **settings)
    targets = list(obj.pose.bones) if of_bones else [obj]
    set_mode(targets, mode)
    return obj, targets


def motion() -> tuple[np.ndarray, Poses]:
    """Return frames and wild poses. Every second frame has the quaternion of the other sign."""
    random = np.random.default_rng(11)
    keys = Poses(random.normal(size=(8, 3)), random.normal(size=(8, 4)), np.exp(random.normal(size=8)))
    frames = np.arange(1.0, 201.0)
    poses = interpolate(np.linspace(1.0, 200.0, 8), keys, frames, "dq_sclerp")
    poses.quaternions[::2] *= -1.0
    return frames, poses


@pytest.mark.parametrize("order", ["QUATERNION", "AXIS_ANGLE", "XZY"])
def test_poses_are_shown_however_an_object_turns_and_between_frames_it_goes_no_other_way(live_file, order):
    obj, other = (new_object(name, order) for name in ("Tool", "Other"))
    frames, poses = motion()
    bake_poses(obj, frames, poses)
    # A shared Action keeps the channels of its other users.
    data = other.animation_data_create()
    data.action = obj.animation_data.action
    data.action_slot = data.action.slots.new("OBJECT", "Other")
    still = Poses(poses.positions * 0.0, poses.quaternions, poses.scales)
    bake_poses(other, frames, still)
    assert_near(worlds(obj, frames), matrices(poses), tolerance=2e-6)
    assert_near(worlds(other, frames), matrices(still), tolerance=2e-6)
    steps = angle_between(poses.quaternions[1:], poses.quaternions[:-1])
    between = Poses.from_matrices(worlds(obj, frames[:-1] + 0.5)).quaternions
    assert np.all(angle_between(between, poses.quaternions[:-1]) < steps + 1e-3)


def give_cycles(carrier: Carrier, mode: str) -> None:
    for (path, _), fcurve in curves_of(carrier).items():
        keys = fcurve.keyframe_points
        if mode == "REPEAT_OFFSET" and path != "location":
            keys[-1].co_ui.y = keys[0].co.y
        cycles = fcurve.modifiers.new("CYCLES")
        cycles.mode_before = cycles.mode_after = mode


def give_to_location(carrier: Carrier, kind: str, **settings: float) -> None:
    for index in range(3):
        modifier = curves_of(carrier)["location", index].modifiers.new(kind)
        for name, value in settings.items():
            setattr(modifier, name, value)


def mute_one(carrier: Carrier) -> None:
    curves_of(carrier)["location", 1].mute = True
    carrier.location.y = 0.75


BESIDE_KEYS = {
    "noise": lambda it: give_to_location(it, "NOISE", scale=3.0),
    "holds": lambda it: give_to_location(it, "STEPPED", frame_step=4.0, frame_offset=2.0),
    "cycles": lambda it: give_cycles(it, "REPEAT"),
    "cycles that go on": lambda it: give_cycles(it, "REPEAT_OFFSET"),
    "mirrored cycles": lambda it: give_cycles(it, "MIRROR"),
    "cycles with limits": lambda it: (give_cycles(it, "REPEAT"), give_to_location(it, "LIMITS", use_max_x=True)),
    "a channel that is muted": mute_one,
    "delta scales that cancel out": lambda it: setattr(it.id_data, "delta_scale", (2.0, -1.0, -1.0)),
}


@pytest.mark.parametrize(
    ("beside", "what"),
    in_turn(BESIDE_KEYS, [(False, "QUATERNION"), (False, "XYZ"), (False, "AXIS_ANGLE"), (True, "XYZ")]),
)
def test_baked_keys_are_shown_as_before_whatever_there_is_beside_keys(live_file, beside, what):
    of_bones, order = what
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 0, 70
    obj, targets = moving(of_bones, "BLENDER", order=order, seed=len(beside), scale="even")
    BESIDE_KEYS[beside](targets[0])
    set_mode(targets, "pga_slerp", FRAMES[:2])
    set_mode(targets, "dq_sclerp", FRAMES[2:3])
    frames = np.arange(0.0, 71.0)
    before, keys = shown_of(obj, frames), list(map(snapshot, targets))
    muted = {name: rows for name, rows in keys[0].items() if curves_of(targets[0])[name].mute}
    bake(targets)
    bpy.context.view_layer.update()
    assert np.abs(shown_of(obj, frames) - before).max() < 2e-5 * np.abs(before).max()
    assert muted.items() <= snapshot(targets[0]).items()
    unbake(targets)
    assert np.abs(shown_of(obj, frames) - before).max() < 2e-5 * np.abs(before).max()
    assert list(map(snapshot, targets)) == keys
    assert len(bpy.data.actions) == 1


@OF_BOTH
def test_all_that_moves_by_an_action_is_baked_together_and_gets_its_keys_back_from_either(live_file, of_bones):
    obj, targets = moving(of_bones)
    targets = targets[:2]
    other = obj.copy()
    bpy.context.scene.collection.objects.link(other)
    others = [other.pose.bones[bone.name] for bone in targets] if of_bones else [other]
    before, expected = list(map(snapshot, targets)), [shown_of(one, PLAYED) for one in (obj, other)]
    for bake_by, back_by in (([*targets, *others], others), (others, targets)):
        bake(bake_by)
        assert all(map(is_baked, [*targets, *others]))
        for one, places in zip((obj, other), expected, strict=True):
            assert np.abs(shown_of(one, PLAYED) - places).max() < 2e-5
        assert list(map(snapshot, targets)) != before
        unbake(back_by)
        assert not any(map(is_baked, [*targets, *others]))
        assert list(map(snapshot, targets)) == before
        assert list(bpy.data.actions) == [obj.animation_data.action]
    assert_nothing_stale()


def in_a_strip_of_strips(obj: bpy.types.Object, _other: bpy.types.Object) -> None:
    push_down(obj)
    select_only(obj)
    obj.animation_data.nla_tracks[0].strips[0].select = obj.animation_data.nla_tracks[0].select = True
    with editor("NLA_EDITOR"):
        bpy.ops.nla.meta_add()


def in_another_slot_too(obj: bpy.types.Object, other: bpy.types.Object, *, in_strips: bool = False) -> None:
    select_only(obj, other)
    bpy.ops.anim.merge_animation()
    action, slot = obj.animation_data.action, obj.animation_data.action_slot
    if in_strips:
        obj.animation_data.action = None
        new_strip(obj, 1, action, slot)
    new_strip(obj, 50, action, other.animation_data.action_slot)


ARRANGED = {
    "in a strip of strips": in_a_strip_of_strips,
    "while its strip is edited": lambda obj, _: tweak(obj, push_down(obj)),
    "in another slot too": in_another_slot_too,
    "in two strips": partial(in_another_slot_too, in_strips=True),
}


@pytest.mark.parametrize(("arranged", "of_bones"), in_turn(ARRANGED, [False, True]))
def test_what_plays_in_strips_or_several_slots_is_baked_there_and_gets_its_keys_back(live_file, of_bones, arranged):
    (obj, targets), (other, _) = moving(of_bones, name="A"), moving(of_bones, "pga_lerp", "B", seed=1)
    ARRANGED[arranged](obj, other)
    bpy.context.view_layer.update()
    frames, actions = np.arange(1.0, 90.0), set(bpy.data.actions)
    before, keys = shown_of(obj, frames), list(map(keys_in, actions))
    for act in (bake, unbake):
        act(targets)
        bpy.context.view_layer.update()
        assert np.abs(shown_of(obj, frames) - before).max() < 2e-5
        assert (list(map(keys_in, actions)) == keys) == (act == unbake)
    assert set(bpy.data.actions) == actions


def keys_in(action: bpy.types.Action) -> list[int]:
    """Return the number of keys of each F-curve of an Action."""
    return [len(fcurve.keyframe_points) for bag in action.layers[0].strips[0].channelbags for fcurve in bag.fcurves]


def clips_of(obj: bpy.types.Object, folder: Path) -> tuple[set[str], set[bytes]]:
    """Return the names of the animations that Blender's exporters write with their default settings."""
    path = str(folder / obj.name)
    with enabled("io_scene_gltf2", "io_scene_fbx"):
        bpy.ops.export_scene.gltf(filepath=f"{path}.gltf", export_format="GLTF_SEPARATE")
        bpy.ops.export_scene.fbx(filepath=f"{path}.fbx")
    animations = json.loads((folder / f"{obj.name}.gltf").read_text())["animations"]
    stacks = re.findall(rb"([\w|. ]+)\x00\x01AnimStack", (folder / f"{obj.name}.fbx").read_bytes())
    return {animation["name"] for animation in animations}, set(stacks)


@OF_BOTH
def test_what_is_kept_is_no_clip_of_an_export(live_file, tmp_path, of_bones):
    obj, targets = moving(of_bones)
    before = clips_of(obj, tmp_path)
    bake(targets)
    reduce_keys_of(targets, "dq_sclerp", 0.1)
    assert len(bpy.data.actions) == 3
    assert clips_of(obj, tmp_path) == before


AROUND_SWITCHES = (10, 20, 30, 39, 40, 59, 60, 85)
HOLDERS = ["", "Hand.L", "Hand.L", "Hand.L", "Hand.R", "Hand.R", "", ""]


@pytest.mark.parametrize(("kind", "step"), [*((kind, 1.0) for kind in KINDS), ("bone", 7.0)])
def test_what_is_baked_to_the_world_is_held_no_more_and_shown_as_before(live_file, kind, step):
    prop, hands = new_prop(kind), new_hands()
    handled(prop, *hands)
    before, keys, holders = worlds(prop), snapshot(prop), holders_on(prop, AROUND_SWITCHES)
    bpy.context.scene.frame_set(33)
    assert bake_to_world(prop, step=step) == (1.0, 80.0)
    assert bpy.context.scene.frame_current == 33
    frames = key_frames(prop)
    assert {1.0, 9.0, 20.0, 40.0, 60.0, 80.0} <= set(frames)
    assert len(frames) == (80 if step == 1.0 else 19)
    assert np.abs(worlds(prop, frames) - before[frames.astype(int) - 1]).max() < 1e-5
    assert not any(holders_on(prop, AROUND_SWITCHES))
    raise_keys(hands[0], 0.3)
    assert np.abs(worlds(prop, frames) - before[frames.astype(int) - 1]).max() < 1e-5
    turn_back = worlds(hands[0])
    unbake(prop)
    assert np.abs(worlds(hands[0]) - turn_back).max() < 1e-6
    assert snapshot(prop) == keys
    assert holders_on(prop, AROUND_SWITCHES) == holders == HOLDERS


def test_what_is_held_to_the_end_is_baked_to_the_world_as_far_as_it_is_seen(live_file):
    """A constraint added by the animator still applies on top, and stays."""
    prop, hands = new_prop("free"), new_hands()
    bpy.context.scene.frame_set(20)
    hold_in(prop, hands[0])
    limit = prop.constraints.new("LIMIT_LOCATION")
    limit.use_max_z, limit.max_z = True, float(np.median(worlds(prop)[:, 2, 3]))
    bpy.context.view_layer.update()
    before = worlds(prop)
    assert bake_to_world(prop) == (19.0, 90.0)
    assert np.abs(worlds(prop) - before).max() < 1e-5
    assert not limit.mute


def test_what_is_held_in_what_is_held_is_baked_to_the_world_with_it_in_a_strip_that_is_entered(live_file):
    prop, hands, other = new_prop("free"), new_hands(), new_object("Other")
    other.location = (0.2, 0.1, 0.3)
    handled(prop, *hands)
    bpy.context.scene.frame_set(25)
    hold_in(other, prop)
    bpy.context.view_layer.update()
    before = [worlds(one) for one in (prop, other)]
    bake_to_world([prop, other])
    for one, places in zip((prop, other), before, strict=True):
        assert np.abs(worlds(one) - places).max() < 1e-5
    unbake([prop, other])
    tweak(prop, push_down(prop, 1))
    bake_to_world(prop)
    assert np.abs(worlds(prop) - before[0]).max() < 1e-5


def test_what_cannot_be_baked_to_the_world_says_why_and_the_way_out(live_file):
    prop, hands = new_prop("free"), new_hands()
    with pytest.raises(Refused, match="Tool is not held"):
        bake_to_world(prop)
    handled(prop, *hands)
    before = snapshot(prop)
    other = prop.copy()
    bpy.context.scene.collection.objects.link(other)
    for act in (bake_to_world, bake):
        with pytest.raises(Refused, match=r"Tool shares its Action with others.*Make Single User"):
            act(prop)
    assert snapshot(prop) == before
    assert not is_baked(prop)
