"""The way back from baked and reduced keys, whatever has become of bones and their names meanwhile."""

from __future__ import annotations

import json
import re
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, reduce_keys_of, set_mode, unbake
from tests.animation.bones.poses import assert_posed, shown_poses
from tests.animation.bones.rigs import PLAYED, key_all, moving_rig, new_rig, select_only
from tests.animation.bones.test_rig_edits import assert_nothing_stale, make_lower_fore, swap_two
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import editor, enabled, key, new_object, new_strip, push_down, tweak

OF_BOTH = pytest.mark.parametrize("of_bones", [False, True], ids=["object", "bones"])


def moving(of_bones: bool, mode: str = "dq_sclerp", name: str = "Mover") -> tuple[bpy.types.Object, list]:
    """A rig or an object that has a mode, and what has it."""
    obj = moving_rig(mode, name=name) if of_bones else key(new_object(name), seed=len(mode))
    set_mode(targets := list(obj.pose.bones) if of_bones else [obj], mode)
    return obj, targets


@pytest.mark.parametrize("rename", [make_lower_fore, swap_two], ids=lambda rename: rename.__name__)
@pytest.mark.parametrize("count", [2, 4], ids=["some bones baked", "all bones baked"])
def test_bones_that_were_renamed_get_their_own_keys_back(live_file, count, rename):
    rig = moving_rig()
    own, before = rig.animation_data.action, [snapshot(bone) for bone in rig.pose.bones]
    bake(list(rig.pose.bones)[:count])
    rename(rig)
    bpy.context.view_layer.update()
    unbake(list(rig.pose.bones)[:count])
    bpy.context.view_layer.update()
    assert rig.animation_data.action == own
    assert [snapshot(bone) for bone in rig.pose.bones] == before
    assert_posed(rig, PLAYED)
    assert_nothing_stale()


@OF_BOTH
def test_all_that_moves_by_an_action_is_baked_together_and_gets_its_keys_back_from_either(live_file, of_bones):
    obj, targets = moving(of_bones)
    targets = targets[:2]
    other = obj.copy()
    bpy.context.scene.collection.objects.link(other)
    others = [other.pose.bones[bone.name] for bone in targets] if of_bones else [other]
    before, expected = list(map(snapshot, targets)), [shown(one, PLAYED) for one in (obj, other)]
    for bake_by, back_by in (([*targets, *others], others), (others, targets)):
        bake(bake_by)
        assert all(map(is_baked, [*targets, *others]))
        for one, places in zip((obj, other), expected, strict=True):
            assert np.abs(shown(one, PLAYED) - places).max() < 2e-5
        assert list(map(snapshot, targets)) != before
        unbake(back_by)
        assert not any(map(is_baked, [*targets, *others]))
        assert list(map(snapshot, targets)) == before
        assert list(bpy.data.actions) == [obj.animation_data.action]
    assert_nothing_stale()


@OF_BOTH
def test_a_duplicate_has_a_way_back_of_its_own(live_file, of_bones):
    obj, targets = moving(of_bones)
    before = list(map(snapshot, targets))
    bake(targets)
    select_only(obj)
    bpy.ops.object.duplicate()
    other = bpy.context.object
    assert other.animation_data.action != obj.animation_data.action
    others = list(other.pose.bones) if of_bones else [other]
    unbake(others)
    assert list(map(snapshot, others)) == before
    assert list(map(snapshot, targets)) != before
    unbake(targets)
    assert list(map(snapshot, targets)) == before
    assert len(bpy.data.actions) == 2


@OF_BOTH
def test_what_is_muted_stays_where_it_is(live_file, of_bones):
    obj = key_all(new_rig()) if of_bones else key(new_object())
    carrier, targets = (obj.pose.bones["Upper"], list(obj.pose.bones)) if of_bones else (obj, obj)
    curves_of(carrier)["location", 1].mute = True
    carrier.location.y = 0.75
    set_mode(targets, "dq_sclerp")
    expected, before = shown(obj, PLAYED), snapshot(carrier)["location", 1]
    for act in (bake, unbake):
        act(targets)
        bpy.context.view_layer.update()
        assert np.abs(shown(obj, PLAYED) - expected).max() < 2e-5
        assert carrier.location.y == 0.75
        assert snapshot(carrier)["location", 1] == before


def put_into_a_meta_strip(obj: bpy.types.Object) -> None:
    for strip in obj.animation_data.nla_tracks[0].strips:
        strip.select = True
    obj.animation_data.nla_tracks[0].select = True
    with editor("NLA_EDITOR"):
        bpy.ops.nla.meta_add()


def shown(obj: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    if obj.pose is None:
        return shown_worlds([obj], frames)[0]
    return np.stack([*shown_poses([obj], frames)[0].values()])


@OF_BOTH
def test_what_plays_in_a_strip_of_strips_is_baked_there(live_file, of_bones):
    obj, targets = moving(of_bones)
    own = push_down(obj).action
    select_only(obj)
    put_into_a_meta_strip(obj)
    bpy.context.view_layer.update()
    before = shown(obj, PLAYED)
    (strip,) = obj.animation_data.nla_tracks[0].strips[0].strips
    for act in (bake, unbake):
        act(targets)
        bpy.context.view_layer.update()
        assert strip.action == own
        assert np.abs(shown(obj, PLAYED) - before).max() < 2e-5


@pytest.mark.parametrize("in_strips", [False, True], ids=["Action and strip", "two strips"])
@OF_BOTH
def test_two_slots_of_one_action_that_move_the_same_are_baked_each_for_itself(live_file, of_bones, in_strips):
    (obj, targets), (other, _) = moving(of_bones, name="A"), moving(of_bones, "pga_lerp", "B")
    select_only(obj, other)
    bpy.ops.anim.merge_animation()
    data = obj.animation_data
    action, own = data.action, data.action_slot
    starts = [(1, own)] if in_strips else []
    if in_strips:
        data.action = None
    for start, slot in (*starts, (50, other.animation_data.action_slot)):
        strip = new_strip(obj, start, action, slot)
    bpy.context.view_layer.update()
    frames = np.arange(1.0, 90.0)
    before = shown(obj, frames)
    for act in (bake, unbake):
        act(targets)
        bpy.context.view_layer.update()
        assert np.abs(shown(obj, frames) - before).max() < 2e-5
    assert strip.action == action


@OF_BOTH
def test_the_keys_of_a_strip_are_baked_while_it_is_edited(live_file, of_bones):
    obj, targets = moving(of_bones)
    before = list(map(snapshot, targets))
    tweak(obj, push_down(obj))
    bake(targets)
    assert list(map(snapshot, targets)) != before
    unbake(targets)
    assert list(map(snapshot, targets)) == before


def clips_of(obj: bpy.types.Object, folder: Path) -> tuple[set[str], set[bytes]]:
    """The names of what Blender's exporters write with their default settings."""
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
