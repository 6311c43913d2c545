"""reduce.py as people run it: how near what it writes is to what was there, what it leaves alone, what it says."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import MODE_IDS, key_frames, modes_of, write_channel
from rigid_motion.animation.transforms import transform_of
from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch import blend_files, reduce
from tests.animation.farm import on_a_farm, played_on_a_farm
from tests.animation.oracle import curves_of
from tests.animation.scenes import new_object
from tests.recordings import RECORDINGS
from tests.scripts.baking import extension, new_file, open_again, save
from tests.scripts.bvh_bodies import write_body

ROOT = Path(__file__).resolve().parents[2]

FRAMES = np.arange(1.0, 91.0)
"""Of the dense keys in the scenes."""

RADIUS = 0.1
"""Metres: what is looked at around an origin, where the size of a thing does not say."""

ROUNDING = 2e-5
"""Metres: single precision of matrices, through a chain of bones."""

BALL = RADIUS * normalise(np.random.default_rng(5).normal(size=(64, 3)))
"""Points that far from an origin, in all directions."""


def run(*arguments: object) -> int:
    return reduce.main([str(argument) for argument in arguments])


def exit_code(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        run(*arguments)
    return ended.value.code


def swing(count: int, seed: int = 0) -> Poses:
    """A smooth motion through half a metre and a turn, faster and slower by turns, of so many poses."""
    random = np.random.default_rng(seed)
    phases = np.linspace(0.0, 5.0, count)[:, None] * random.uniform(0.5, 1.5, 3) + random.uniform(0.0, 6.0, 3)
    angles = np.linspace(0.0, 3.0, count) + 0.2 * np.sin(np.linspace(0.0, 12.0, count))
    axis = normalise(random.normal(size=3))
    turns = np.column_stack((np.cos(angles), np.sin(angles)[:, None] * axis))
    return Poses(0.5 * np.sin(phases), turns)


def key_densely(carrier: bpy.types.Object | bpy.types.PoseBone, poses: Poses, frames: np.ndarray = FRAMES) -> None:
    """A key of location and rotation on every frame, as a simulation or motion capture leaves them."""
    carrier.rotation_mode = "QUATERNION"
    animated = carrier.id_data
    prefix = transform_of(carrier).prefix
    write_channel(animated, f"{prefix}location", frames, poses.positions)
    write_channel(animated, f"{prefix}rotation_quaternion", frames, poses.quaternions)


def object_file(path: Path, *names: str) -> Path:
    """A file with objects that have a key on every frame, saved by a Blender without the extension."""
    new_file()
    for seed, name in enumerate(names or ("Tool",)):
        obj = new_object(name)
        obj.empty_display_size = RADIUS
        key_densely(obj, swing(len(FRAMES), seed))
    path.parent.mkdir(exist_ok=True)
    return save(path)


def rig_file(path: Path) -> Path:
    """A file with a chain of three bones that turn on every frame, and an empty at the end of each: "at BONE"."""
    new_file()
    data = bpy.data.armatures.new("Rig")
    rig = new_object("Rig", data=data)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    parent = None
    for number, name in enumerate(("Root", "Arm", "Hand")):
        bone = data.edit_bones.new(name)
        bone.head, bone.tail, bone.parent = (0.0, 0.0, 0.3 * number), (0.0, 0.0, 0.3 * number + 0.3), parent
        parent = bone
    bpy.ops.object.mode_set(mode="OBJECT")
    for seed, bone in enumerate(rig.pose.bones):
        key_densely(bone, swing(len(FRAMES), seed + 20))
        probe = new_object(f"at {bone.name}")
        probe.parent, probe.parent_type, probe.parent_bone = rig, "BONE", bone.name
    return save(path)


def reduced_name(path: Path) -> Path:
    return path.with_name(f"{path.stem}-reduced.blend")


def played(path: Path, *names: str) -> np.ndarray:
    """World matrices on all frames (objects, n, 4, 4), in a Blender that has never heard of the extension."""
    return played_on_a_farm(path, names, FRAMES)[1]


def displacement(worlds: np.ndarray, truth: np.ndarray, points: np.ndarray = BALL) -> float:
    """How far any of these points of an object is from where it was, on any frame."""
    offset = (worlds - truth)[..., :3, :]
    return float(np.linalg.norm(points @ offset[..., :3].swapaxes(-1, -2) + offset[..., None, :, 3], axis=-1).max())


def count_keys(carrier: bpy.types.Object | bpy.types.PoseBone) -> int:
    return len(curves_of(carrier)["location", 0].keyframe_points)


# .blend files


@pytest.mark.parametrize("mode", ["motor_spline", "dq_sclerp", "lerp_slerp"])
def test_an_object_with_few_keys_plays_within_the_tolerance_in_any_blender(tmp_path, mode):
    path = object_file(tmp_path / "shot.blend")
    before = path.read_bytes()
    assert run(path, "--tolerance", "5mm", "--mode", mode) == 0
    assert path.read_bytes() == before
    assert sorted(os.listdir(tmp_path)) == ["shot-reduced.blend", "shot.blend"]
    assert 0.0 < displacement(played(reduced_name(path), "Tool"), played(path, "Tool")) <= 5e-3 + ROUNDING
    with extension():
        open_again(reduced_name(path))
        tool = bpy.data.objects["Tool"]
        assert 2 < count_keys(tool) < len(FRAMES) / 2
        assert set(modes_of(tool, key_frames(tool)[:-1])) == {mode}


def test_the_larger_a_tolerance_or_the_smaller_a_radius_the_fewer_keys(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    counts = []
    for tolerance, radius in (("5mm", 1.0), ("5mm", 0.1), ("2cm", 0.1)):
        assert run(path, "--tolerance", tolerance, "--radius", radius, "--overwrite") == 0
        open_again(reduced_name(path))
        counts.append(count_keys(bpy.data.objects["Tool"]))
    assert counts == sorted(set(counts), reverse=True)


def test_a_tolerance_in_metres_is_that_in_a_scene_of_centimetres(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    bpy.context.scene.unit_settings.scale_length = 0.01
    save(path)
    assert run(path, "--tolerance", "0.05mm", "--radius", 1e-3) == 0
    off = displacement(played(reduced_name(path), "Tool"), played(path, "Tool"))
    assert 1e-3 < off <= 5e-3 + ROUNDING, "5 thousandths of a centimetre"


def test_a_rig_with_few_keys_plays_within_the_tolerance_in_any_blender(tmp_path, capsys):
    path = rig_file(tmp_path / "shot.blend")
    before, probes = path.read_bytes(), ("at Root", "at Arm", "at Hand")
    assert run(path, "--tolerance", "5mm") == 0
    assert path.read_bytes() == before
    at_ends = np.zeros((1, 3))  # The end of a bone is as far from its head as its radius.
    assert 0.0 < displacement(played(reduced_name(path), *probes), played(path, *probes), at_ends) <= 5e-3 + ROUNDING
    open_again(reduced_name(path))
    counts = [count_keys(bone) for bone in bpy.data.objects["Rig"].pose.bones]
    assert sum(counts) < 3 * len(FRAMES) / 2
    assert f"Rig: 3 bones reduced, {3 * len(FRAMES)} -> {sum(counts)} keys" in capsys.readouterr().err


def test_key_poses_are_on_the_same_frames_for_all_bones(tmp_path):
    path = rig_file(tmp_path / "shot.blend")
    assert run(path, "--tolerance", "1cm", "--shared") == 0
    open_again(reduced_name(path))
    frames = [
        [point.co.x for point in curves_of(bone)["location", 0].keyframe_points]
        for bone in bpy.data.objects["Rig"].pose.bones
    ]
    assert frames[0] == frames[1] == frames[2]
    assert len(frames[0]) < len(FRAMES)


def test_objects_and_bones_are_chosen_by_name(tmp_path, capsys):
    path = rig_file(tmp_path / "shot.blend")
    key_densely(new_object("Camera"), swing(len(FRAMES), 7))
    key_densely(new_object("Tool"), swing(len(FRAMES), 8))
    save(path)
    assert run(path, "--objects", "Camera,Rig/[AH]*", "--tolerance", "1cm") == 0
    open_again(reduced_name(path))
    rig = bpy.data.objects["Rig"]
    carriers = {"Camera": bpy.data.objects["Camera"], "Tool": bpy.data.objects["Tool"], **dict(rig.pose.bones.items())}
    assert {name for name, carrier in carriers.items() if count_keys(carrier) < len(FRAMES)} == {
        *("Camera", "Arm", "Hand")
    }
    assert "1 object and 2 bones reduced" in capsys.readouterr().err


def test_the_dense_keys_stay_in_the_file_for_restore_keys(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    assert run(path) == 0
    with extension():
        open_again(reduced_name(path))
        tool = bpy.data.objects["Tool"]
        animation.restore_keys(tool)
        assert count_keys(tool) == len(FRAMES)


def test_the_dense_keys_are_left_out_where_that_is_asked_for(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    assert run(path, "--discard") == 0
    with extension():
        open_again(reduced_name(path))
        assert not animation.is_reduced(bpy.data.objects["Tool"])
        assert [action.name for action in bpy.data.actions] == [bpy.data.objects["Tool"].animation_data.action.name]


def test_bones_that_need_their_keys_are_told_of_together(tmp_path, capsys):
    path = rig_file(tmp_path / "shot.blend")
    assert run(path, "--tolerance", "0.00001mm", "--shared") == 0
    assert "Rig: 3 bones are left as they are: its bones need their keys on all of 90 frames" in capsys.readouterr().err
    assert not reduced_name(path).exists()


def test_what_needs_its_keys_is_left_alone_and_nothing_is_wrong(tmp_path, capsys):
    path = object_file(tmp_path / "shot.blend")
    assert run(path, "--tolerance", "0.00001mm") == 0
    said = capsys.readouterr().err
    assert f"Tool is left as it is: needs its {len(FRAMES)} keys to stay within the tolerance: allow a larger" in said
    assert "nothing to be reduced; left alone" in said
    assert os.listdir(tmp_path) == ["shot.blend"]


def test_what_is_asked_for_by_name_and_has_no_keys_is_told_why(tmp_path, capsys):
    path = object_file(tmp_path / "shot.blend")
    still = new_object("Still")
    still.constraints.new("COPY_LOCATION").target = bpy.data.objects["Tool"]
    save(path)
    assert run(path, "--objects", "Still") == 1
    assert "Still: not reduced: has no keys of location, rotation or scale, constraints" in capsys.readouterr().err
    assert not reduced_name(path).exists()


def test_a_rig_in_other_units_than_the_tolerance_is_told_of(tmp_path, capsys):
    path = rig_file(tmp_path / "shot.blend")
    rig = bpy.data.objects["Rig"]
    rig.scale = (200.0,) * 3
    save(path)
    assert run(path, "--tolerance", "5mm") == 0
    assert "if these are centimetres, give --tolerance 0.5" in capsys.readouterr().err


def test_without_a_tolerance_a_rig_of_any_size_begins_with_one_that_fits_it(tmp_path):
    path = rig_file(tmp_path / "shot.blend")
    bpy.data.objects["Rig"].scale = (200.0,) * 3
    save(path)
    assert run(path) == 0
    open_again(reduced_name(path))
    assert sum(count_keys(bone) for bone in bpy.data.objects["Rig"].pose.bones) < 3 * len(FRAMES) / 2


# Recordings


def write_csv(path: Path, seconds: float = 2.0, rate: float = 90.0) -> tuple[np.ndarray, Poses]:
    """A recording in Blender's axes and metres, and what it is of."""
    times = np.arange(round(seconds * rate) + 1) / rate
    poses = swing(len(times), 3)
    rows = np.column_stack((times, poses.positions, poses.quaternions)).tolist()
    lines = ["t,x,y,z,qw,qx,qy,qz", *(",".join(map(repr, row)) for row in rows)]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
    return times, poses


