"""What Reduce Keys to Poses leaves of recordings, beside Blender's own Decimate of the Graph Editor.

    python scripts/research reduction
    python scripts/research reduction --recordings FOLDER --bodies FOLDER_OR_FILES
    python scripts/research reduction --output docs/reduction.md

Each recording is imported as Blender's users do it, with a key of location and rotation on every frame. *Reduce Keys to
Poses* keeps the shell error on every frame within `--tolerance`: the largest displacement of any point in a ball of
`--radius`. Decimate works on each channel by itself, and shapes the curve between its keys with free handles. So there
are three ways to compare the two: *as many keys* in each channel; keys on *as many frames*, which is how many poses an
animator has to look after; and *as good*, the fewest keys without a larger shell error, found by trying error margins.
All errors are measured on what Blender shows, on every frame. The column *numbers* counts what has to be stored: 6 for
a key with free handles (frame, value, two handles of two numbers each), and for a pose its frame and a value in each
channel, since straight keys need no handles. The in-betweens of a mode are in the file, too, on every frame, but the
program makes them anew from the keys, so they are not counted.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from research.publishing import opening, publish
from research.summaries import of_reduction
from research.whole_bodies import rigs
from research.whole_bodies.section import section
from rigid_motion import animation
from rigid_motion.motion import Poses, interpolate, repair, shell_error
from rigid_motion.motion.measures import rms
from rigid_motion_batch.command_line import parser_of
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings import TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.reading import FORMATS
from rigid_motion_batch.scenes.decimated_bodies import decimate

ROTATION_MODES = ("QUATERNION", "XYZ")

TRIALS = 14
"""Error margins tried until Decimate is as good as the reduced poses."""

MARGINS = (1e-6, 1.0)
"""The smallest and the largest of them, in the units of the channels."""


FIGURES = ("keys", "frames", "numbers", "largest", "rms")
"""Of an outcome."""


@dataclass(frozen=True, eq=False)
class Recording:
    """A motion with a pose on every frame."""

    name: str
    frames: np.ndarray
    """Shape (n,), from 1 on."""

    poses: Poses
    """Shape (n,)."""


@dataclass(frozen=True)
class Outcome:
    """What is left of the keys, and how far off the motion is."""

    how: str
    keys: float
    """In a channel, on average."""

    frames: int
    """With a key in any channel."""

    numbers: int
    largest: float
    rms: float


def read(path: Path, rate: float) -> Recording:
    """The first body of a file, at so many frames a second, between samples by the shortest way; a skeleton's root."""
    trajectory = read_trajectories(str(path)).trajectories[0]
    times, poses, _ = repair(trajectory.times, trajectory.rigid)
    if len(times) < 2:
        raise TrajectoryError(path, f"{len(times)} usable poses are left", "record at least 2")
    poses = Poses(trajectory.metres_per_unit * poses.positions, poses.quaternions)
    frames = np.arange(np.floor((times[-1] - times[0]) * rate) + 1.0)
    return Recording(path.stem, 1.0 + frames, interpolate(times - times[0], poses, frames / rate, "lerp_slerp"))


