"""Comparison of Reduce Keys to Poses with Blender's own curves, and with Decimate of the Graph Editor.

    python scripts/research reduction
    python scripts/research reduction --recordings FOLDER --bodies FOLDER_OR_FILES

Each recording is an object with a key of location and rotation on every frame, as Blender's users import it. *Reduce
Keys to Poses* leaves the fewest keys within the tolerance. The same search finds the fewest frames to key for Blender's
own curves; and Decimate gets the largest error margin at which its error is no larger, found by trials. All errors are
those of Blender's evaluation, at eighths of frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from research.decimating import (
    MIN_ERROR_RATIO,
    MIN_VARIATION,
    NUMBERS_PER_FREE_KEY,
    PARTS_PER_FRAME,
    DecimatedBody,
    Left,
    bend,
    between,
    decimated_within,
    fcurves_of,
    values_of,
)
from research.making.motions import MOTIONS
from research.studies import EXTENSIONS, files_in, publish, report, study_parser
from rigid_motion import animation
from rigid_motion.motion import Poses, interpolate, reduce_keys, shell_error
from rigid_motion.motion.eulers import quaternions_from_extrinsic_eulers
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.metrics import geometric_mean, key_samples
from rigid_motion_batch.analysis.modes import REFERENCE, STATE_OF_THE_ART
from rigid_motion_batch.analysis.needed import part_of
from rigid_motion_batch.analysis.reconstructions import Reconstruction, moving, reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.scenes.body_scene import registered

ROTATION_MODES = ("QUATERNION", "XYZ")
RIVALS = "curves", "curves_between", "decimate"
MAX_TRIALS = 14  # maximum tries of error margins and tolerances until a rival is as good as the reduced poses
ROUNDING_RATIO = 1e-4  # the fraction by which single precision may exceed a tolerance

TOLERANCE, RADIUS_M, HEIGHT_M = Tolerance("10mm"), 0.03, 1.7
"""The error tolerance, the radius of the ball at every joint, and the largest extent all bodies are scaled to, in m."""

MODE = "motor_spline"
WAYS = {"keys of each joint": False, "key poses": True}
BODY_RIVALS = "Blender's curves", "Decimate"

MOST_FRAMES = 1200  # longer recordings are truncated


def read(path: Path, rate: float) -> Clip:
    """Read the first body of a file, sampled at `rate` and then linearly at `PARTS_PER_FRAME` times that rate, as
    Blender shows a key on every frame; of a skeleton only the root.

    Raises
    ------
    TrajectoryError
        If it cannot be read, or has fewer than two usable poses.
    """
    clip = read_clips([str(path)])[0][0]
    poses = clip.in_metres(clip.poses if clip.rest_body is None else clip.poses[0])
    frames = np.arange(np.floor((clip.times[-1] - clip.times[0]) * rate) + 1.0) / rate
    times, poses = clip.times - clip.times[0], Poses(poses.positions, poses.quaternions)
    for at in (frames, between(frames)):
        times, poses = at, interpolate(times, poses, at, STATE_OF_THE_ART)
    return replace(clip, name=path.stem, times=times, poses=poses, rest_body=None, metres_per_unit=1.0)


def frames_of(clip: Clip) -> np.ndarray:
    """Return the frames of the clip's poses (n,), from 1 on; every `PARTS_PER_FRAME`th is a whole frame."""
    return 1.0 + np.arange(len(clip.times)) / PARTS_PER_FRAME


def import_clip(clip: Clip, rotation_mode: str, keys: np.ndarray | slice = slice(None)) -> bpy.types.Object:
    """Return an empty with keys on all frames, or only `keys`, alone in a new file, selected."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = bpy.data.objects.new(clip.name, None)
    obj.rotation_mode = rotation_mode
    bpy.context.collection.objects.link(obj)
    animation.bake_poses(obj, frames_of(clip)[::PARTS_PER_FRAME][keys], clip.poses[::PARTS_PER_FRAME][keys])
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def shown(obj: bpy.types.Object, frames: np.ndarray) -> Poses:
    """Return the poses of an object at frames (n,), evaluated from its F-curves."""
    values = values_of(obj, frames)
    location, turns = (
        np.column_stack([values[channel] for channel in sorted(values) if channel[0].startswith(what)])
        for what in ("location", "rotation")
    )
    if obj.rotation_mode == "QUATERNION":
        return Poses(location, normalise(turns))
    return Poses(location, quaternions_from_extrinsic_eulers(turns, obj.rotation_mode))


def recorded(obj: bpy.types.Object, clip: Clip) -> Poses:
    """Return the poses of a fully keyed object: the clip's on whole frames, evaluated ones between them."""
    result = shown(obj, frames_of(clip))
    result[::PARTS_PER_FRAME] = clip.poses[::PARTS_PER_FRAME]
    return result


