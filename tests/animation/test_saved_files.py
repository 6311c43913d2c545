"""Saved files: a Blender without the extension plays them the same way, and saving them there loses nothing.

That Blender is another process at factory settings, which imports nothing of this program.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, modes_of, problem_of, refresh, set_mode, unbake
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.body_oracle import own_deltas
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, shown_poses
from tests.animation.bones.rigs import key_all, moving_rig, new_rig
from tests.animation.farm import SAVE, on_a_farm, played_on_a_farm
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import assert_near, assert_shown, expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, give_own_deltas, key, linked, new_object
from tests.blank import blank

ORDERS = ("QUATERNION", "XYZ", "ZYX", "AXIS_ANGLE")
ANY_TIME = np.arange(-2.0, 44.0, 0.625)

LIBRARY_CHANGES = """
rig = bpy.data.objects["Puppet"]
bpy.context.view_layer.objects.active = rig
bpy.ops.object.mode_set(mode="EDIT")
rig.data.edit_bones["Upper"].tail = (0.2, 0.5, 1.9)
rig.data.edit_bones.new("Finger").tail = (0.1, 0.2, 0.3)
bpy.ops.object.mode_set(mode="OBJECT")
bpy.ops.wm.save_as_mainfile(filepath=found)
"""


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def every_mode_and_kind() -> list[bpy.types.Object]:
    """Return an object for each mode and rotation order, some with delta transforms."""
    objects = []
    for seed, (mode, order) in enumerate((mode, order) for mode in KEYFRAME_MODES for order in ORDERS):
        obj = new_object(f"{mode} {order}", order)
        scale = (None, "even", "uneven")[seed % 3]
        if seed % 2 and order != "AXIS_ANGLE":
            give_own_deltas(obj, seed)
        key(obj, seed=seed, scale=scale, interpolation=("BEZIER", "LINEAR", "BOUNCE", "CONSTANT")[seed % 4])
        set_mode(obj, mode, None if seed % 4 < 2 else FRAMES[:2])
        objects.append(obj)
    return objects


@pytest.mark.parametrize("order", ["QUATERNION", "YZX"])
def test_every_mode_plays_alike_in_a_blender_without_the_extension_and_comes_back_whole(live_file, tmp_path, order):
    objects = every_mode_and_kind()
    rig = key_all(new_rig(rotation_mode=order), scale="even")
    for mode, bone in zip(list(KEYFRAME_MODES) * 2, rig.pose.bones, strict=False):
        set_mode(bone, mode)
    set_mode(rig.pose.bones["Lower"], "motor_spline", [FRAMES[1]])
    assert_shown(objects, ANY_TIME)
    shown, posed, carriers = shown_worlds(objects, ANY_TIME), expected_poses(rig, ANY_TIME), [*objects, *rig.pose.bones]
    names, keys = [obj.name for obj in (*objects, rig)], [snapshot(carrier) for carrier in carriers]
    modes = [modes_of(carrier, np.array(FRAMES[:3])) for carrier in carriers]
    deltas = [own_deltas(obj) for obj in objects]
    path = save(tmp_path / "shot.blend")
    played = played_on_a_farm(path, names, ANY_TIME)
    for one, other in zip(played.worlds[:-1], shown, strict=True):
        assert_near(one, other, tolerance=1e-6)
    assert_same_poses(rig, ANY_TIME, dict(zip(rig.pose.bones.keys(), played.poses, strict=True)), posed)
    on_a_farm(SAVE, path, tmp_path / "farm.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "farm.blend"))
    *objects, rig = (bpy.data.objects[name] for name in names)
    carriers = [*objects, *rig.pose.bones]
    assert [snapshot(carrier) for carrier in carriers] == keys
    assert [modes_of(carrier, np.array(FRAMES[:3])) for carrier in carriers] == modes
    assert {problem_of(carrier) for carrier in carriers} == {""}
    assert refresh() == 0, "the in-betweens that are there are those of these keys"
    assert [own_deltas(obj) for obj in objects] == deltas
    set_mode(carriers, "BLENDER")
    assert not any(fcurve.modifiers for carrier in carriers for fcurve in curves_of(carrier).values())
    native = shown_worlds(objects, ANY_TIME)
    differing = [np.abs(one - other).max() > 1e-2 for one, other in zip(native, shown, strict=True)]
    assert np.mean(differing) > 0.7, "in most of these the modes are to be seen, or this test says nothing"


def test_the_numbers_of_modes_in_files_stay_what_they_are(live_file):
    items = bpy.data.objects.new("Any", None).rigid_motion.bl_rna.properties["mode"].enum_items
    numbers = {item.identifier: item.value for item in items}
    assert numbers == {"BLENDER": 0, **{name: mode.number for name, mode in KEYFRAME_MODES.items()}}


def linked_action(path: Path) -> bpy.types.Object:
    """Return another object with the linked Action of a file."""
    with bpy.data.libraries.load(str(path), link=True) as (source, chosen):
        chosen.actions = [name for name in source.actions if name.startswith("Tool")]
    obj, (action,) = new_object("Another"), chosen.actions
    obj.animation_data_create().action = action
    obj.animation_data.action_slot = action.slots[0]
    return obj


def appended(path: Path) -> bpy.types.Object:
    with bpy.data.libraries.load(str(path), link=False) as (_, chosen):
        chosen.objects = ["Tool"]
    bpy.context.scene.collection.objects.link(chosen.objects[0])
    return chosen.objects[0]


WAYS = {
    "linked": lambda path: linked(path, "Tool"),
    "overridden": lambda path: linked(path, "Tool").override_create(remap_local_usages=True),
    "made local": lambda path: linked(path, "Tool").make_local(),
    "appended": appended,
    "the Action alone": linked_action,
}


@pytest.mark.parametrize("way", WAYS)
def test_what_comes_from_another_file_moves_as_it_does_there(live_file, tmp_path, way):
    obj = key(new_object("Tool"))
    set_mode(obj, "motor_spline")
    expected = expected_worlds(obj, ANY_TIME)
    path = save(tmp_path / "library.blend")
    blank()
    obj = WAYS[way](path)
    bpy.context.view_layer.update()
    assert refresh() == 0
    assert_near(shown_worlds([obj], ANY_TIME)[0], expected)
    other = obj.copy()
    bpy.context.scene.collection.objects.link(other)
    assert_near(shown_worlds([other], ANY_TIME)[0], expected)


def test_rigs_that_are_linked_and_overridden_keep_their_modes_through_files_and_changes_of_the_library(
    live_file, tmp_path
):
    moved = expected_poses(moving_rig("dq_sclerp"), ANY_TIME)
    new_rig("Puppet")
    library, shot = save(tmp_path / "library.blend"), tmp_path / "shot.blend"
    blank()
    arm, rig = linked(library, "Rig"), linked(library, "Puppet").override_create(remap_local_usages=True)
    with pytest.raises(ValueError, match="linked from another file"):
        set_mode(list(arm.pose.bones), "pga_lerp")
    assert_same_poses(arm, ANY_TIME, shown_poses([arm], ANY_TIME)[0], moved)
    rig.override_library.is_system_override = False
    bpy.context.view_layer.update()
    set_mode(list(key_all(rig).pose.bones), "dq_sclerp")
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    expected, names = expected_poses(rig, ANY_TIME), rig.pose.bones.keys()
    assert_posed(rig, ANY_TIME)
    played = played_on_a_farm(save(shot), [rig.name], ANY_TIME).poses
    assert_same_poses(rig, ANY_TIME, dict(zip(names, played, strict=True)), expected)
    bake(rig.pose.bones["Body"])
    save(shot)
    for changed in (False, True):
        bpy.ops.wm.open_mainfile(filepath=str(shot))
        rig, arm = bpy.data.objects["Puppet"], bpy.data.objects["Rig"]
        assert_same_poses(arm, ANY_TIME, shown_poses([arm], ANY_TIME)[0], moved)
        assert rig.override_library is not None
        assert ("Finger" in rig.pose.bones) == changed
        assert [bone.name for bone in rig.pose.bones if is_baked(bone)] == ["Body"]
        assert_posed(rig, ANY_TIME)
        unbake(rig.pose.bones["Body"])
        assert_posed(rig, ANY_TIME)
        assert {modes_of(rig.pose.bones[name], np.array(FRAMES[:1]))[0] for name in names} == {"dq_sclerp"}
        on_a_farm(LIBRARY_CHANGES, library, library)
    curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[1].co_ui.y += 1.0
    bpy.context.view_layer.update()
    assert_posed(rig, ANY_TIME)
