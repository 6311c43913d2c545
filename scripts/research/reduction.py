"""What Reduce Keys to Poses leaves of recordings, beside Blender's own Decimate of the Graph Editor.

    python scripts/research reduction
    python scripts/research reduction --recordings FOLDER --bodies FOLDER_OR_FILES
    python scripts/research reduction --output docs/reduction.md

Each recording is an object with a key of location and rotation on every frame, as Blender's users import it. *Reduce
Keys to Poses* leaves the fewest keys that keep every point within `--radius` of the object's origin within
`--tolerance`. Blender's Decimate thins each channel by itself, with free handles between its keys, and gets the largest
error margin with which it is no worse, found by trials. Each cell has what *Reduce Keys to Poses* leaves, and then what
Decimate does: frames with a key in any channel, which is how many poses an animator has to look after; keys in a
channel; numbers to be stored, 6 for a key with free handles, and for a pose its frame and a value in each channel; and
the largest error. The last column has Decimate's error where it may have keys on no more frames than the other. All
errors are those of what Blender shows, on every frame.
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
from rigid_motion_batch.command_line import parser_of
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings import TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.reading import FORMATS
from rigid_motion_batch.scenes.decimated_bodies import decimate

ROTATION_MODES = {"QUATERNION": "quaternions", "XYZ": "Euler angles"}
"""What they are called on the page."""

COLUMNS = (
    "recording",
    "frames",
    "frames with keys",
    "keys in a channel",
    "numbers",
    "largest error, mm",
    "Decimate's on as few frames, mm",
)

MULTIPLES = "*Decimate's, in multiples of the other's*"

TRIALS = 14
"""Error margins tried until Decimate is as good as the reduced poses."""

MARGINS = (1e-6, 1.0)
"""The smallest and the largest of them, in the units of the channels."""


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

    keys: float
    """In a channel, on average."""

    frames: int
    """With a key in any channel."""

    numbers: int
    largest: float
    """Error, in metres."""


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


def outcome(obj: bpy.types.Object, recording: Recording, truth: Poses, radius: float) -> Outcome:
    """What an object has now for keys, and shows."""
    curves = [
        [key.co.x for key in fcurve.keyframe_points]
        for fcurve in animation.channelbag_of(obj).fcurves
        if fcurve.data_path.startswith(("location", "rotation"))
    ]
    frames, count = len(set().union(*curves)), sum(map(len, curves))
    numbers = frames * (1 + len(curves)) if animation.is_reduced(obj) else 6 * count
    error = shell_error(animation.read_poses(obj, recording.frames), truth, radius)
    return Outcome(count / len(curves), frames, numbers, float(error.max()))


def measure(
    recording: Recording, rotation_mode: str, tolerance: float, radius: float
) -> tuple[Outcome, Outcome | None, Outcome | None]:
    """Of reducing to poses; of Decimate as good as that, and with keys on as few frames; None where it cannot be."""
    obj = import_recording(recording, rotation_mode)
    truth = animation.read_poses(obj, recording.frames)
    animation.reduce_keys_of(obj, "motor_spline", tolerance, radius)
    reduced = outcome(obj, recording, truth, radius)

    def decimated(**options: object) -> Outcome:
        obj = import_recording(recording, rotation_mode)
        decimate(obj, **options)
        return outcome(obj, recording, truth, radius)

    as_few = None
    fewest, most = 2, round(reduced.keys)
    while fewest < most:
        keys = (fewest + most + 1) // 2
        tried = decimated(mode="RATIO", factor=1.0 - keys / len(recording.frames))
        if tried.frames <= reduced.frames:
            fewest, as_few = keys, tried
        else:
            most = keys - 1

    as_good, (low, high) = None, np.log(MARGINS)
    for _ in range(TRIALS):
        margin = 0.5 * (low + high)
        tried = decimated(mode="ERROR", remove_error_margin=float(np.exp(margin)))
        if tried.largest <= reduced.largest:
            low = margin
            as_good = tried if as_good is None or tried.keys < as_good.keys else as_good
        else:
            high = margin
    return reduced, as_good, as_few


def report(recordings: Iterable[Recording], rotation_mode: str, tolerance: float, radius: float) -> Iterator[str]:
    """The figures of an object that turns in this way, as lines of Markdown."""
    yield f"## Turned by {ROTATION_MODES[rotation_mode]}"
    yield ""
    yield f"| {' | '.join(COLUMNS)} |"
    yield "|---|" + "---:|" * (len(COLUMNS) - 1)
    outcomes = []
    for recording in recordings:
        print(f"{recording.name}, {rotation_mode} ...", file=sys.stderr, flush=True)
        outcomes.append(measure(recording, rotation_mode, tolerance, radius))
        yield row(recording, *outcomes[-1])
    yield means(outcomes)
    yield ""


def row(recording: Recording, reduced: Outcome, as_good: Outcome | None, as_few: Outcome | None) -> str:
    """The figures of a recording, empty where there are none."""
    cells = (
        [f"{reduced.frames} / {as_good.frames}", f"{reduced.keys:.0f} / {as_good.keys:.0f}"] if as_good else ["", ""]
    )
    cells += [f"{reduced.numbers} / {as_good.numbers}"] if as_good else [""]
    cells += [f"{1e3 * reduced.largest:.2f} / {1e3 * as_good.largest:.2f}"] if as_good else [""]
    cells += [f"{1e3 * as_few.largest:.2f}"] if as_few else [""]
    return f"| {recording.name} | {len(recording.frames)} | {' | '.join(cells)} |"


def means(outcomes: list[tuple[Outcome, Outcome | None, Outcome | None]]) -> str:
    """What Decimate has in multiples of reduced poses: geometric means over the recordings."""

    def mean(name: str, which: int) -> str:
        ratios = [getattr(one[which], name) / getattr(one[0], name) for one in outcomes if one[which]]
        return f"{np.exp(np.log(ratios).mean()):.2f}" if ratios else ""

    cells = [mean(name, 1) for name in ("frames", "keys", "numbers", "largest")]
    return f"| {MULTIPLES} | | {' | '.join((*cells, mean('largest', 2)))} |"


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