def outcome(obj: bpy.types.Object, truth: Poses, radius: float, *, poses: bool = False) -> Left:
    """Return the counts of an object's keys (per channel on average) and numbers, and its largest error.

    With `poses`, keys are whole poses, which take a number for their frame and one for each channel.
    """
    curves = [
        [key.co.x for key in fcurve.keyframe_points]
        for (path, _), fcurve in fcurves_of(obj).items()
        if path.startswith(("location", "rotation"))
    ]
    frames, count = len(set().union(*curves)), sum(map(len, curves))
    numbers = frames * (1 + len(curves)) if poses else NUMBERS_PER_FREE_KEY * count
    return Left(frames, count / len(curves), numbers, float(errors_of(obj, truth, radius).max()))


def errors_of(obj: bpy.types.Object, truth: Poses, radius: float) -> np.ndarray:
    """Return the error of an object's evaluated motion at every part of a frame, in metres, shape (n,)."""
    return shell_error(shown(obj, 1.0 + np.arange(truth.shape[0]) / PARTS_PER_FRAME), truth, radius)


def blenders_curves(
    clip: Clip, truth: Poses, rotation_mode: str, tolerance: float, radius: float, largest: float
) -> tuple[Left | None, Left | None]:
    """Return the fewest keys found with which Blender's curves stay within the tolerance on frames, and the fewest with
    which they stay within `largest` between frames too; None if they never do.

    The search is done for quaternions. To account for Euler angles and for errors between frames, the tolerance is
    lowered.
    """
    aim, frames, kept = tolerance, frames_of(clip)[::PARTS_PER_FRAME], None
    for _ in range(MAX_TRIALS):
        keys = reduce_keys(frames, clip.poses[::PARTS_PER_FRAME], REFERENCE, aim, radius)
        obj = import_clip(clip, rotation_mode, keys)
        bend(obj)
        left, on_frames = (
            outcome(obj, truth, radius, poses=True),
            errors_of(obj, truth, radius)[::PARTS_PER_FRAME].max(),
        )
        if kept is None and on_frames <= tolerance * (1.0 + ROUNDING_RATIO):
            kept = left
        if left.largest <= largest and kept:
            return kept, left
        if len(keys) == len(frames):
            break
        aim *= MIN_ERROR_RATIO * min(largest / left.largest, tolerance / on_frames, 1.0)
    return kept, None


def measure(clip: Clip, rotation_mode: str, tolerance: float, radius: float) -> dict[str, Any]:
    """Return the results of *Reduce Keys to Poses* for a recording, and those of its rivals with at most the same
    error; None for a rival that cannot reach it.
    """
    report(f"{clip.name}, {rotation_mode}")
    obj = import_clip(clip, rotation_mode)
    truth = recorded(obj, clip)
    animation.reduce_keys_of(obj, "motor_spline", tolerance, radius)
    reduced = outcome(obj, truth, radius, poses=True)
    curves = blenders_curves(clip, truth, rotation_mode, tolerance, radius, max(tolerance, reduced.largest))
    obj = import_clip(clip, rotation_mode)
    decimated = decimated_within(obj, lambda: outcome(obj, truth, radius), reduced.largest, MAX_TRIALS)
    rivals = dict(zip(RIVALS, (*curves, decimated), strict=True))
    about = {"name": clip.name, "frames": len(clip.times[::PARTS_PER_FRAME]), "reduced": reduced.figures()}
    return about | {name: left and left.figures() for name, left in rivals.items()}


def means(rows: list[dict[str, Any]], rival: str) -> dict[str, float]:
    """Return a rival's counts as ratios to reduced poses: geometric means over recordings where the rival succeeds."""
    pairs = [(row[rival], row["reduced"]) for row in rows if row[rival]]
    ratios = {name: [one[name] / reduced[name] for one, reduced in pairs] for name in rows[0]["reduced"]}
    return {"recordings": len(pairs), **{name: geometric_mean(np.array(own)) for name, own in ratios.items()}}


# -- whole bodies ----------------------------------------------------------------------------------------------------


