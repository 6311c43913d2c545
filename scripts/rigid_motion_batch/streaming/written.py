"""Writing received motion to CSV and BVH files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple, TextIO, cast

import numpy as np

from rigid_motion.motion import Poses, interpolate
from rigid_motion.motion.poses import joined
from rigid_motion.streams import ReceivedKeys, Shown, StreamBody
from rigid_motion_batch.analysis.metrics import lines_of_poses
from rigid_motion_batch.axes import from_blender
from rigid_motion_batch.files import replacing
from rigid_motion_batch.recordings.bvh_writing import write_bvh
from rigid_motion_batch.recordings.clip_reading import folder_names
from rigid_motion_batch.recordings.rest_bodies import RestBody


class ReceivedMotion(NamedTuple):
    """The motion shown of a body: moments (n,), and poses (joints, n), each joint in its parent's space."""

    name: str
    body: StreamBody
    times: np.ndarray
    poses: Poses

    def even(self, mode: str, fps: float) -> ReceivedMotion:
        """Return the motion resampled at `fps` poses per second, with the in-betweens of a mode."""
        times = self.times[0] + np.arange(int((self.times[-1] - self.times[0]) * fps + 1e-6) + 1) / fps
        return self._replace(times=times, poses=interpolate(self.times, self.poses, times, mode))


class Tracks(dict[tuple[str, StreamBody], list[tuple[np.ndarray, Poses]]]):
    """The shown poses or received keys of all bodies of all users, piece by piece."""

    def add_shown(self, shown: Iterable[Shown]) -> None:
        """Add a frame."""
        for what in shown:
            poses = {name: own[:, None] for name, own in what.poses.items()}
            self.add_keys([ReceivedKeys(what.stream, what.bodies, np.array([what.moment]), poses)])

    def add_keys(self, came: Iterable[ReceivedKeys]) -> None:
        """Add keys."""
        for keys in came:
            for body in keys.bodies:
                self.setdefault((str(keys.stream.source), body), []).append((keys.moments, keys.poses[body.name]))

    def motions(self) -> list[ReceivedMotion]:
        """Return the motions with at least two poses, at increasing moments."""
        result = []
        for (user, body), pieces in self.items():
            times = np.concatenate([moments for moments, _ in pieces])
            rising = np.flatnonzero(np.diff(np.maximum.accumulate(times), prepend=-np.inf) > 0.0)
            if len(rising) > 1:
                poses = joined([poses for _, poses in pieces], axis=1)[:, rising]
                result.append(ReceivedMotion(f"{user}-{body.name}", body, times[rising], poses))
        return result


def write_motions(path: Path, motions: Sequence[ReceivedMotion], fps: float) -> list[Path]:
    """Write one `.csv` table of all motions, or a `.bvh` file for each, and return the written paths.

    Tables hold joints in world space. BVH is y up, as usual.
    """
    if path.suffix.lower() == ".csv":
        with replacing(path) as file:
            _write_table(file, motions)
        return [path]
    names = folder_names(f"{path.stem}-{motion.name}" if len(motions) > 1 else path.stem for motion in motions)
    paths = [path.with_name(f"{name}.bvh") for name in names]
    for place, motion in zip(paths, motions, strict=True):
        body, even = motion.body, motion.even("lerp_slerp", fps)
        # A bone's end has the same offset from its joint as the joint from its parent.
        rest_body = RestBody(body.joints, body.parents, body.rest, from_blender(body.rest, "opengl").positions)
        with replacing(place) as file:
            write_bvh(file, rest_body, cast(np.ndarray, body.sliding), even.times, from_blender(even.poses, "opengl"))
    return paths


def _write_table(file: TextIO, motions: Sequence[ReceivedMotion]) -> None:
    file.write("device,t,x,y,z,qw,qx,qy,qz\n")
    for motion in motions:
        poses = motion.body.skeleton.in_root_space(motion.poses)
        for name, own in zip(motion.body.joints, poses, strict=True):
            device = motion.name if len(motion.body.joints) == 1 else f"{motion.name}.{name}"
            device = device.replace(",", "_").replace('"', "_")
            for lines in lines_of_poses([motion.times, *own.positions.T, *own.quaternions.T]):
                file.write("".join(f"{device},{line}\n" for line in lines))
