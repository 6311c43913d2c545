"""BVH (Biovision Hierarchy) writing of whole bodies."""

from __future__ import annotations

from typing import TextIO

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.eulers import extrinsic_eulers_from_quaternions

from .rest_bodies import RestBody

TURNS = "Zrotation Xrotation Yrotation"
PLACES = "Xposition Yposition Zposition"


def write_bvh(file: TextIO, rest_body: RestBody, sliding: np.ndarray, times: np.ndarray, poses: Poses) -> None:
    """Write the poses (joints, n) of a body, each joint in its parent's space, at an even rate.

    Joints that slide (joints,) have position channels; the other joints stay at their rest positions. A body with
    several roots is written as several hierarchies, which Blender and this program can read.
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
        name = " ".join(rest_body.joints[joint].split()) or "joint"
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
