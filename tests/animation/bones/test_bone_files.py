"""Files with modes on bones: saved and opened, without the extension and with it, linked and overridden."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, modes_of, problem_of, refresh, set_mode, unbake
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, names_of
from tests.animation.bones.rigs import FRAMES, INHERIT_SCALES, ORDERS, PLAYED, key_all, moving_rig, new_rig
from tests.animation.farm import on_a_farm
from tests.animation.keyed import curves_of, snapshot
from tests.thoroughness import sample

PLAY_BONES = """
rig = bpy.data.objects[names[0]]
pose = lambda: [bone.matrix for bone in rig.evaluated_get(graph).pose.bones]
assert not hasattr(bpy.types.PoseBone, "rigid_motion")
opened, played = np.array(pose()), []
for frame in np.load(found):
    scene.frame_set(int(frame))
    played.append(np.array(pose()))
np.savez(found.replace(".npy", ".npz"), opened=opened, played=np.array(played))
"""

SAVE_AS = "bpy.ops.wm.save_as_mainfile(filepath=found)"


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def reopened(path: Path, name: str = "Rig") -> bpy.types.Object:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects[name]


def posed_on_a_farm(path: Path, rig: bpy.types.Object) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The bones as the file is opened (1, 4, 4), and on all frames played."""
    frames = path.with_suffix(".npy")
    np.save(frames, PLAYED)
    on_a_farm(PLAY_BONES, path, frames, rig.name)
    with np.load(frames.with_suffix(".npz")) as result:
        opened, played = result["opened"][None], result["played"]
    names = names_of(rig)
    return (
        {name: opened[:, place] for place, name in enumerate(names)},
        {name: played[:, place] for place, name in enumerate(names)},
    )


@pytest.mark.parametrize("order", sample(ORDERS))
def test_every_mode_plays_alike_in_a_blender_without_the_extension(live_file, tmp_path, order):
    rig = key_all(new_rig(rotation_mode=order), scale="even")
    for place, (mode, pose_bone) in enumerate(zip(list(KEYFRAME_MODES) * 2, rig.pose.bones, strict=False)):
        pose_bone.bone.inherit_scale = INHERIT_SCALES[place]
        set_mode(pose_bone, mode)
    set_mode(rig.pose.bones["Lower"], "motor_spline", [FRAMES[1]])
    expected = expected_poses(rig, PLAYED)
    _, played = posed_on_a_farm(save(tmp_path / "shot.blend"), rig)
    assert_same_poses(rig, PLAYED, played, expected)


@pytest.mark.parametrize("frame", sample([17.0, 7.0, 400.0]))
def test_a_file_opens_as_it_was_to_be_seen_on_the_frame_it_was_saved_on(live_file, tmp_path, frame):
    rig = moving_rig("pga_slerp")
    live_file.scene.frame_set(int(frame))
    at = np.array((frame,))
    expected = expected_poses(rig, at)
    opened, _ = posed_on_a_farm(save(tmp_path / "shot.blend"), rig)
    assert_same_poses(rig, at, opened, expected)


def test_what_a_farm_saves_again_comes_back_whole(live_file, tmp_path):
    rig = moving_rig("cga_slerp", scale="even")
    set_mode(rig.pose.bones["Hand"], "dq_sclerp", [11.0])
    keys = snapshot(rig)
    on_a_farm(SAVE_AS, save(tmp_path / "shot.blend"), tmp_path / "farm.blend")
    rig = reopened(tmp_path / "farm.blend")
    assert snapshot(rig) == keys
    assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:3])) == ["cga_slerp", "dq_sclerp", "cga_slerp"]
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    assert refresh() == 0, "the in-betweens that are there are those of these keys"
    assert_posed(rig, PLAYED)
    set_mode(list(rig.pose.bones), "BLENDER")
    assert_posed(rig, PLAYED)
    assert not any(len(pose_bone.constraints) for pose_bone in rig.pose.bones)


def test_a_bone_that_a_farm_renames_is_followed(live_file, tmp_path):
    moving_rig()
    rename = "bpy.data.armatures[0].bones['Lower'].name = 'Fore'\nbpy.ops.wm.save_as_mainfile(filepath=found)"
    on_a_farm(rename, save(tmp_path / "shot.blend"), tmp_path / "farm.blend")
    rig = reopened(tmp_path / "farm.blend")
    assert modes_of(rig.pose.bones["Fore"], np.array(FRAMES[:1])) == ["dq_sclerp"]
    assert_posed(rig, PLAYED)


def test_baked_bones_play_alike_on_a_farm_and_can_be_un_baked_after_it_saved_the_file(live_file, tmp_path):
    rig = moving_rig()
    keys, expected = snapshot(rig), expected_poses(rig, PLAYED)
    bake(list(rig.pose.bones))
    path = save(tmp_path / "shot.blend")
    assert_same_poses(rig, PLAYED, posed_on_a_farm(path, rig)[1], expected)
    on_a_farm(SAVE_AS, path, tmp_path / "farm.blend")
    rig = reopened(tmp_path / "farm.blend")
    assert all(is_baked(pose_bone) for pose_bone in rig.pose.bones)
    unbake(list(rig.pose.bones))
    assert snapshot(rig) == keys
    assert_posed(rig, PLAYED)


