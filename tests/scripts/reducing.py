"""Helpers for tests of reduce.py: running it, input files, and errors of the results."""

from pathlib import Path

import bpy
import numpy as np
from scipy.spatial.transform import Rotation

from rigid_motion.animation import write_channel
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.cli import reduce
from rigid_motion_batch.pipeline.steps import OWN_FOLDER
from rigid_motion_batch.recordings.clips import Clip
from tests.animation.farm import played_on_a_farm
from tests.animation.scenes import new_object
from tests.balls import largest_displacements
from tests.gltf.making import Making
from tests.recordings import RECORDINGS
from tests.scripts.baking import new_file, open_again, save
from tests.scripts.recordings.blends import rig

WALK = RECORDINGS.parent / "rigs" / "pab_walk.fbx"
"""A recording of others, next to the checkout."""

FRAMES = np.arange(1.0, 62.0)
"""Frames of the dense keys in the scenes."""

RADIUS = 0.1
"""Radius in metres around an origin within which errors are measured."""

ROUNDING = 2e-5
"""Allowed rounding in metres: matrices in single precision, through a chain of bones."""


def run(*arguments: object) -> int:
    """Run the program in this process, and return the exit code."""
    return reduce.main([*map(str, arguments), "--jobs", "0"])


def swing(count: int, seed: int = 0, whole: float = 90.0) -> Poses:
    """Return a smooth motion of `count` poses through half a metre and a turn, with changing speed."""
    random, parts = np.random.default_rng(seed), np.arange(count) / whole
    phases = 5.0 * parts[:, None] * random.uniform(0.5, 1.5, 3) + random.uniform(0.0, 6.0, 3)
    angles = 3.0 * parts + 0.2 * np.sin(12.0 * parts)
    axis = normalise(random.normal(size=3))
    turns = np.column_stack((np.cos(angles), np.sin(angles)[:, None] * axis))
    return Poses(0.5 * np.sin(phases), turns)


def key_densely(carrier: bpy.types.Object | bpy.types.PoseBone, poses: Poses, frames: np.ndarray = FRAMES) -> None:
    """Insert a key of location and rotation on every frame, as simulations and motion capture do."""
    carrier.rotation_mode = "QUATERNION"
    animated = carrier.id_data
    prefix = "" if carrier == animated else f"{carrier.path_from_id()}."
    write_channel(animated, f"{prefix}location", frames, poses.positions)
    write_channel(animated, f"{prefix}rotation_quaternion", frames, poses.quaternions)


def object_file(path: Path, *names: str) -> Path:
    """Save a file of objects with a key on every frame, from a Blender without the extension."""
    new_file()
    for seed, name in enumerate(names or ("Tool",)):
        obj = new_object(name)
        obj.empty_display_size = RADIUS
        key_densely(obj, swing(len(FRAMES), seed))
    path.parent.mkdir(exist_ok=True)
    return save(path)


def rig_file(path: Path) -> Path:
    """Save a file with a chain of three bones keyed on every frame, and an empty at the end of each: "at BONE"."""
    new_file()
    bones = {
        "Root": ((0.0, 0.0, 0.0), (0.0, 0.0, 0.3), None),
        "Arm": ((0.0, 0.0, 0.3), (0.0, 0.0, 0.6), "Root"),
        "Hand": ((0.0, 0.0, 0.6), (0.0, 0.0, 0.9), "Arm"),
    }
    made = rig("Rig", bones)
    for seed, bone in enumerate(made.pose.bones):
        key_densely(bone, swing(len(FRAMES), seed + 20))
        probe = new_object(f"at {bone.name}")
        probe.parent, probe.parent_type, probe.parent_bone = made, "BONE", bone.name
    return save(path)


def listed(folder: Path) -> list[str]:
    """Return the names in a folder, without the program's own folder."""
    return sorted({path.name for path in folder.iterdir()} - {OWN_FOLDER})


def reduced_name(path: Path) -> Path:
    return path.with_name(f"{path.stem}-reduced.blend")


def played(path: Path, *names: str) -> np.ndarray:
    """Return world matrices on all frames, (objects, n, 4, 4), in a Blender without the extension."""
    return played_on_a_farm(path, names, FRAMES)[1]


def displacement(worlds: np.ndarray, truth: np.ndarray, radius: float = RADIUS) -> float:
    """Return the farthest that any point within the radius of an object's origin is from its place, on any frame."""
    offset = (worlds - truth)[..., :3, :]
    return float(largest_displacements(offset[..., 3], radius * offset[..., :3]).max())


def write_csv(path: Path, seconds: float = 1.0, rate: float = 90.0) -> tuple[np.ndarray, Poses]:
    """Write a recording in Blender's axes and metres, and return its times and poses."""
    times = np.arange(round(seconds * rate) + 1) / rate
    poses = swing(len(times), 3, 2.0 * rate)
    write_poses(path, times, poses)
    return times, poses


def write_still(path: Path) -> Path:
    """Write a GLB file without animations."""
    made = Making()
    made.json["nodes"] = [{}]
    made.view(b"mesh")
    del made.json["animations"]
    return made.write(path)


def read_table(path: Path) -> tuple[np.ndarray, Poses]:
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    assert header == "t,x,y,z,qw,qx,qy,qz"
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    return rows[:, 0], Poses(rows[:, 1:4], rows[:, 4:])


def worlds_of(poses: Poses) -> np.ndarray:
    """Return matrices (n, 4, 4), by SciPy."""
    worlds = np.tile(np.eye(4), (len(poses.quaternions), 1, 1))
    worlds[:, :3, :3] = Rotation.from_quat(poses.quaternions, scalar_first=True).as_matrix()
    worlds[:, :3, 3] = poses.positions
    return worlds


def joints_in_metres(clip: Clip) -> np.ndarray:
    """Return the positions of a whole body's joints, shape (joints, n, 3), by matrices."""
    result: list[np.ndarray] = []
    for joint, parent in enumerate(clip.rest_body.parents):
        local = worlds_of(clip.poses[joint])
        result.append(local if parent < 0 else result[parent] @ local)
    return clip.metres_per_unit * np.array(result)[..., :3, 3]


def heads_at(made: Path, times: np.ndarray) -> np.ndarray:
    """Return the heads of a reduced recording's bones at times in seconds, sorted by name, shape (bones, times, 3)."""
    open_again(made)
    (own,) = (obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    names, render = own.pose.bones.keys(), bpy.context.scene.render
    shown = played_on_a_farm(made, [own.name], 1.0 + times * render.fps / render.fps_base)
    return (shown.worlds @ shown.poses)[np.argsort(names), :, :3, 3]