def read_table(path: Path) -> tuple[np.ndarray, Poses]:
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    assert header == "t,x,y,z,qw,qx,qy,qz"
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    return rows[:, 0], Poses(rows[:, 1:4], rows[:, 4:])


def worlds_of(poses: Poses) -> np.ndarray:
    """Matrices (n, 4, 4), by the formula of unit quaternions and not by this program."""
    w, x, y, z = poses.quaternions.T
    worlds = np.zeros((len(w), 4, 4))
    worlds[:, 3, 3], worlds[:, :3, 3] = 1.0, poses.positions
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    worlds[:, :3, :3] = np.array(rows).transpose(2, 0, 1)
    return worlds


@pytest.mark.parametrize("mode", ["motor_spline", "dq_sclerp"])
def test_the_keys_of_a_recording_tell_its_motion_within_the_tolerance(tmp_path, capsys, mode):
    path = tmp_path / "hand.csv"
    times, poses = write_csv(path)
    before = path.read_bytes()
    assert run(path, "--tolerance", "5mm", "--mode", mode) == 0
    assert path.read_bytes() == before
    key_times, keys = read_table(tmp_path / "hand-keys.csv")
    assert 2 < len(key_times) < len(times) / 5
    assert set(key_times) <= set(times)
    filled = interpolate(key_times, keys, times, mode)
    assert 0.0 < displacement(worlds_of(filled), worlds_of(poses)) <= 5e-3
    said = capsys.readouterr()
    assert f"{path}: reduced, {len(times)} -> {len(key_times)} keys, " in said.err
    assert said.out == f"{tmp_path / 'hand-keys.csv'}\n"


