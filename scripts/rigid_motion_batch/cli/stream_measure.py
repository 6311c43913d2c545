"""Measure the cost of a recording as a stream, and how well it is shown: `stream measure`.

The recording is sent over UDP on loopback, by the codec of docs/wire.md; another process shows it. Both use the clock
of the recording, however busy the machine is.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import cast

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.streams import StreamBody
from rigid_motion_batch.analysis.choices import Tolerance, radius_in_metres
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.axes import from_blender
from rigid_motion_batch.command_line import bounded, path_line
from rigid_motion_batch.files import replacing
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.bvh_writing import write_bvh
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.streaming.measuring import measure, measure_held
from rigid_motion_batch.streaming.sending import body_of, hand_of, samples_of, starting_together

EPILOG = """
examples:
  python scripts/stream.py measure walk.bvh
  python scripts/stream.py measure walk.bvh --tolerance 5mm --delay 0.2 --loss 0.01 --output shown.bvh --json
  python scripts/stream.py measure log.csv:left --output shown.csv
  python scripts/stream.py measure log.csv:hand log.csv:tool --held log-tool log-hand --loss 0.05

Bytes a second exclude what a new listener gets once (names, parents, rest
poses), which has its own line. Headers are those of UDP and IPv4, 28 bytes a datagram. shown.bvh is what was
shown at the recording's moments, in its units and axes. With --held it reports how far the tool slips in the hand, and
what that costs: as two streams, as bodies of one stream, and with the tool sent in the hand's space.
"""


_delay = bounded("number of seconds", 0.0, 4.0, above=True)
_share = bounded("part of all", 0.0, 0.99)


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options of this command, without those of reading."""
    help = "a recording of a body; FILE:BODY for one of several; with --held everything with these two"
    parser.add_argument("recordings", nargs="+", metavar="RECORDING", help=help)
    help = "measure how far a body slips in its hand, by their names; HAND:JOINT is a joint of a skeleton"
    parser.add_argument("--held", nargs=2, metavar=("TOOL", "HAND"), help=help)
    help = "largest error: 5mm, 0.5cm (%(default)s)"
    parser.add_argument("--tolerance", type=Tolerance, default="5mm", metavar="LENGTH", help=help)
    parser.add_argument("--delay", type=_delay, default=0.1, metavar="S", help="seconds of delay (%(default)s)")
    help = "radius of each joint's ball: 3cm, or 0.03 (3 cm on an adult, in proportion, and to the ends of bones)"
    parser.add_argument("--radius", type=radius_in_metres, metavar="LENGTH", help=help)
    parser.add_argument("--loss", type=_share, default=0.0, metavar="P", help="share of datagrams to lose: 0.01")
    parser.add_argument("--output", "-o", type=Path, metavar="FILE", help="write what was shown, as .bvh or .csv")
    parser.add_argument("--json", action="store_true", help="print numbers as JSON")


def run(options: argparse.Namespace, _stopped: list[int]) -> None:
    """Measure, print and write. Raises TrajectoryError, OSError, RuntimeError or ValueError with the problem."""
    clips, _ = read_clips(options.recordings, options.axes, options.reading)
    if options.held:
        run_held(options, clips)
        return
    if len(clips) > 1:
        raise TrajectoryError(
            options.recordings[0], f"{len(clips)} bodies", "name one body with FILE:BODY, or two with --held TOOL HAND"
        )
    clip, tolerance = clips[0], options.tolerance.tolerance(clips[0])
    times, poses = samples_of(clip)
    body = body_of(clip, poses, options.radius)
    if options.output and (options.output.suffix.lower() == ".bvh") != (clip.rest_body is not None):
        raise ValueError(f"{options.output}: a body is written as .bvh, a single rigid body as .csv")
    cost, shown = measure([body], times, poses, tolerance, options.delay, options.loss)
    if options.output:
        write(options.output, clip, body, times, shown.at(times))
    if options.json:
        print(json.dumps({"recording": clip.name, **cost}, indent=2))
        return
    for line in lines(cost, tolerance):
        print(line)
    if options.output:
        print(path_line(options.output))


def run_held(options: argparse.Namespace, clips: list[Clip]) -> None:
    """Measure how far a tool slips in a hand, and print the result."""
    if options.output:
        raise ValueError("--held writes no file; leave --output out")
    bodies, times, poses = starting_together(clips, radius=options.radius)
    tool, hand = options.held
    tolerance = options.tolerance.tolerance(clips[0])
    ways = measure_held(bodies, times, poses, tolerance, options.delay, options.loss, tool, hand_of(hand))
    if options.json:
        print(json.dumps({"held": tool, "by": hand, **ways}, indent=2))
        return
    for way, numbers in ways.items():
        slip = f", {tool} slips {numbers['slip_mm']:.2f} mm at most" if "slip_mm" in numbers else ""
        print(f"{way}: {numbers['bytes_a_second_with_headers']:.0f} bytes a second with headers{slip}")


def write(path: Path, clip: Clip, body: StreamBody, times: np.ndarray, shown: Poses) -> None:
    """Write the shown motion in the units and axes of the recording."""
    there = from_blender(shown, clip.axes)
    there = Poses(there.positions / clip.metres_per_unit, there.quaternions)
    if clip.rest_body is None:
        write_poses(path, times, there[0])
    else:
        with replacing(path) as file:
            write_bvh(file, clip.rest_body, cast(np.ndarray, body.sliding), times, there)


def lines(cost: dict[str, float], tolerance: float) -> list[str]:
    """Return the numbers as lines of text."""
    alone, whole = cost["bytes_a_second"], cost["bytes_a_second_with_headers"]
    return [
        f"{whole:.0f} bytes a second with headers, {alone:.0f} without",
        f"error: {cost['rms_mm']:.2f} mm RMS, {cost['largest_mm']:.2f} mm at most",
        f"shown within {1000.0 * tolerance:g} mm for {100.0 * cost['share_within_tolerance']:.2f} % of the samples",
        f"datagrams: {cost['datagrams']}, of which {cost['lost']} were lost, in {cost['seconds']:.2f} s",
        f"to join: {cost['joining_bytes']} bytes; answers: {cost['answers_a_second']:.0f} bytes a second",
    ]
