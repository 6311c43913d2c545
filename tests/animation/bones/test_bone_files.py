"""Files with modes on bones, linked, overridden and appended."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, modes_of, problem_of, set_mode, unbake
from tests.animation.bones.poses import assert_posed, assert_same_poses, expected_poses, names_of
from tests.animation.bones.rigs import FRAMES, PLAYED, key_all, moving_rig, new_rig
from tests.animation.farm import SAVE, on_a_farm, played_on_a_farm
from tests.animation.keyed import curves_of
from tests.animation.scenes import linked


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def reopened(path: Path, name: str = "Rig") -> bpy.types.Object:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects[name]


def posed_on_a_farm(path: Path, rig: bpy.types.Object) -> dict[str, np.ndarray]:
    """The bones on all frames played."""
    return dict(zip(names_of(rig), played_on_a_farm(path, [rig.name], PLAYED).poses, strict=True))


@pytest.fixture
def library(live_file, tmp_path) -> Path:
    """A file with two rigs: one that moves in a mode, and one without any keys."""
    moving_rig("dq_sclerp", name="Rig")
    new_rig("Puppet").pose.bones["Hand"].constraints.new("LIMIT_SCALE").name = "The library's own"
    path = save(tmp_path / "library.blend")
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return path


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


def test_an_overridden_rig_takes_modes_and_has_them_when_the_file_is_opened_again(library, tmp_path):
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    assert [c.name for c in rig.pose.bones["Hand"].constraints] == ["Rigid Motion", "The library's own"]
    expected = expected_poses(rig, PLAYED)
    assert_posed(rig, PLAYED)
    path = save(tmp_path / "shot.blend")
    assert_same_poses(rig, PLAYED, posed_on_a_farm(path, rig), expected)
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
        "rig = bpy.data.objects['Puppet']\n[bone.pop('rigid_motion', None) for bone in rig.pose.bones]\n" + SAVE,
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
