"""Tests of whole bodies in FBX and glTF files, exported here or by other programs, against Blender's matrices."""

import base64
import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.poses import inverse, placed
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.recordings import Trajectory, read_trajectories, recordings, scene_bodies
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.fbx import FIRST_RECORD_BYTE
from rigid_motion_batch.scenes.armature import RestFigure
from rigid_motion_batch.scenes.physique import body_size
from rigid_motion_batch.silencing import silenced
from tests.scripts.recordings.blends import (
    BONES,
    CARRYING,
    FRAMES,
    TRIANGLES,
    added,
    animate,
    body,
    export,
    key,
    on_frames,
    places_in_blender,
    rig,
    skinned,
    surface_in_blender,
)
from tests.scripts.recordings.glbs import curved, soldier

bpy = pytest.importorskip("bpy")
image_utils = pytest.importorskip("bpy_extras.image_utils")
node_shader_utils = pytest.importorskip("bpy_extras.node_shader_utils")

ENDINGS = [".fbx", ".glb", ".gltf"]

SINGLE = 2e-6
"""Tolerance in metres for a body of 2 m: single precision in files and Blender, through a chain of four bones."""


def whole(source: object) -> Trajectory:
    (trajectory,) = read_trajectories(str(source)).trajectories
    assert trajectory.rest_body is not None
    return trajectory


def in_world(trajectory: Trajectory) -> Poses:
    """Return the poses of joints in the world, shape (joints, n)."""
    return trajectory.rest_body.skeleton.in_root_space(trajectory.poses)


def places(trajectory: Trajectory, joints: tuple[str, ...] = CARRYING) -> np.ndarray:
    return in_world(trajectory).positions[[trajectory.rest_body.joints.index(name) for name in joints]]


@pytest.fixture
def exported(scene: object, tmp_path: Path):
    """A function that exports a body, and returns the file and the joint positions in Blender."""

    def _exported(ending: str, **settings: object) -> tuple[Path, np.ndarray]:
        obj = body(**settings)
        skinned(obj)
        seen = places_in_blender(obj)
        return export(tmp_path / f"walk{ending}"), seen

    return _exported


@pytest.mark.parametrize(("ending", "fps"), [(".fbx", 30), (".fbx", 60), (".glb", 24), (".gltf", 30)])
def test_joints_are_where_blender_showed_them_before_the_export(exported, ending: str, fps: int) -> None:
    path, seen = exported(ending, fps=fps)
    walk = whole(path)
    assert walk.name == "walk"
    assert walk.poses.shape == (len(BONES), len(FRAMES))
    assert walk.poses.scales is None
    np.testing.assert_allclose(walk.times, np.arange(len(FRAMES)) / fps, rtol=1e-12)
    np.testing.assert_allclose(places(walk), seen, atol=SINGLE)
    names = *walk.rest_body.joints, None
    for name, parent in zip(names, walk.rest_body.parents, strict=False):
        assert names[parent] == BONES[name][2]
    assert (np.einsum("jni,jni->jn", walk.poses.quaternions[:, 1:], walk.poses.quaternions[:, :-1]) > 0.0).all()