def of_bodies(paths: Sequence[Path]) -> dict[str, Any]:
    """Return all measurements of the bodies in files."""
    clips = [replace(read_clips([str(path)])[0][0], name=path.stem) for path in paths]
    bodies = [of_height(part_of(clip, 0, min(len(clip.times), MOST_FRAMES) - 1)) for clip in clips]
    pairs = {way: [beside(body, way) for body in bodies] for way in WAYS}
    return {
        "bodies": [about(body) for body in bodies],
        "beside": [row for of_way in pairs.values() for rows in of_way for row in rows],
        "beside_means": {
            way: {
                rival: {
                    name: geometric_mean(np.array([rows[place][name] / rows[0][name] for rows in of_way]))
                    for name in ("frames", "key_count", "numbers")
                }
                for place, rival in enumerate(BODY_RIVALS, 1)
            }
            for way, of_way in pairs.items()
            if of_way
        },
    }


def about(body: Clip) -> dict[str, Any]:
    """Return the name and dimensions of a body."""
    joints, frames = body.poses.shape
    extent = HEIGHT_M / body.metres_per_unit
    return {"name": body.name, "joints": joints, "frames": frames, "rate": body.samples_a_second, "extent": extent}


def of_height(clip: Clip) -> Clip:
    """Return the body scaled so that its joints in the first frame span `HEIGHT_M` along one of the axes."""
    places = clip.rest_body.skeleton.in_root_space(clip.poses[:, :1]).positions
    return replace(clip, metres_per_unit=HEIGHT_M / float(np.ptp(places, axis=(0, 1)).max()))


def beside(body: Clip, way: str) -> list[dict[str, Any]]:
    """Return the keys left by a way of reducing, by the same way with Blender's curves, and by Decimate within the
    first one's error.
    """
    report(f"{body.name}, {way}")
    made = {mode: reconstruct(body, TOLERANCE, [mode], RADIUS_M, shared=WAYS[way]) for mode in (MODE, REFERENCE)}
    own, curves = (left_by(one) for one in made.values())
    left = DecimatedBody(made[MODE]).within(1e-3 * own["error_mm"])
    rows = own, curves, left.figures()
    return [{"body": body.name, "how": how, **row} for how, row in zip((way, *BODY_RIVALS), rows, strict=True)]


def left_by(made: Reconstruction) -> dict[str, Any]:
    """Return counts and largest errors of a reconstruction with a single mode, also between frames, and foot slide."""
    (row,) = measured(made).rows
    slides = {"slide_mm": row.foot_slide_m, "recorded_slide_mm": row.recorded_slide_m}
    return {
        "frames": row.key_frames,
        "key_count": row.keys,
        "numbers": numbers_of(made),
        "on_frames_mm": 1e3 * row.max_shell_m,
        "error_mm": 1e3 * largest_error(made),
        **{name: None if metres is None else 1e3 * metres for name, metres in slides.items()},
    }


def largest_error(made: Reconstruction) -> float:
    """Return the largest error of any joint at any part of a frame, in metres.

    The recording is taken as linear between its samples.
    """
    (mode,) = made.keys
    every = np.arange(made.samples.start, made.samples.stop)
    times, straight = between(made.times), replace(made, keys={STATE_OF_THE_ART: (every,) * len(made.radii)})
    truth = straight.shown(STATE_OF_THE_ART, times)
    return float(shell_error(made.shown(mode, times), truth, made.radii[:, None]).max())


def numbers_of(made: Reconstruction) -> int:
    """Return how many numbers the keys take: for each its time, and position and rotation where they vary."""
    (keys,), clip = made.keys.values(), made.clip
    places = np.ptp(clip.poses.positions, axis=1).max(axis=1) * clip.metres_per_unit > MIN_VARIATION
    counts, channels, moves = np.array([*map(len, keys)]), 4 + 3 * places, moving(clip)
    times = len(key_samples(keys)) if made.shared else counts[moves].sum()
    return int(times + (counts * channels)[moves].sum())


def main(arguments: list[str] | None = None) -> int:
    """Measure all recordings and bodies, and write the figures."""
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
            "means": {
                rotation: {rival: means(of_rotation, rival) for rival in RIVALS}
                for rotation, of_rotation in rows.items()
            },
            **of_bodies(bodies),
        }
    given = f"--tolerance {options.tolerance:g} --radius {options.radius:g} --fps {options.fps:g}"
    more = [f"--{name} ..." for name in ("recordings", "bodies") if getattr(options, name)]
    return publish("reduction", result, options, given, *more, Blender=bpy.app.version_string)
