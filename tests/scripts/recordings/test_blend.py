"""Tests of reading objects, bones and whole rigs from .blend files made with bpy, against Blender's own matrices."""

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion_batch.recordings import Trajectory, read_trajectories
from tests.scripts.recordings.blends import FPS, added, bones_in_blender, fcurves, key, linear, on_frames, rig
from tests.thoroughness import sample

bpy = pytest.importorskip("bpy")


def moving(name: str) -> bpy.types.Object:
    obj = added(name)
    key(obj, 1, location=(0, 0, 0))
    key(obj, 9, location=(1, 0, 0))
    return obj


def test_the_animated_objects_are_told_and_still_ones_are_not(saved) -> None:
    added("Lamp")
    moving("Ball")
    moving("Camera")
    key(added("Painted"), 1, color=(1, 0, 0, 1))
    path = saved()
    recording = read_trajectories(path)
    assert [trajectory.name for trajectory in recording.trajectories] == ["Ball"]
    assert recording.others == ("Camera",)
    assert [trajectory.name for trajectory in read_trajectories(path + ":*").trajectories] == ["Ball", "Camera"]
    (lamp,) = read_trajectories(path + ":Lamp").trajectories
    np.testing.assert_array_equal(lamp.poses.positions, np.zeros((30, 3)))


def test_scale_and_unit_are_told(saved, scene: bpy.types.Scene) -> None:
    scene.unit_settings.scale_length = 0.01
    obj = added("Balloon")
    key(obj, 1, scale=(1, 1, 1))
    key(obj, 5, scale=(3, 3, 3))
    (trajectory,) = read_trajectories(saved()).trajectories
    np.testing.assert_allclose(trajectory.poses.scales[[0, -1]], [1, 3], atol=1e-6)
    assert trajectory.metres_per_unit == pytest.approx(0.01)


def test_what_is_open_stays_as_it_is(saved) -> None:
    key(added("Ball"), 1, location=(0, 0, 0))
    path = saved()
    bpy.context.scene.frame_set(7)
    added("Ball")

    def state() -> tuple:
        names = sorted(repr(block) for block in bpy.data.user_map())
        return names, bpy.data.filepath, bpy.context.scene.name, bpy.context.scene.frame_current

    before = state()
    read_trajectories(path + ":*")
    assert state() == before


@pytest.mark.parametrize("allowed", [False, True])
def test_no_script_of_the_file_is_run(saved, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, allowed: bool) -> None:
    trace = tmp_path / "trace"
    driver = added("Driven").driver_add("location", 0).driver
    driver.expression = f"len(__import__('pathlib').Path({str(trace)!r}).write_text('run') * [0]) + 1"
    text = bpy.data.texts.new("startup.py")
    text.write(f"open({str(trace)!r}, 'w')")
    text.use_module = True
    path = saved()
    trace.unlink(missing_ok=True)
    preferences = bpy.context.preferences.filepaths
    monkeypatch.setattr(preferences, "use_scripts_auto_execute", allowed)
    read_trajectories(path + ":Driven")
    assert preferences.use_scripts_auto_execute == allowed
    assert not trace.exists()


def test_a_file_without_animation_is_answered_with_its_objects(saved, refusal) -> None:
    added("Lamp")
    _, message = refusal(saved())
    assert message.startswith("no moving body in this file; name one with ")
    assert message.endswith(":NAME: Lamp")


@pytest.mark.parametrize("frame", [1.9e35, -2e6, float("inf")])
def test_a_key_where_no_frame_is_costs_no_hours(saved, refusal, frame: float) -> None:
    drill = moving("Drill")
    fcurves(drill)[0].keyframe_points[0 if frame < 0.0 else 1].co.x = frame
    _, message = refusal(saved())
    assert message.startswith("'Drill' moves from frame ")
    assert message.endswith("where Blender does not go; delete the keys that are far off")


def test_a_name_that_is_no_text_is_told(saved, refusal) -> None:
    moving("Drill")
    path = Path(saved())
    content = path.read_bytes()
    assert b"OBDrill\0" in content
    path.write_bytes(content.replace(b"OBDrill\0", b"OB\xff\xfell\xff\0"))
    assert refusal(str(path))[1] == "a name in this file is not text; save it again from Blender"


bpy = pytest.importorskip("bpy")

ARM = {"Upper": ((0, 0, 0), (0, 1, 0), None), "Lower": ((0, 1, 0), (0, 2, 0), "Upper")}
"""Bones along y, whose axes equal the armature's."""