@pytest.mark.parametrize("fps", [None, 30])
def test_as_a_blend_file_it_plays_like_the_recording_in_any_blender(tmp_path, fps):
    path = tmp_path / "hand.csv"
    times, poses = write_csv(path)
    assert run(path, "--tolerance", "5mm", "--blend", *(("--fps", fps) if fps else ())) == 0
    blend, step = tmp_path / "hand-keys.blend", 1 if fps is None else 90 // fps
    frames = np.arange(1.0, len(times[::step]) + 1.0)
    worlds = played_on_a_farm(blend, ["hand"], frames)[1][0]
    assert displacement(worlds, worlds_of(poses)[::step]) <= 5e-3 + ROUNDING
    with extension():
        open_again(blend)
        scene, obj = bpy.context.scene, bpy.data.objects["hand"]
        assert (scene.render.fps, scene.frame_start, scene.frame_end) == (fps or 90, 1, len(frames))
        assert count_keys(obj) == len(read_table(tmp_path / "hand-keys.csv")[0])
        assert set(modes_of(obj, key_frames(obj)[:-1])) == {"motor_spline"}


def test_frames_are_the_samples_of_a_recording_whose_rate_is_no_whole_number(tmp_path):
    path = tmp_path / "hand.csv"
    write_csv(path, rate=29.97)
    assert run(path, "--blend") == 0
    open_again(tmp_path / "hand-keys.blend")
    render, keys = bpy.context.scene.render, curves_of(bpy.data.objects["hand"])["location", 0].keyframe_points
    assert render.fps / render.fps_base == pytest.approx(29.97, rel=1e-6)
    assert all(key.co.x == round(key.co.x) for key in keys)


