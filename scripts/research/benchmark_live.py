"""What live in-betweens cost in Blender, beside its own baking and its own playback, in one run on this machine.

    python scripts/research benchmark_live
    python scripts/research benchmark_live --objects 20 --rounds 10
    python scripts/research benchmark_live --only choosing shots
    python scripts/research benchmark_live --output docs/benchmark_live.md

Scenes of objects, and a rig, with location and rotation keys as Blender inserts them, in the mode *Screw*. The same
work is done in turn with and without rigid motion, so that a machine that slows down slows both. Numbers are medians,
with the fastest in brackets. Compare the ratios; the times depend on the machine. Where the project has set itself a
goal, the table says whether it was met or missed.
"""

from __future__ import annotations

import sys
from functools import partial
from pathlib import Path

import bpy

from research.live_benchmark.baking import long_bakes
from research.live_benchmark.everyday import everyday
from research.live_benchmark.rigs import RigSize, rigs
from research.live_benchmark.scenes import Size
from research.live_benchmark.shots import choosing, shots
from research.publishing import opening, publish
from research.summaries import of_live
from rigid_motion import animation
from rigid_motion_batch.command_line import parser_of

CHOOSING = Size(400, 10, 1000)
"""A mode is chosen for all of these."""

SHOT = Size(300, 20, 2000)
"""All of these are edited, and saved."""

RIG = RigSize(100, 10, 1000, vertices=20_000)
"""One of its bones is edited, all are filled in anew, and it is played."""

LONG = (Size(1, 200, 50_000), Size(1, 200, 100_000))
"""These are baked."""


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write where asked."""
    parser = parser_of("benchmark_live.py", __doc__)
    parser.add_argument("--objects", type=int, default=100, help="live objects in the everyday scene (%(default)s)")
    parser.add_argument("--keys", type=int, default=10, help="keys of each, on all channels (%(default)s)")
    parser.add_argument("--frames", type=int, default=1000, help="frames from first key to last (%(default)s)")
    parser.add_argument("--rounds", type=int, default=40, help="rounds of the short measurements (%(default)s)")
    sections = {
        "everyday": "edits and playback of a scene",
        "choosing": f"a mode for {CHOOSING}",
        "shots": f"edits and files of {SHOT}",
        "rigs": f"edits and playback of a rig of {RIG}",
        "baking": " and ".join(f"{size.frames}" for size in LONG) + " frames of one object",
    }
    parser.add_argument(
        "--only",
        nargs="+",
        choices=sections,
        default=list(sections),
        metavar="SECTION",
        help="; ".join(f"{name}: {what}" for name, what in sections.items()) + " (all of them)",
    )
    parser.add_argument("--output", type=Path, help="a Markdown file to write the tables to")
    options = parser.parse_args(arguments)
    command = f"python scripts/research benchmark_live --rounds {options.rounds}"
    if options.only != list(sections):
        command += f" --only {' '.join(options.only)}"
    few = max(3, options.rounds // 8)
    run = {
        "everyday": partial(everyday, Size(options.objects, options.keys, options.frames), options.rounds),
        "choosing": partial(choosing, CHOOSING, few),
        "shots": partial(shots, SHOT, few),
        "rigs": partial(rigs, RIG, options.rounds),
        "baking": partial(long_bakes, LONG, 2 * few),
    }
    lines = opening("Benchmark of live in-betweens", command, __doc__, Blender=bpy.app.version_string)
    animation.register()
    try:
        for section in options.only:
            print(f"{sections[section]} ...", file=sys.stderr, flush=True)
            lines += run[section]()
    finally:
        animation.unregister()
    publish(lines, options.output, of_live)
    return 0