@pytest.fixture
def library(live_file, tmp_path) -> Path:
    """A file with two rigs: one that moves in a mode, and one without any keys."""
    moving_rig("dq_sclerp", name="Rig")
    new_rig("Puppet").pose.bones["Hand"].constraints.new("LIMIT_SCALE").name = "The library's own"
    path = save(tmp_path / "library.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


def linked(library: Path, name: str) -> bpy.types.Object:
    with bpy.data.libraries.load(str(library), link=True) as (_, expected):
        expected.objects = [name]
    obj = bpy.data.objects[name]
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


def overridden(library: Path, name: str) -> bpy.types.Object:
    """A rig of the library that this file may animate."""
    rig = linked(library, name).override_create(remap_local_usages=True)
    rig.override_library.is_system_override = False
    bpy.context.view_layer.update()
    return rig


def test_a_linked_rig_shows_the_modes_of_its_library(library, tmp_path):
    rig = linked(library, "Rig")
    assert_posed(rig, PLAYED)
    with pytest.raises(ValueError, match="linked from another file"):
        set_mode(list(rig.pose.bones), "pga_lerp")
    assert_posed(rig, PLAYED)
    assert_posed(reopened(save(tmp_path / "shot.blend")), PLAYED)


def test_a_rig_without_an_action_that_is_linked_is_refused(library):
    with pytest.raises(ValueError, match="linked from another file"):
        set_mode(linked(library, "Puppet").pose.bones["Hand"], "dq_sclerp")


def test_an_overridden_rig_whose_action_is_linked_is_refused_by_its_name(library):
    rig = overridden(library, "Rig")
    with pytest.raises(ValueError, match="linked from another file"):
        set_mode(list(rig.pose.bones), "pga_lerp")
    assert_posed(rig, PLAYED)


def test_an_overridden_rig_takes_modes_and_has_them_when_the_file_is_opened_again(library, tmp_path):
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    assert [c.name for c in rig.pose.bones["Hand"].constraints] == ["Rigid Motion", "The library's own"]
    expected = expected_poses(rig, PLAYED)
    assert_posed(rig, PLAYED)
    path = save(tmp_path / "shot.blend")
    assert_same_poses(rig, PLAYED, posed_on_a_farm(path, rig)[1], expected)
    for _ in range(2):
        rig = reopened(path, "Puppet")
        assert rig.override_library is not None
        assert [c.name for c in rig.pose.bones["Hand"].constraints] == ["Rigid Motion", "The library's own"]
        assert_posed(rig, PLAYED)
        assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:1])) == ["dq_sclerp"]
        path = save(tmp_path / "again.blend")


def test_an_overridden_rig_keeps_its_modes_when_its_library_changes(library, tmp_path):
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    path = save(tmp_path / "shot.blend")
    change = """
rig = bpy.data.objects["Puppet"]
bpy.context.view_layer.objects.active = rig
bpy.ops.object.mode_set(mode="EDIT")
rig.data.edit_bones["Upper"].tail = (0.2, 0.5, 1.9)
rig.data.edit_bones.new("Finger").tail = (0.1, 0.2, 0.3)
bpy.ops.object.mode_set(mode="OBJECT")
added = rig.pose.bones["Lower"].constraints.new("LIMIT_SCALE")
added.name = "A later one"
rig.pose.bones["Hand"].constraints.new("LIMIT_SCALE").name = "Another"
bpy.ops.wm.save_as_mainfile(filepath=found)
"""
    on_a_farm(change, library, library)
    rig = reopened(path, "Puppet")
    assert "Finger" in rig.pose.bones
    assert_posed(rig, PLAYED)
    assert rig.pose.bones["Lower"].constraints[0].name == "Rigid Motion"
    assert "A later one" in rig.pose.bones["Lower"].constraints
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[1].co_ui.y += 1.0
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)


def test_what_an_overridden_rig_keeps_on_bones_is_read_again_from_a_library_that_knows_nothing_of_modes(
    library, tmp_path
):
    on_a_farm(
        "rig = bpy.data.objects['Puppet']\n[bone.pop('rigid_motion', None) for bone in rig.pose.bones]\n" + SAVE_AS,
        library,
        library,
    )
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    hand = rig.pose.bones["Hand"]
    bake(hand)
    hand.constraints.new("LIMIT_SCALE")
    lower = rig.pose.bones["Lower"]
    lower.constraints.remove(lower.constraints["Rigid Motion"])
    bpy.context.view_layer.update()
    rig = reopened(save(tmp_path / "shot.blend"), "Puppet")
    assert [bool(bone.rigid_motion.mounted) for bone in rig.pose.bones] == [
        bone.name != "Hand" for bone in rig.pose.bones
    ]
    assert "Rigid Motion" not in rig.pose.bones["Lower"].constraints
    assert is_baked(rig.pose.bones["Hand"])
    unbake(rig.pose.bones["Hand"])
    assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:1])) == ["dq_sclerp"]


def test_an_overridden_rig_gives_its_modes_up_again(library, tmp_path):
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    rig = reopened(save(tmp_path / "shot.blend"), "Puppet")
    set_mode(list(rig.pose.bones), "BLENDER")
    rig = reopened(save(tmp_path / "shot.blend"), "Puppet")
    assert [c.name for c in rig.pose.bones["Hand"].constraints] == ["The library's own"]
    assert_posed(rig, PLAYED)


def test_a_rig_is_appended_with_its_modes(library):
    with bpy.data.libraries.load(str(library), link=False) as (_, expected):
        expected.objects = ["Rig"]
    rig = bpy.data.objects["Rig"]
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.update()
    assert_posed(rig, PLAYED)
    set_mode(rig.pose.bones["Hand"], "pga_lerp")
    assert_posed(rig, PLAYED)
