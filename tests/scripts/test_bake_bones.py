"""Tests of bake.py on rigs: bones are baked and restored like objects, chosen by name, and reported rig by rig."""

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import is_baked, set_mode
from tests.animation.farm import played_on_a_farm
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import FRAMES, key, new_object
from tests.scripts.baking import extension, new_file, open_again, run, save
from tests.scripts.recordings.blends import rig

PLAYED = np.arange(0.0, 46.0)
"""Frames from before the first key until after the last."""

NAMES = ("Root", "Arm", "Hand", "Thumb", "Index")
"""Bones: each is the child of the one before, but both fingers are children of the hand."""


def new_rig() -> bpy.types.Object:
    """Return an armature with keyed bones, and an empty at the end of each, "Rig at BONE", that shows its place."""
    parents = (None, "Root", "Arm", "Hand", "Hand")
    places = [((0.0, 0.1 * number, number), (0.0, 0.1 * number, number + 1.0)) for number in range(len(NAMES))]
    bones = {name: (*place, parent) for name, place, parent in zip(NAMES, places, parents, strict=True)}
    result = rig("Rig", bones)
    random = np.random.default_rng(3)
    for number, bone in enumerate(result.pose.bones):
        bone.rotation_mode = "XYZ" if number == 1 else "QUATERNION"
        rotation = "rotation_euler" if number == 1 else "rotation_quaternion"
        for frame in FRAMES:
            bone.location, turned = random.normal(size=3), random.normal(size=3 if number == 1 else 4)
            setattr(bone, rotation, turned)
            bone.keyframe_insert("location", frame=frame)
            bone.keyframe_insert(rotation, frame=frame)
        probe = new_object(f"Rig at {bone.name}")
        probe.parent, probe.parent_type, probe.parent_bone = result, "BONE", bone.name
    return result


def rig_file(path: Path, edit: Callable[[bpy.types.Object], object] = lambda rig: None) -> Path:
    """Save a file with a moving rig; all bones but one have a mode, one bone a different mode in one segment."""
    with extension():
        new_file()
        rig = new_rig()
        key(rig, (5.0, 30.0))
        set_mode([rig, *(bone for bone in rig.pose.bones if bone.name != "Thumb")], "dq_sclerp")
        set_mode(rig.pose.bones["Arm"], "motor_spline", FRAMES[1:2])
        edit(rig)
        bpy.context.scene.frame_set(17)
        return save(path)


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with an unedited rig."""
    return rig_file(tmp_path_factory.mktemp("shot") / "shot.blend")


def baked_bones(rig: bpy.types.Object) -> list[str]:
    return [bone.name for bone in rig.pose.bones if is_baked(bone)]


def probes() -> list[str]:
    return [f"Rig at {name}" for name in NAMES]


def test_a_baked_rig_plays_in_any_blender_as_the_live_one_does_with_the_extension(shot, tmp_path):
    assert run(shot, "--output", tmp_path) == 0
    with extension():
        open_again(shot)
        expected = shown_worlds([bpy.data.objects[name] for name in ("Rig", *probes())], PLAYED)
    played = played_on_a_farm(tmp_path / "shot-baked.blend", ("Rig", *probes()), PLAYED).worlds
    np.testing.assert_allclose(played, expected, atol=1e-4)


@pytest.mark.any_blender
@pytest.mark.parametrize(
    ("asked", "bones", "itself"),
    [
        ("Rig", ["Root", "Arm", "Hand", "Index"], True),
        ("Rig/*", ["Root", "Arm", "Hand", "Index"], False),
        ("*/Root,Rig/?rm", ["Root", "Arm"], False),
    ],
)
def test_bones_can_be_chosen_by_rig_and_by_names_and_patterns(shot, tmp_path, asked, bones, itself):
    assert run(shot, "--objects", asked, "--output", tmp_path) == 0
    with extension():
        open_again(tmp_path / "shot-baked.blend")
        rig = bpy.data.objects["Rig"]
        assert (baked_bones(rig), is_baked(rig)) == (bones, itself)


@pytest.mark.any_blender
def test_what_cannot_be_baked_of_a_rig_is_named_by_bone_and_the_others_go_on(tmp_path, capsys):
    def edit(rig: bpy.types.Object) -> None:
        index = rig.pose.bones["Index"].path_from_id("location")
        curves_of(rig)[index, 0].modifiers.new("ENVELOPE")
        for name in ("location", "rotation_quaternion", "scale"):
            for item in rig.driver_add(rig.pose.bones["Hand"].path_from_id(name)):
                item.driver.expression = "frame"
        for point in curves_of(rig)[rig.pose.bones["Arm"].path_from_id("location"), 0].keyframe_points:
            point.co_ui.x -= 100.0

    path = rig_file(tmp_path / "shot.blend", edit)
    assert run(path, "--objects", "Rig/*") == 1
    lines = capsys.readouterr().err.splitlines()
    refused = {line.removeprefix(f"{path}: Rig/").partition(":")[0]: line for line in lines if "not baked" in line}
    assert list(refused) == ["Hand", "Index"]
    assert "Location X is driven" in refused["Hand"]
    assert "Location X has an Envelope" in refused["Index"]
    assert f"{path}: Rig: 2 bones baked, " in "\n".join(lines)
    assert lines[-1] == "2 bones baked, 2 not."
