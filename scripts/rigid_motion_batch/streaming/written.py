"""What was shown as files: CSV, TUM and BVH."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO, cast

import numpy as np

from rigid_motion.motion import Poses, Skeleton, interpolate
from rigid_motion.motion.eulers import extrinsic_eulers_from_quaternions
from rigid_motion.streams import Body
from rigid_motion_batch.analysis.metrics import lines_of_poses, write_poses
from rigid_motion_batch.axes import from_blender
from rigid_motion_batch.files import replacing
from rigid_motion_batch.recordings.clip_reading import folder_names
from rigid_motion_batch.recordings.rest_bodies import RestBody

TURNS = "Zrotation Xrotation Yrotation"
PLACES = "Xposition Yposition Zposition"


@dataclass(frozen=True, eq=False)
class Motion:
    """What was shown of a body."""

    name: str

    body: Body

    times: np.ndarray
    """Shape (n,)."""

    poses: Poses
    """In metres and Blender's axes, each joint in its parent's space. Shape (joints, n)."""

    def even(self, mode: str, fps: float) -> Motion:
        """Return so many poses a second instead, with the in-betweens of a mode."""
        times = self.times[0] + np.arange(int((self.times[-1] - self.times[0]) * fps + 1e-6) + 1) / fps
        return replace(self, times=times, poses=interpolate(self.times, self.poses, times, mode))


def write_motions(path: Path, motions: Sequence[Motion], fps: float) -> list[Path]:
    """Write a table of all, `.csv`, or a file for each, `.bvh` or `.tum`, and return what was written.

    In tables joints are where they are in the world, and TUM takes rigid bodies alone. BVH is y up, as it is elsewhere.
    """
    if path.suffix.lower() == ".csv":
        with replacing(path) as file:
            _write_table(file, motions)
        return [path]
    if path.suffix.lower() == ".tum":
        motions = [motion for motion in motions if len(motion.body.joints) == 1]
    names = folder_names(f"{path.stem}-{motion.name}" if len(motions) > 1 else path.stem for motion in motions)
    paths = [path.with_name(f"{name}{path.suffix.lower()}") for name in names]
    for place, motion in zip(paths, motions, strict=True):
        if place.suffix == ".tum":
            write_poses(place, motion.times, motion.poses[0])
            continue
        body, even = motion.body, motion.even("lerp_slerp", fps)
        poses = from_blender(even.poses, "opengl")
        # A bone ends as far behind its joint as that is behind its parent.
        rest_body = RestBody(body.joints, body.parents, body.rest, from_blender(body.rest, "opengl").positions)
        with replacing(place) as file:
            write_bvh(file, rest_body, cast(np.ndarray, body.sliding), even.times, poses)
    return paths


def _write_table(file: TextIO, motions: Sequence[Motion]) -> None:
    file.write("device,t,x,y,z,qw,qx,qy,qz\n")
    for motion in motions:
        poses = Skeleton(motion.body.parents).in_root_space(motion.poses)
        for joint, name in enumerate(motion.body.joints):
            device = motion.name if len(motion.body.joints) == 1 else f"{motion.name}.{name}"
            device = device.replace(",", "_").replace('"', "_")
            own = poses[joint]
            for _, lines in lines_of_poses([motion.times, *own.positions.T, *own.quaternions.T]):
                file.write("".join(f"{device},{line}\n" for line in lines))


def write_bvh(file: TextIO, rest_body: RestBody, sliding: np.ndarray, times: np.ndarray, poses: Poses) -> None:
    """Write the poses (joints, n) of a body, each joint in its parent's space, at an even rate.

    Joints that slide (joints,) have channels for their places, the others are where they are at rest. A body with
    several roots is written with as many hierarchies, which Blender and this program read.
    """
    places = poses.positions[:, 0]
    children: list[list[int]] = [[] for _ in rest_body.joints]
    for joint, parent in enumerate(rest_body.parents.tolist()):
        if parent >= 0:
            children[parent].append(joint)
    columns: list[np.ndarray] = []

    def joint_lines(joint: int, depth: int) -> None:
        tab = "\t" * depth
        kind = "ROOT" if rest_body.parents[joint] < 0 else "JOINT"
        name = "_".join(rest_body.joints[joint].split()) or "joint"
        offset = " ".join(f"{number:.9g}" for number in places[joint])
        file.write(f"{tab}{kind} {name}\n{tab}{{\n{tab}\tOFFSET {offset}\n")
        channels = f"6 {PLACES} {TURNS}" if sliding[joint] else f"3 {TURNS}"
        file.write(f"{tab}\tCHANNELS {channels}\n")
        if sliding[joint]:
            columns.extend(poses.positions[joint].T)
        x, y, z = np.degrees(extrinsic_eulers_from_quaternions(poses.quaternions[joint], "YXZ")).T
        columns.extend((z, x, y))
        for child in children[joint]:
            joint_lines(child, depth + 1)
        if not children[joint]:
            end = " ".join(f"{number:.9g}" for number in rest_body.tails[joint])
            file.write(f"{tab}\tEnd Site\n{tab}\t{{\n{tab}\t\tOFFSET {end}\n{tab}\t}}\n")
        file.write(f"{tab}}}\n")

    file.write("HIERARCHY\n")
    for root in np.flatnonzero(rest_body.parents < 0).tolist():
        joint_lines(root, 0)
    frame_time = float(times[-1] - times[0]) / max(len(times) - 1, 1)
    file.write(f"MOTION\nFrames: {len(times)}\nFrame Time: {frame_time:.9g}\n")
    for row in np.array(columns).T:
        file.write(" ".join(f"{number:.7f}" for number in row) + "\n")