HAND = {"Hand": ((0, 2, 0), (1, 2, 0), "Lower")}
"""A bone along x: a quarter turn backwards about z."""

BONES = ("Upper", "Lower", "Hand")


def read(source: str) -> Trajectory:
    (trajectory,) = read_trajectories(source).trajectories
    return on_frames(trajectory)


def assert_are(trajectory: Trajectory, expected: np.ndarray) -> None:
    """Check positions, rotations and scales against matrices, shape (n, 4, 4); scales are the lengths of the axes."""
    lengths = np.linalg.norm(expected[:, :3, 0], axis=1)
    rotations = Rotation.from_matrix(expected[:, :3, :3] / lengths[:, None, None])
    result = Rotation.from_quat(trajectory.poses.quaternions, scalar_first=True)
    np.testing.assert_allclose(trajectory.poses.positions, expected[:, :3, 3], atol=3e-6)
    np.testing.assert_allclose((result * rotations.inv()).magnitude(), 0.0, atol=3e-6)
    scales = 1.0 if trajectory.poses.scales is None else trajectory.poses.scales
    np.testing.assert_allclose(lengths, scales, atol=3e-6)


def waving(name: str = "Rig") -> bpy.types.Object:
    """Add a rig with keys on two of its bones."""
    arm = rig(name, ARM | HAND)
    for frame in (1, 9):
        key(arm.pose.bones["Lower"], frame, rotation_euler=(0, 0, frame / 9))
        key(arm.pose.bones["Hand"], frame, location=(0, frame, 0))
    linear(arm)
    return arm


def test_a_bone_moves_in_the_world_as_its_chain_and_its_object_do(saved) -> None:
    arm = rig("Rig", ARM | HAND)
    upper, lower, hand = arm.pose.bones
    for frame in (1, 21):
        key(upper, frame, rotation_euler=(0, 0, np.radians(3.0 * frame)))
    for frame in (5, 11):
        key(lower, frame, rotation_euler=(np.radians(10.0 * frame), 0, 0), location=(0.1 * frame, 0, 0))
        key(hand, frame, location=(0, 0, 0.2 * frame), scale=(0.1 * frame,) * 3)
    for frame in (3, 13):
        key(arm, frame, location=(frame, -1, 0), scale=(2, 2, 2))
    linear(arm)
    (expected,) = bones_in_blender(arm, ("Hand",), range(1, 22))
    trajectory = read(saved() + ":Rig/Hand")
    assert trajectory.name == "Rig/Hand"
    np.testing.assert_allclose(trajectory.times * FPS, np.arange(1, 22), rtol=1e-15)
    assert_are(trajectory, expected)


@pytest.mark.parametrize("how", ["linked", "overridden", "overridden and animated anew"])
def test_rigs_of_libraries_can_be_read(saved, how: str) -> None:
    waving()
    library = saved("rig.blend")
    with bpy.data.libraries.load(library, link=True, relative=True) as (there, here):
        here.objects = there.objects
    (arm,) = here.objects
    bpy.context.scene.collection.objects.link(arm)
    if how != "linked":
        arm = arm.override_hierarchy_create(bpy.context.scene, bpy.context.view_layer)
        arm.override_library.is_system_override = False  # Blender 5.3 inserts no keys into system overrides.
        arm.location, arm.pose.bones["Upper"].rotation_euler = (0, 0, 7), (0, 0, np.radians(30))
    if how == "overridden and animated anew":
        arm.animation_data_clear()
        for frame in (1, 9):
            key(arm.pose.bones["Hand"], frame, location=(0, 2 * frame, 0))
    bpy.context.view_layer.update()
    (expected,) = bones_in_blender(arm, ("Hand",), range(1, 10))
    assert_are(read(saved("shot.blend") + ":Rig/Hand"), expected)


ODD = [
    *("Arm/Hand", "/", "Hand/", "//Hand", "..", "../../../escaped", "/etc/passwd", "C:\\Hand", "a:b", "Hand.001"),
    *('say "hand"', "it's", '"]["', "back\\slash\\", "*", " ", "\u00fcbung \u624b", "a\nb", "\x1b[2J", "$(touch x)"),
]