@pytest.mark.parametrize("ending", [".fbx", ".glb", ".blend"])
def test_the_skin_moves_with_its_joints_as_in_blender(scene, tmp_path: Path, ending: str) -> None:
    obj = body(size=(0.5, 0.5, 0.5))
    surface = surface_in_blender(skinned(obj))
    walk = on_frames(whole(export(tmp_path / f"walk{ending}")))
    skin, rest = walk.rest_body.skin, walk.rest_body.rest
    moved = placed(in_world(walk), inverse(rest[:, None]))
    carried = moved.positions[skin.joints] + np.stack(
        [rotate(moved.quaternions[joints], skin.vertices[:, None]) for joints in skin.joints.T], axis=1
    )
    shown = np.einsum("vc,vcni->vni", skin.weights, carried)
    # An exporter may have split vertices: each of its vertices belongs to one of Blender's.
    nearest = np.argmin(np.linalg.norm(shown[:, None, 0] - surface[None, :, 0], axis=-1), axis=1)
    np.testing.assert_allclose(shown, surface[nearest], atol=SINGLE)
    assert set(nearest[skin.triangles].ravel()) == {corner for triangle in TRIANGLES for corner in triangle}
    np.testing.assert_allclose(skin.weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(np.sort(skin.weights, axis=1), [[0.0, 0.0, 0.25, 0.75]] * len(skin.weights), atol=1e-6)


@pytest.mark.parametrize("ending", [".glb", ".blend"])
def test_a_body_is_as_large_as_its_joints_wherever_an_importer_has_its_bones_end(scene, tmp_path: Path, ending) -> None:
    path = soldier().write(tmp_path / "soldier.glb")
    if ending == ".blend":
        with silenced():
            bpy.ops.import_scene.gltf(filepath=str(path))
        (obj,) = (obj for obj in bpy.data.objects if obj.type == "ARMATURE")
        assert max(obj.dimensions) > 15.0, "Blender has the bones of joints without children end far away"
        path = export(path.with_suffix(".blend"))
    recording = read_trajectories(str(path))
    (result,) = recording.trajectories
    assert (result.metres_per_unit, recording.note, result.warnings) == (1.0, "", ())
    assert np.linalg.norm(result.rest_body.tails, axis=-1).max() < 1.0
    assert (result.rest_body.ends is None) == (ending == ".glb"), "an importer made up where bones end"
    rest = RestFigure.of(make_clip(result, str(path), "soldier", "blender"))
    assert body_size(rest) == pytest.approx(1.45, abs=0.01)
    assert rest.joints.positions[:, 2].min() < 0.3, "the ground is below its feet, and not below the ends of bones"
    far = replace(rest, tails=rest.joints.positions + np.array([0.0, 0.0, 40.0]))
    assert body_size(far) == body_size(rest)


@pytest.mark.parametrize("ending", [".fbx", ".glb"])
def test_one_of_several_takes_is_taken_and_the_others_told(scene, tmp_path: Path, ending: str) -> None:
    obj = body()
    data, seen = obj.animation_data, {}
    for name, swing in (("Walk", 0.3), ("Run", 0.15)):
        animate(obj, swing)
        data.action.name = name
        seen[name] = places_in_blender(obj)
        track = data.nla_tracks.new()
        track.name, track.mute = name, True
        track.strips.new(name, 1, data.action).action_slot = data.action_slot
        data.action = None
    for track in data.nla_tracks:
        track.mute = False
    settings = {"bake_anim_use_all_actions": False} if ending == ".fbx" else {}
    recording = read_trajectories(str(export(tmp_path / f"walk{ending}", **settings)))
    (result,) = recording.trajectories
    taken = next(name for name in seen if f"took its take {name}" in recording.note.replace("Body|", ""))
    other = ({*seen} - {taken}).pop()
    assert other in recording.note.partition("others: ")[2]
    np.testing.assert_allclose(places(result), seen[taken], atol=SINGLE)


def test_images_of_an_fbx_are_not_looked_for(scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    obj = skinned(body())
    image = bpy.data.images.new("Picture", 4, 4)
    image.filepath_raw, image.file_format = str(tmp_path / "secret.png"), "PNG"
    image.save()
    obj.data.materials.append(bpy.data.materials.new("Painted"))
    painted = node_shader_utils.PrincipledBSDFWrapper(obj.data.materials[0], is_readonly=False)
    painted.base_color_texture.image = image
    path = export(tmp_path / "walk.fbx", path_mode="ABSOLUTE")
    assert b"secret.png" in path.read_bytes()
    asked = []
    monkeypatch.setattr(image_utils, "load_image", lambda *arguments, **_: asked.append(arguments))
    whole(path)
    assert asked == []


def test_a_file_in_which_nothing_moves_is_told(scene, tmp_path: Path, refusal) -> None:
    added("Lamp")
    for ending in ENDINGS:
        path = export(tmp_path / f"lamp{ending}")
        assert refusal(str(path))[1].startswith("nothing moves in this file; export what moves, a skeleton or objects,")
    for ending in (".glb", ".gltf"):
        skinned(rig("Body", BONES))
        path = export(tmp_path / f"still{ending}")
        assert refusal(str(path))[1].startswith("nothing moves in this file; export what moves, a skeleton or objects,")


@pytest.mark.parametrize("ending", [*ENDINGS, ".blend"])
def test_what_is_no_such_file_is_told_in_one_line(write, refusal, ending: str) -> None:
    contents = (b"", b"junk", b"; FBX 7.3.0 project file\n", b"glTF", b"{}", b"[" * 9999, b"\xff")
    for content in (*contents, b"BLENDER-v405" + bytes(500), b"\x28\xb5\x2f\xfd" + bytes(50)):
        _, message = refusal(write(f"walk{ending}", content))
        assert ending != ".blend" or message.startswith("Blender cannot open this file")


def test_a_joint_by_name_is_sampled_alike_whatever_unit_its_body_is_in(tmp_path: Path) -> None:
    metres = curved().write(tmp_path / "metres.glb")
    centimetres = replace(curved(0.01), size=1.0).write(tmp_path / "centimetres.glb")
    tips = [read_trajectories(f"{path}:Joint3").trajectories[0] for path in (metres, centimetres)]
    assert len(tips[0].times) == len(tips[1].times)
    np.testing.assert_allclose(100.0 * tips[0].poses.positions, tips[1].poses.positions, atol=1e-2)


def test_too_much_is_refused(exported, refusal, monkeypatch: pytest.MonkeyPatch) -> None:
    path, _ = exported(".glb")
    monkeypatch.setattr(scene_bodies, "LARGEST_FILE", 100)
    assert "bytes are more than the 100 that are read; " in refusal(str(path))[1]
    beside, _ = exported(".gltf")
    monkeypatch.setattr(scene_bodies, "LARGEST_FILE", beside.stat().st_size)
    assert "that are read; export the skeleton without its meshes" in refusal(str(beside))[1]
    monkeypatch.undo()
    monkeypatch.setattr(recordings, "MOST_POSES", 99)
    assert refusal(str(path))[1].startswith("5 joints in 20 frames are more than 99 poses; export fewer joints, or ")
    assert len(read_trajectories(f"{path}:Hand").trajectories) == 1


def test_an_fbx_that_claims_more_than_it_holds_is_refused_before_room_is_made_for_it(exported, refusal) -> None:
    path, _ = exported(".fbx")
    content = path.read_bytes()
    damaged = bytearray(content)
    struct.pack_into("<I", damaged, FIRST_RECORD_BYTE + 4, 2**32 - 1)
    path.write_bytes(damaged)
    assert refusal(str(path))[1].startswith("this FBX is damaged (a part of it is longer than the whole); ")

    def record(packed: bytes, expected: int) -> bytes:
        numbers = b"d" + struct.pack("<III", expected, 1, len(packed)) + packed
        end = FIRST_RECORD_BYTE + 13 + 1 + len(numbers)
        return content[:FIRST_RECORD_BYTE] + struct.pack("<IIIB", end, 1, len(numbers), 1) + b"N" + numbers + bytes(13)

    for packed, expected in ((zlib.compress(bytes(1 << 26)), 8), (b"x" * 20, 1 << 20), (zlib.compress(b""), 2**32 - 1)):
        path.write_bytes(record(packed, expected))
        assert " is not as long as it says" in (said := refusal(str(path))[1]) or "more than" in said
    path.write_bytes(record(zlib.compress(bytes(1 << 26)), 1 << 23))
    assert refusal(str(path))[1].startswith("Blender cannot import this file ("), "which is sound, and no skeleton"


def test_a_gltf_gets_its_buffers_from_its_folder_and_from_itself(exported, refusal) -> None:
    path, seen = exported(".gltf")
    document, data = json.loads(path.read_text()), path.with_suffix(".bin").read_bytes()
    path.with_suffix(".bin").unlink()
    assert refusal(str(path))[1] == (
        "buffer 0, 'walk.bin', is not there; bring that file along, or export it as .glb, which is one file"
    )
    (path.parent / "a b").mkdir()
    (path.parent / "a b" / "data").write_bytes(data)
    packed = base64.b64encode(data).decode()
    for uri in ("a%20b/data", "./a b/../a b/data", f"data:application/octet-stream;base64,{packed}"):
        document["buffers"][0]["uri"] = uri
        path.write_text(json.dumps(document))
        np.testing.assert_allclose(places(whole(path)), seen, atol=SINGLE)


def test_the_larger_armature_is_taken_and_the_other_told(scene, tmp_path: Path) -> None:
    body()
    small = rig("Bird", {"Wing": ((0, 0, 0), (0, 1, 0), None)})
    for frame in FRAMES:
        key(small.pose.bones["Wing"], frame, location=(0, frame, 0))
    path = export(tmp_path / "walk.fbx")
    recording = read_trajectories(str(path))
    assert recording.trajectories[0].rest_body.joints == tuple(BONES)
    assert recording.note == "took Body of 2 bodies; others: Bird"
    assert whole(f"{path}:Bird").rest_body.joints == ("Wing",)
    assert read_trajectories(f"{path}:Bird/Wing").trajectories[0].poses.shape == (len(FRAMES),)