HEADS = """
for path, end in ((path, ".npy"), (recording, " imported.npy")):
    if path.endswith(".blend"):
        bpy.ops.wm.open_mainfile(filepath=path)
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        importer = bpy.ops.import_scene.fbx if path.endswith(".fbx") else bpy.ops.import_anim.bvh
        importer(filepath=path)
    scene = bpy.context.scene
    rig = max((obj for obj in bpy.data.objects if obj.type == "ARMATURE"), key=lambda obj: len(obj.pose.bones))
    first, last = (round(frame) for frame in rig.animation_data.action.frame_range)
    rows = []
    for frame in range(first, last + 1):
        scene.frame_set(frame)
        shown = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
        heads = {bone.name: shown.matrix_world @ bone.head for bone in shown.pose.bones}
        rows.append([heads[name] for name in sorted(heads)])
    np.save(found + end, np.array(rows))
"""


def heads_of(made: Path, recording: Path, tmp_path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Where all bones begin (frames, bones, 3): as a file plays, and as Blender itself imports the recording."""
    on_a_farm(f"recording = {str(recording)!r}\n{HEADS}", made, tmp_path / "heads")
    return np.load(tmp_path / "heads.npy"), np.load(tmp_path / "heads imported.npy")


def hand_made(folder: Path) -> Path:
    write_body(folder / "body.bvh")
    return folder / "body.bvh"


@pytest.mark.parametrize("options", [(), ("--shared",)])
@pytest.mark.parametrize(
    "recording",
    [
        hand_made,
        pytest.param(lambda _: RECORDINGS.parent / "rigs" / "pab_walk.fbx", marks=pytest.mark.recordings, id="walk"),
    ],
)
def test_a_whole_body_becomes_a_rig_that_plays_like_it_in_any_blender(tmp_path, recording, options):
    source = recording(tmp_path)
    assert run(source, "--tolerance", "5mm", "--output", tmp_path / "keyed", *options) == 0
    made = tmp_path / "keyed" / f"{source.stem}-keys.blend"
    assert os.listdir(made.parent) == [made.name]
    shown, imported = heads_of(made, source, tmp_path)
    assert shown.shape == imported.shape
    assert 0.0 < np.linalg.norm(shown - imported, axis=-1).max() <= 5e-3 + ROUNDING
    with extension():
        open_again(made)
        (rig,) = bpy.data.objects
        keyed = [bone for bone in rig.pose.bones if len(key_frames(bone))]
        assert sum(len(key_frames(bone)) for bone in keyed) < len(keyed) * len(shown)
        moving = [bone for bone in keyed if len(key_frames(bone)) > 1]
        assert moving
        assert {mode for bone in moving for mode in modes_of(bone, key_frames(bone)[:-1])} == {"motor_spline"}
        assert len(bpy.data.actions) == 1, "the recording has the dense keys, and this file need not"


def test_a_body_that_does_not_move_is_left_alone_and_nothing_is_wrong(tmp_path, capsys):
    write_body(tmp_path / "body.bvh", moves=False)
    assert run(tmp_path / "body.bvh") == 0
    assert "nothing of this body moves; left alone" in capsys.readouterr().err
    assert os.listdir(tmp_path) == ["body.bvh"]


def test_a_body_that_grows_has_its_size_in_the_table_and_in_the_file(tmp_path):
    path = tmp_path / "balloon.csv"
    times, poses = write_csv(path)
    sizes = 1.0 + 0.3 * np.sin(times)
    header, *lines = path.read_text().splitlines()
    rows = [f"{line},{size!r}" for line, size in zip(lines, sizes.tolist(), strict=True)]
    path.write_text("\n".join([f"{header},scale", *rows]))
    assert run(path, "--tolerance", "5mm", "--blend") == 0
    assert (tmp_path / "balloon-keys.csv").read_text().startswith("t,x,y,z,qw,qx,qy,qz,s\n")
    worlds = worlds_of(poses)
    worlds[:, :3, :3] *= sizes[:, None, None]
    frames = np.arange(1.0, len(times) + 1.0)
    shown = played_on_a_farm(tmp_path / "balloon-keys.blend", ["balloon"], frames)[1][0]
    assert displacement(shown, worlds) <= 5e-3 + ROUNDING


def test_one_body_of_a_file_and_all_of_them_are_files_of_their_own(tmp_path):
    source = hand_made(tmp_path)
    assert run(f"{source}:LeftHand", "--tolerance", "1cm") == 0
    assert (tmp_path / "body-LeftHand-keys.csv").is_file()
    assert run(f"{source}:*", "--tolerance", "1cm", "--output", tmp_path / "all") == 0
    assert sorted(os.listdir(tmp_path / "all")) == [f"body-{name}-keys.csv" for name in ("Head", "Hips", "LeftHand")]


def test_an_object_of_a_blend_file_is_a_recording_where_it_is_named(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    assert run(f"{path}:Tool") == 0
    assert len(read_table(tmp_path / "shot-Tool-keys.csv")[0]) < len(FRAMES) / 3


def test_what_is_far_away_is_refused_where_blender_could_not_hold_it(tmp_path, capsys):
    path = tmp_path / "hand.csv"
    write_csv(path)
    header, *lines = path.read_text().splitlines()
    cells = [line.split(",") for line in lines]
    path.write_text("\n".join([header, *(",".join([t, f"{float(x) + 1e6!r}", *rest]) for t, x, *rest in cells)]))
    assert run(path) == 0
    assert run(path, "--blend", "--overwrite") == 1
    assert f"{path}: this is up to 1e+06 m from its origin" in capsys.readouterr().err


# What is left alone, and how it ends


def test_a_dry_run_says_all_and_writes_nothing(tmp_path, capsys):
    shot, hand, body = object_file(tmp_path / "shot.blend"), tmp_path / "hand.csv", hand_made(tmp_path)
    write_csv(hand)
    before = sorted(os.listdir(tmp_path))
    capsys.readouterr()
    assert run(shot, hand, body, "--blend", "--dry-run") == 0
    assert sorted(os.listdir(tmp_path)) == before
    said = capsys.readouterr()
    assert said.out == ""
    for path in ("shot-reduced.blend", "hand-keys.csv", "hand-keys.blend", "body-keys.blend"):
        assert f"would be written to {tmp_path / path}" in said.err
    assert said.err.count("would be reduced, ") == 3


def test_nothing_is_written_over_unless_asked(tmp_path, capsys):
    shot, hand = object_file(tmp_path / "shot.blend"), tmp_path / "hand.csv"
    write_csv(hand)
    there = [reduced_name(shot), tmp_path / "hand-keys.csv"]
    for path in there:
        path.write_text("mine")
    assert run(shot, hand) == 1
    assert [path.read_text() for path in there] == ["mine", "mine"]
    assert capsys.readouterr().err.count("is there already: add --overwrite") == 2
    assert run(shot, hand, "--overwrite") == 0
    assert all(path.read_bytes() != b"mine" for path in there)


def test_in_place_keeps_the_file_from_before(tmp_path):
    path = object_file(tmp_path / "shot.blend")
    before = path.read_bytes()
    assert run(path, "--in-place") == 0
    assert sorted(os.listdir(tmp_path)) == ["shot.blend", "shot.blend1"]
    assert (tmp_path / "shot.blend1").read_bytes() == before
    open_again(path)
    assert count_keys(bpy.data.objects["Tool"]) < len(FRAMES)


def test_what_cannot_be_read_is_named_and_the_others_are_done(tmp_path, capsys):
    good = tmp_path / "hand.csv"
    write_csv(good)
    damaged = tmp_path / "damaged.blend"
    damaged.write_bytes(b"BLENDER, but no more")
    body = hand_made(tmp_path)
    assert run(tmp_path / "gone.csv", damaged, f"{body}:Nose", good) == 1
    said = capsys.readouterr().err
    assert f"{tmp_path / 'gone.csv'}: no such file" in said
    assert f"{damaged}: Blender cannot read this file" in said
    assert f"{body}: no body named 'Nose'; it holds Hips, LeftHand, Head" in said
    assert (tmp_path / "hand-keys.csv").is_file()
    assert run(tmp_path / "gone.csv", damaged, f"{body}:Nose") == 2


def test_two_recordings_that_would_be_one_file_are_not(tmp_path, capsys):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        write_csv(tmp_path / name / "hand.csv")
    assert run(tmp_path / "a" / "hand.csv", tmp_path / "b" / "hand.csv", "--output", tmp_path, "--overwrite") == 1
    assert f"{tmp_path / 'a' / 'hand.csv'} was written to {tmp_path / 'hand-keys.csv'} too" in capsys.readouterr().err


def test_a_recording_is_not_written_over_one_that_is_to_be_read(tmp_path, capsys):
    for name in ("hand", "hand-keys"):
        write_csv(tmp_path / f"{name}.csv")
    before = (tmp_path / "hand-keys.csv").read_bytes()
    assert run(tmp_path / "hand.csv", tmp_path / "hand-keys.csv", "--overwrite") == 1
    assert "which is to be read too" in capsys.readouterr().err
    assert (tmp_path / "hand-keys.csv").read_bytes() == before


@pytest.mark.parametrize("kind", ["blend", "recording"])
def test_ctrl_c_while_a_file_is_written_leaves_no_trace_of_it(tmp_path, monkeypatch, kind):
    path = object_file(tmp_path / "shot.blend") if kind == "blend" else hand_made(tmp_path)
    before, real = path.read_bytes(), blend_files.refuse_cut_off

    def press_and_check(written: Path) -> None:
        assert written.is_file()
        signal.raise_signal(signal.SIGINT)
        real(written)

    monkeypatch.setattr(blend_files, "refuse_cut_off", press_and_check)
    assert run(path) == 130
    assert os.listdir(tmp_path) == [path.name]
    assert path.read_bytes() == before


def test_an_error_that_nobody_foresaw_is_told_and_the_others_go_on(tmp_path, capsys, monkeypatch):
    paths = [object_file(tmp_path / f"{name}.blend") for name in ("a", "b")]
    real = animation.reduce_keys_of

    def fail_in_a(targets: object, *wishes: object, **options: object) -> object:
        if bpy.data.filepath == str(paths[0]):
            raise ZeroDivisionError("nobody knows why")
        return real(targets, *wishes, **options)

    monkeypatch.setattr(animation, "reduce_keys_of", fail_in_a)
    assert run(*paths) == 1
    assert f"{paths[0]}: not written, for this program failed (ZeroDivisionError" in capsys.readouterr().err
    assert sorted(os.listdir(tmp_path)) == ["a.blend", "b-reduced.blend", "b.blend"]


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ([], "INPUT"),
        (["a.blend", "--tolerance", "5 apples"], "is no tolerance; give a length such as 5mm"),
        (["a.blend", "--tolerance", "0mm"], "is no tolerance"),
        (["a.blend", "--radius", "0"], "is not a number of metres above 0"),
        (["a.blend", "--mode", "BLENDER"], "invalid choice"),
        (["a.csv", "--fps", "29.97"], "is not a whole number from 1 to 240"),
        (["a.csv", "--degrees"], "--degrees is for Euler angles"),
        (["a.csv", "--in-place"], "--in-place is for .blend files, and a.csv is a recording"),
        (["a.csv", "--objects", "Hand"], "name one body with FILE:BODY"),
        (["a.blend", "--in-place", "--output", "x"], "give one of them"),
        (["shot.blend", "shot-reduced.blend"], "would be written over shot-reduced.blend"),
    ],
)
def test_a_wrong_option_ends_with_code_2_and_a_way_out(arguments, complaint, capsys):
    assert exit_code(*arguments) == 2
    assert complaint in capsys.readouterr().err


def test_every_mode_of_the_menu_can_be_asked_for():
    assert [reduce.parse(["a.csv", "--mode", mode]).mode for mode in MODE_IDS[1:]] == list(MODE_IDS[1:])


def test_the_help_shows_examples_as_the_program_was_called(capsys):
    assert exit_code("--help") == 0
    said = capsys.readouterr().out
    assert "python scripts/reduce.py shot.blend\n" in said
    for code in (0, 1, 2, 130):
        assert f"\n  {code} " in said


def test_as_a_program_it_ends_by_itself_and_prints_the_path_alone(tmp_path):
    object_file(tmp_path / "shot.blend")
    done = subprocess.run(
        [sys.executable, ROOT / "scripts" / "reduce.py", "shot.blend"],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=tmp_path,
    )
    assert (done.returncode, done.stdout) == (0, "shot-reduced.blend\n"), done.stderr