@pytest.mark.parametrize("name", sample(ODD))
def test_bones_and_rigs_may_be_called_anything(saved, name: str) -> None:
    arm = rig(name, {"Hand": ((0, 0, 0), (0, 1, 0), None), name: ((0, 1, 0), (0, 2, 0), None)})
    assert (arm.name, arm.data.bones[1].name) == (name, name)
    for frame in (3, 8):
        key(arm.pose.bones[name], frame, location=(frame, 0, 0))
    linear(arm)
    path = saved()
    trajectory = read(f"{path}:{name}/{name}")
    assert trajectory.name == f"{name}/{name}"
    np.testing.assert_allclose(trajectory.poses.positions, [(frame, 1, 0) for frame in range(3, 9)], atol=3e-6)
    assert read(path).rest_body.joints == ("Hand", name)


def test_a_missing_bone_is_answered_with_the_nearest_and_what_there_is(saved, refusal) -> None:
    waving()
    path = saved()
    assert refusal(f"{path}:Rig/Hant")[1] == (
        "no body named 'Rig/Hant': did you mean Rig/Hand?; it holds Rig, Rig/Lower, Rig/Hand"
    )
    assert refusal(f"{path}:Hand")[1] == "no body named 'Hand'; it holds Rig, Rig/Lower, Rig/Hand"


def places(trajectory: Trajectory) -> np.ndarray:
    """Return the joint positions of a whole body in the world, shape (joints, n, 3)."""
    return trajectory.rest_body.skeleton.in_root_space(trajectory.poses).positions


def test_an_armature_whose_bones_move_is_a_whole_body(saved) -> None:
    arm = waving()
    arm.location, arm.scale = (3, 0, 0), (2, 2, 2)
    expected = bones_in_blender(arm, BONES, range(1, 10))
    path = saved()
    for source in (path, f"{path}:Rig"):
        recording = read_trajectories(source)
        (body,) = recording.trajectories
        assert (body.name, recording.note) == ("Rig", "")
        assert body.rest_body.joints == ("Upper", "Lower", "Hand")
        assert body.rest_body.parents.tolist() == [-1, 0, 1]
        assert body.poses.scales is None
        np.testing.assert_allclose(body.times * FPS, range(1, 10))
        np.testing.assert_allclose(places(body), expected[..., :3, 3], atol=2e-6)
        np.testing.assert_allclose(body.rest_body.rest.positions, [[3, 0, 0], [3, 2, 0], [3, 4, 0]], atol=1e-6)
        np.testing.assert_allclose(body.rest_body.tails, [[0, 2, 0]] * 3, atol=1e-6)
        np.testing.assert_allclose(body.rest_body.ends, [0, 0, 2], atol=1e-6)


def test_of_a_rig_the_bones_count_that_deform(saved) -> None:
    arm = rig("Rig", ARM | HAND | {"Lever": ((0, 0, 1), (0, 0, 2), "Upper")})
    for frame in (1, 9):
        key(arm.pose.bones["Lower"], frame, rotation_euler=(0, 0, frame / 9))
    for name in ("Lower", "Lever"):
        arm.data.bones[name].use_deform = False
    linear(arm)
    expected = bones_in_blender(arm, ("Upper", "Hand"), range(1, 10))
    recording = read_trajectories(saved())
    (body,) = map(on_frames, recording.trajectories)
    assert recording.note.startswith("took the 2 bones that deform of 4")
    assert body.rest_body.joints == ("Upper", "Hand")
    assert body.rest_body.parents.tolist() == [-1, 0], "the nearest that counts"
    np.testing.assert_allclose(places(body), expected[..., :3, 3], atol=2e-6)


def test_bones_that_are_mirrored_flattened_or_scaled_to_nothing_still_have_poses(saved) -> None:
    arm = rig("Rig", ARM | HAND)
    for frame in range(1, 10):
        key(arm.pose.bones["Upper"], frame, rotation_euler=(0, 0, frame / 9), scale=(1, 2, 0.5))
        key(arm.pose.bones["Hand"], frame, scale=(0.0 if frame > 5 else 1.0,) * 3)
    arm.scale = (-1, 1, 1)
    expected = bones_in_blender(arm, BONES, range(1, 10))
    body = read(saved())
    np.testing.assert_allclose(places(body), expected[..., :3, 3], atol=2e-6)
    np.testing.assert_allclose(np.linalg.norm(body.poses.quaternions, axis=-1), 1.0, atol=1e-12)


def test_a_rig_whose_bones_are_still_is_an_object(saved) -> None:
    arm = rig("Rig", ARM)
    key(arm, 1, location=(0, 0, 0))
    key(arm, 5, location=(0, 1, 0))
    path = saved()
    for source in (path, f"{path}:Rig", f"{path}:*"):
        assert read(source).rest_body is None
