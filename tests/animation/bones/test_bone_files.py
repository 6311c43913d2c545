"""Files with modes on bones, linked, overridden and played without the extension."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake, is_baked, modes_of, problem_of, set_mode, unbake
from tests.animation.bones.poses import Poses, assert_posed, assert_same_poses, expected_poses, names_of, shown_poses
from tests.animation.bones.rigs import BETWEEN, FRAMES, PLAYED, key_all, moving_rig, new_rig
from tests.animation.farm import on_a_farm, played_on_a_farm
from tests.animation.keyed import curves_of
from tests.animation.scenes import linked


def save(path: Path) -> Path:
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    return path


def reopened(path: Path, name: str = "Rig") -> bpy.types.Object:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return bpy.data.objects[name]


def posed_on_a_farm(path: Path, rig: bpy.types.Object) -> Poses:
    """The bones on all frames played."""
    return dict(zip(names_of(rig), played_on_a_farm(path, [rig.name], PLAYED).poses, strict=True))


class Library(NamedTuple):
    """A file with two rigs: one that moves in a mode, and one without any keys."""

    path: Path
    moved: Poses


@pytest.fixture
def library(live_file, tmp_path) -> Library:
    rig = moving_rig("dq_sclerp", name="Rig")
    new_rig("Puppet")
    result = Library(save(tmp_path / "library.blend"), expected_poses(rig, BETWEEN))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    return result


def overridden(library: Library, name: str) -> bpy.types.Object:
    """A rig of the library that this file may animate."""
    rig = linked(library.path, name).override_create(remap_local_usages=True)
    rig.override_library.is_system_override = False
    bpy.context.view_layer.update()
    return rig


def test_a_linked_rig_shows_the_modes_of_its_library(library, tmp_path):
    rig = linked(library.path, "Rig")
    with pytest.raises(ValueError, match="linked from another file"):
        set_mode(list(rig.pose.bones), "pga_lerp")
    for path in (None, save(tmp_path / "shot.blend")):
        rig = rig if path is None else reopened(path)
        assert_same_poses(rig, BETWEEN, shown_poses([rig], BETWEEN)[0], library.moved)


def test_an_overridden_rig_takes_modes_that_stay_when_it_is_opened_again_and_when_its_library_changes(
    library, tmp_path
):
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    assert {problem_of(pose_bone) for pose_bone in rig.pose.bones} == {""}
    expected = expected_poses(rig, PLAYED)
    assert_posed(rig, BETWEEN)
    path = save(tmp_path / "shot.blend")
    assert_same_poses(rig, PLAYED, posed_on_a_farm(path, rig), expected)
    change = """
rig = bpy.data.objects["Puppet"]
bpy.context.view_layer.objects.active = rig
bpy.ops.object.mode_set(mode="EDIT")
rig.data.edit_bones["Upper"].tail = (0.2, 0.5, 1.9)
rig.data.edit_bones.new("Finger").tail = (0.1, 0.2, 0.3)
bpy.ops.object.mode_set(mode="OBJECT")
bpy.ops.wm.save_as_mainfile(filepath=found)
"""
    for changed in (False, True):
        rig = reopened(path, "Puppet")
        assert rig.override_library is not None
        assert ("Finger" in rig.pose.bones) == changed
        assert_posed(rig, BETWEEN)
        assert modes_of(rig.pose.bones["Hand"], np.array(FRAMES[:1])) == ["dq_sclerp"]
        on_a_farm(change, library.path, library.path)
    curves_of(rig.pose.bones["Hand"])["location", 0].keyframe_points[1].co_ui.y += 1.0
    bpy.context.view_layer.update()
    assert_posed(rig, BETWEEN)


def test_a_bone_of_an_overridden_rig_that_was_baked_is_unbaked_after_the_file_was_opened_again(library, tmp_path):
    rig = key_all(overridden(library, "Puppet"))
    set_mode(list(rig.pose.bones), "dq_sclerp")
    bake(rig.pose.bones["Hand"])
    rig = reopened(save(tmp_path / "shot.blend"), "Puppet")
    hand = rig.pose.bones["Hand"]
    assert [is_baked(bone) for bone in rig.pose.bones] == [bone == hand for bone in rig.pose.bones]
    unbake(hand)
    assert modes_of(hand, np.array(FRAMES[:1])) == ["dq_sclerp"]
    assert_posed(rig, BETWEEN)