def import_recording(recording: Recording, rotation_mode: str) -> bpy.types.Object:
    """An empty with a key on every frame, alone in a new file, selected."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = bpy.data.objects.new(recording.name, None)
    obj.rotation_mode = rotation_mode
    bpy.context.collection.objects.link(obj)
    animation.bake_poses(obj, recording.frames, recording.poses)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    return obj


def outcome(obj: bpy.types.Object, how: str, recording: Recording, truth: Poses, radius: float) -> Outcome:
    """What an object has now for keys, and shows."""
    curves = [
        [key.co.x for key in fcurve.keyframe_points]
        for fcurve in animation.channelbag_of(obj).fcurves
        if fcurve.data_path.startswith(("location", "rotation"))
    ]
    frames, count = len(set().union(*curves)), sum(map(len, curves))
    numbers = frames * (1 + len(curves)) if animation.is_reduced(obj) else 6 * count
    error = shell_error(animation.read_poses(obj, recording.frames), truth, radius)
    return Outcome(how, count / len(curves), frames, numbers, float(error.max()), rms(error))


def measure(recording: Recording, rotation_mode: str, tolerance: float, radius: float) -> list[Outcome]:
    """Of reducing to poses; of Decimate with as many keys, with keys on as many frames, and as good."""
    obj = import_recording(recording, rotation_mode)
    truth = animation.read_poses(obj, recording.frames)
    animation.reduce_keys_of(obj, "motor_spline", tolerance, radius)
    reduced = outcome(obj, "Reduce Keys to Poses", recording, truth, radius)

    def decimated(how: str, **options: object) -> Outcome:
        obj = import_recording(recording, rotation_mode)
        decimate(obj, **options)
        return outcome(obj, f"Decimate, {how}", recording, truth, radius)

    def by_ratio(how: str, keys: float) -> Outcome:
        return decimated(how, mode="RATIO", factor=1.0 - keys / len(recording.frames))

    as_many_frames = None
    fewest, most = 2, round(reduced.keys)
    while fewest < most:
        keys = (fewest + most + 1) // 2
        tried = by_ratio("as many frames", keys)
        if tried.frames <= reduced.frames:
            fewest, as_many_frames = keys, tried
        else:
            most = keys - 1

    as_good, (low, high) = None, np.log(MARGINS)
    for _ in range(TRIALS):
        margin = 0.5 * (low + high)
        tried = decimated("as good", mode="ERROR", remove_error_margin=float(np.exp(margin)))
        if tried.largest <= reduced.largest:
            low = margin
            as_good = tried if as_good is None or tried.keys < as_good.keys else as_good
        else:
            high = margin
    found = (reduced, by_ratio("as many keys", reduced.keys), as_many_frames, as_good)
    return [one for one in found if one is not None]


def report(recordings: Iterable[Recording], rotation_mode: str, tolerance: float, radius: float) -> Iterator[str]:
    """The figures of an object that turns in this way, as lines of Markdown."""
    yield f"## Turned by {rotation_mode}"
    yield ""
    outcomes = []
    yield "| recording | | keys in a channel | frames with keys | numbers | largest error, mm | RMS, mm |"
    yield "|---|---|---:|---:|---:|---:|---:|"
    for recording in recordings:
        print(f"{recording.name}, {rotation_mode} ...", file=sys.stderr, flush=True)
        first = f"{recording.name}, {len(recording.frames)} frames"
        outcomes.append(measure(recording, rotation_mode, tolerance, radius))
        for one in outcomes[-1]:
            yield (
                f"| {first} | {one.how} | {one.keys:.0f} | {one.frames} | {one.numbers} "
                f"| {1e3 * one.largest:.2f} | {1e3 * one.rms:.2f} |"
            )
            first = ""
    yield ""
    yield from summary(outcomes)
    yield ""


def summary(outcomes: list[list[Outcome]]) -> Iterator[str]:
    """What Decimate has of the figures of reduced poses: geometric means over the recordings."""
    yield "| Decimate, in multiples of the reduced poses | recordings | keys | frames | numbers | largest error | RMS |"
    yield "|---|---:|---:|---:|---:|---:|---:|"
    ratios: dict[str, list[list[float]]] = {}
    for reduced, *others in outcomes:
        for one in others:
            row = [getattr(one, name) / getattr(reduced, name) for name in FIGURES]
            ratios.setdefault(one.how, []).append(row)
    for how, rows in ratios.items():
        means = np.exp(np.log(rows).mean(axis=0))
        yield (
            f"| {how.removeprefix('Decimate, ')} | {len(rows)} | " + " | ".join(f"{mean:.2f}" for mean in means) + " |"
        )


def files(folder: Path | None) -> list[Path]:
    """The clips in assets/, and recordings in a folder, but for files that need Blender to read."""
    extensions = {extension for kind in FORMATS if kind.label != "Blender file" for extension in kind.extensions}
    others = folder.iterdir() if folder else ()
    return [*sorted(ASSETS.glob("*.csv")), *sorted(path for path in others if path.suffix.lower() in extensions)]


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write where asked."""
    parser = parser_of("reduction.py", __doc__)
    parser.add_argument("--recordings", type=Path, metavar="FOLDER", help="more recordings, axes and unit as they are")
    parser.add_argument("--bodies", type=Path, nargs="+", default=[], metavar="PATH", help="BVH, FBX, folders of them")
    parser.add_argument("--tolerance", type=float, default=0.005, help="in metres (%(default)s)")
    parser.add_argument("--radius", type=float, default=0.1, help="of the shell, in metres (%(default)s)")
    parser.add_argument("--fps", type=float, default=60.0, help="frames a second (%(default)g)")
    parser.add_argument("--output", type=Path, help="a Markdown file to write the tables to")
    options = parser.parse_args(arguments)
    try:
        recordings = [read(path, options.fps) for path in files(options.recordings)]
        bodies = rigs.files(options.bodies)
    except (TrajectoryError, OSError) as error:
        parser.error(str(error))
    command = (
        f"python scripts/research reduction --tolerance {options.tolerance:g} --radius {options.radius:g} "
        f"--fps {options.fps:g}{' --recordings ...' if options.recordings else ''}{' --bodies ...' if bodies else ''}"
    )
    lines = opening("Few keys instead of many", command, __doc__, Blender=bpy.app.version_string)
    animation.register()
    try:
        for rotation_mode in ROTATION_MODES:
            lines += report(recordings, rotation_mode, options.tolerance, options.radius)
        if bodies:
            lines += section(bodies, [(one.name, options.fps, one.poses) for one in recordings])
    finally:
        animation.unregister()
    publish(lines, options.output, of_reduction)
    return 0
