"""Held objects are held by Blender alone: with the extension off, in a Blender without it, and in exports."""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from tests.animation.farm import played_on_a_farm
from tests.animation.holds.hands import HOLDERS, PROPS, by_an_object, by_fk, free, place, take, wander
from tests.animation.holds.oracle import apart
from tests.animation.holds.test_passing import MOMENTS, MOVING, juggled, off
from tests.animation.keyed import Carrier
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import enabled, new_object
from tests.animation.test_export import FORMATS, PLAYED, assert_alike, reimport


@pytest.fixture
def file_to_switch(live_file) -> Iterator[None]:
    """A file in which the extension may be switched off. It is on again afterwards."""
    yield
    if not hasattr(bpy.types.Object, "rigid_motion"):
        animation.register()


def move_by_hand(hand: Carrier) -> None:
    """Edit a hand as animators do: other keys, another place of the arm, and a constraint."""
    rig = hand.id_data
    rig.location, rig.rotation_euler = (0.3, -0.2, 0.1), (0.2, 0.5, -0.3)
    wander(hand, 71, 0.0)
    goal = new_object("Goal")
    goal.location = 0.4, 0.4, 1.6
    track = hand.constraints.new("DAMPED_TRACK")
    track.target, track.influence = goal, 0.4
    bpy.context.view_layer.update()


@pytest.mark.parametrize("what", ["Euler", "parented", "on a bone", "bone"])
def test_it_follows_edits_of_the_hands_while_the_extension_is_off(file_to_switch, what):
    prop, twin = PROPS[what]()
    holders = by_fk("First", 11), by_fk("Second", 31)
    holds = juggled(prop, holders, (3, 4, 10, 3), moves=True)
    animation.unregister()
    (before,) = shown_worlds([prop], MOMENTS)
    for hand in holders:
        move_by_hand(hand)
    assert apart(before, shown_worlds([prop], MOMENTS)[0]) > 0.05
    assert off(prop, twin, holds) < MOVING


@pytest.mark.parametrize("by", ["IK", "scaled strip"])
def test_files_are_played_by_a_blender_without_it_as_with_it(live_file, tmp_path, by):
    prop, _ = PROPS["parented"]()
    other, _ = PROPS["bone"]()
    holders = HOLDERS[by]("First", 11), HOLDERS[by]("Second", 31)
    for each in (prop, other):
        juggled(each, holders, (3, 4, 10, 3), moves=False)
    expected = shown_worlds([prop, other], MOMENTS)
    path = tmp_path / "held.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    rig, names = other.id_data, [bone.name for bone in other.id_data.pose.bones]
    played = played_on_a_farm(path, [prop.name, rig.name], MOMENTS)
    posed = played.worlds[1] @ played.poses[names.index(other.name)]
    for one, seen in zip((played.worlds[0], posed), expected, strict=True):
        assert np.abs(one - seen).max() < 1e-6


@pytest.mark.parametrize("kind", ["glb", "scene.glb", "fbx"])
def test_what_is_held_is_exported_as_it_is_seen(live_file, tmp_path, kind):
    with enabled("io_scene_gltf2", "io_scene_fbx"):
        objects = [free()[0], PROPS["parented"]()[0], by_an_object("First", 11), by_an_object("Second", 31)]
        for prop in objects[:2]:
            for at, holder, frames in ((1, None, 0), (9, objects[2], 3), (20, objects[3], 4), (31, None, 0)):
                take(prop, holder, at, frames=frames, seed=at)
                place(prop, at + 1, frame=at + 4)
        expected = dict(zip([obj.name for obj in objects], shown_worlds(objects, PLAYED), strict=True))
        reimport(objects, tmp_path / f"shot.{kind}", FORMATS[kind])
        found = [bpy.data.objects[name] for name in expected]
        for data in (obj.animation_data for obj in bpy.data.objects if obj.animation_data):
            # Importers of clips put them into NLA strips.
            for strip in (strip for track in data.nla_tracks for strip in track.strips):
                data.action, data.action_slot = strip.action, strip.action_slot
        assert_alike(expected, shown_worlds(found, PLAYED), expected.values())
