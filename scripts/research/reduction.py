"""What Reduce Keys to Poses leaves of recordings, beside Blender's own Decimate of the Graph Editor.

    python scripts/research reduction
    python scripts/research reduction --recordings FOLDER --bodies FOLDER_OR_FILES

Each recording is an object with a key of location and rotation on every frame, as Blender's users import it. *Reduce
Keys to Poses* leaves the fewest keys within the tolerance; Decimate gets the largest error margin with which it is no
worse, found by trials. All errors are those of what Blender shows, on every frame.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from research import body_reduction
from research.decimating import FREE, Decimations, Left
from research.making.motions import MOTIONS
from research.studies import EXTENSIONS, files_in, publish, study_parser
from rigid_motion import animation
from rigid_motion.motion import Poses, interpolate, shell_error
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.world_poses import read_poses
from rigid_motion_batch.scenes.body_scene import registered

ROTATION_MODES = ("QUATERNION", "XYZ")
TRIALS = 14  # error margins tried until Decimate is as good as the reduced poses


def read(path: Path, rate: float) -> Clip:
    """Read the first body of a file at so many frames a second, straight between samples; of a skeleton the root.

    Raises
    ------
    TrajectoryError
        Where it cannot be read, or has fewer than two usable poses.
    """
    clip = read_clips([str(path)])[0][0]
    poses = clip.in_metres(clip.poses if clip.rest_body is None else clip.poses[0])
    times = np.arange(np.floor((clip.times[-1] - clip.times[0]) * rate) + 1.0) / rate
    poses = interpolate(clip.times - clip.times[0], Poses(poses.positions, poses.quaternions), times, "lerp_slerp")
    return replace(clip, name=path.stem, times=times, poses=poses, rest_body=None, metres_per_unit=1.0)


def frames_of(clip: Clip) -> np.ndarray:
    """Return the frames of its poses (n,), from 1 on."""
    return 1.0 + np.arange(len(clip.times))


def import_clip(clip: Clip, rotation_mode: str) -> bpy.types.Object:
    """Return an empty with a key on every frame, alone in a new file, selected."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = bpy.data.objects.new(clip.name, None)
    obj.rotation_mode = rotation_mode
    bpy.context.collection.objects.link(obj)
    animation.bake_poses(obj, frames_of(clip), clip.poses)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def outcome(obj: bpy.types.Object, clip: Clip, radius: float) -> Left:
    """Return what an object has now for keys, in a channel on average, and how far off it is shown."""
    curves = [
        [key.co.x for key in fcurve.keyframe_points]
        for fcurve in animation.channelbag_of(obj).fcurves
        if fcurve.data_path.startswith(("location", "rotation"))
    ]
    frames, count = len(set().union(*curves)), sum(map(len, curves))
    numbers = frames * (1 + len(curves)) if animation.is_reduced(obj) else FREE * count
    error = shell_error(read_poses(obj, frames_of(clip)), clip.poses, radius)
    return Left(frames, count / len(curves), numbers, float(error.max()))


def measure(clip: Clip, rotation_mode: str, tolerance: float, radius: float) -> dict[str, Any]:
    """Return what poses leave of a recording, and Decimate with no larger an error; None where it cannot be so good."""
    obj = import_clip(clip, rotation_mode)
    animation.reduce_keys_of(obj, "motor_spline", tolerance, radius)
    reduced = outcome(obj, clip, radius)
    obj = import_clip(clip, rotation_mode)
    as_good = Decimations(obj, lambda: outcome(obj, clip, radius), TRIALS).within(reduced.largest)
    about = {"name": clip.name, "frames": len(clip.times)}
    return {**about, "reduced": reduced.figures(), "decimate": as_good and as_good.figures()}


def means(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Return what Decimate has in multiples of reduced poses: geometric means over the recordings."""
    pairs = [(row["decimate"], row["reduced"]) for row in rows if row["decimate"]]
    return {
        name: geometric_mean(np.array([decimated[name] / reduced[name] for decimated, reduced in pairs]))
        for name in pairs[0][0]
    }


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("reduction", __doc__)
    parser.add_argument("--recordings", type=Path, metavar="FOLDER", help="more recordings, axes and unit as they are")
    parser.add_argument("--bodies", type=Path, nargs="+", default=[], metavar="PATH", help="BVH, FBX, folders of them")
    parser.add_argument("--tolerance", type=float, default=0.005, help="in metres (%(default)s)")
    parser.add_argument("--radius", type=float, default=0.1, help="of the shell, in metres (%(default)s)")
    parser.add_argument("--fps", type=float, default=60.0, help="frames a second (%(default)g)")
    options = parser.parse_args(arguments)
    try:
        others = files_in([options.recordings], EXTENSIONS - {".blend"}) if options.recordings else []
        generated = [path for path in sorted(ASSETS.glob("*.csv")) if path.stem in MOTIONS]
        recordings = [read(path, options.fps) for path in [*generated, *others]]
        bodies = files_in(options.bodies, (".bvh", ".fbx"))
    except (TrajectoryError, OSError) as error:
        parser.error(str(error))
    with registered():
        rows = {
            rotation: [measure(clip, rotation, options.tolerance, options.radius) for clip in recordings]
            for rotation in ROTATION_MODES
        }
        result = {
            "tolerance_mm": 1e3 * options.tolerance,
            "radius": options.radius,
            "recordings": rows,
            "means": {rotation: means(of_rotation) for rotation, of_rotation in rows.items()},
            **body_reduction.figures(bodies),
        }
    given = f"--tolerance {options.tolerance:g} --radius {options.radius:g} --fps {options.fps:g}"
    more = [f"--{name} ..." for name in ("recordings", "bodies") if getattr(options, name)]
    return publish("reduction", result, options, given, *more, Blender=bpy.app.version_string)
