"""Reproduce the paper: its figures, its table and its example, next to the paper's own numbers.

Kamarianakis, Lydatakis, Papagiannakis, "Never 'Drop the Ball' in the Operating Room", 2021. The table uses the clips in
assets/ and in the folder of --recordings. The part on whole bodies uses the files of --bodies.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rigid_motion_batch.command_line import complain, program_of
from rigid_motion_batch.system_libraries import require_blender

SCRIPT = "research paper"
PROGRAM = program_of(SCRIPT)

require_blender(SCRIPT)

import bpy

from research.drawing import save
from research.pages import FIGURES
from research.studies import files_in, publish, study_parser
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clips import Clip

from . import bodies, catching, holding, motions, sending, strips, table, timing, triangle
from .table import PAPER_RATES_PER_S, TIME_SAVED, UPDATES

EPILOG = """
examples:
  python scripts/research paper --recordings ../recordings --bodies ../rigs run.fbx
  python scripts/research paper --recordings ../recordings --only table sending
  python scripts/research paper --only pictures
  python scripts/research pages

Each part writes its numbers to docs/figures/paper_PART.json, and the pictures are in docs/paper/; the last command puts
them into docs/paper.md. The same command gives the same numbers again, except those of timing. On two processors
it takes less than an hour, the film longest.
Exit code: 0 done, 2 a wrong input or option, 130 stopped by Ctrl-C.
"""


def main(arguments: list[str]) -> int:
    """Reproduce the paper, and return the exit code."""
    parser = study_parser("paper", __doc__, EPILOG)
    parser.add_argument("--recordings", type=Path, metavar="FOLDER", help="more recordings for the table")
    parser.add_argument("--bodies", type=Path, nargs="+", default=[], metavar="PATH", help="whole bodies, or folders")
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS), metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--no-video", action="store_true", help="make pictures, but no film")
    parser.add_argument(
        "--rounds", type=int, default=timing.ROUND_COUNT, metavar="N", help="of the timing (%(default)s)"
    )
    options = parser.parse_args(arguments)
    try:
        for part in options.only:
            print(f"{PROGRAM}: {part}", file=sys.stderr, flush=True)
            if result := PARTS[part](options):
                publish(f"paper_{part}", result, options, *arguments, Blender=bpy.app.version_string)
    except (TrajectoryError, ValueError, OSError) as error:
        complain(PROGRAM, error)
        return 2
    return 0


def clips_of(options: argparse.Namespace) -> tuple[dict[str, list[Clip]], dict[str, str]]:
    """Return the clips of each set, and for each rejected recording, the reason."""
    files = files_in([options.recordings]) if options.recordings else []
    recordings, left_out = motions.read_all(files, motions.read_motion)
    sets = {"recordings": recordings, "assets": list(motions.assets().values())}
    return {name: clips for name, clips in sets.items() if clips}, left_out


# -- parts -------------------------------------------------------------------------------------------------------------


def tabulate(options: argparse.Namespace) -> dict[str, Any]:
    """Return Table 1, and why a screw wins on some clips and loses on others."""
    sets, left_out = clips_of(options)
    clips = [clip for of_set in sets.values() for clip in of_set]
    needed = {clip.name: table.needed(clip) for clip in clips}
    return {
        "paper": {
            "rates": UPDATES,
            "updates": list(PAPER_RATES_PER_S.values()),
            "time_saved": TIME_SAVED,
            "saved": [1.0 - fewer / rate for rate, fewer in PAPER_RATES_PER_S.items()],
        },
        "clips": {name: [clip.name for clip in of_set] for name, of_set in sets.items()},
        "samples": {name: sum(len(clip.times) for clip in of_set) for name, of_set in sets.items()},
        "seconds": {name: sum(float(it.times[-1] - it.times[0]) for it in of_set) for name, of_set in sets.items()},
        "left_out": left_out,
        "needed": {
            of_set: {name: table.means([needed[clip.name][name] for clip in clips]) for name in table.ROW_CHOICES}
            for of_set, clips in sets.items()
        },
        "by_clip": {
            name: {mode: table.means([row[mode]])["saved"] for mode in table.MODES} for name, row in needed.items()
        },
        "bows": {clip.name: table.bows_of(clip) for clip in clips},
    }


def send(options: argparse.Namespace) -> dict[str, Any]:
    """Return the costs of streams that send only when needed."""
    return sending.costs(next(iter(clips_of(options)[0].values())))


def hold(options: argparse.Namespace) -> dict[str, Any]:
    """Return the errors of a tool passed between recorded hands, in the world and in the space of the hand."""
    return holding.measure(next(iter(clips_of(options)[0].values())))


def measure_bodies(options: argparse.Namespace) -> dict[str, Any]:
    """Return the results of the study on whole bodies."""
    clips, left_out = motions.read_all(files_in(options.bodies, bodies.EXTENSIONS), bodies.read_body)
    return bodies.measure(clips) | {"left_out": left_out} if clips else {}


def race(options: argparse.Namespace) -> dict[str, Any]:
    """Return the running time of a frame, at the rates of Table 1 among others."""
    result = json.loads((options.root / FIGURES / "paper_table.json").read_text(encoding="utf-8"))
    needed = next(iter(result["needed"].values()))
    return timing.races(motions.assets()["reach"], needed, options.rounds)


def count_figures(_: argparse.Namespace) -> dict[str, Any]:
    """Return the figures in numbers."""
    thrown = motions.assets()["throw"]
    return {"triangle": triangle.figures(), "strips": strips.figures(), "catching": catching.figures(thrown)}


def draw(options: argparse.Namespace) -> None:
    """Draw the figures, and write them to docs/paper/."""
    folder = options.root / "docs" / "paper"
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in {"triangle": triangle.draw, "strips": strips.draw}.items():
        save(figure(), folder / f"{name}.png")
    catching.write_picture(motions.assets()["throw"], folder / "catching.png")
    if not options.no_video:
        catching.write_film(motions.assets()["throw"], folder / "catching.mp4")


PARTS: dict[str, Callable[[argparse.Namespace], dict[str, Any] | None]] = {
    "table": tabulate,
    "sending": send,
    "holding": hold,
    "bodies": measure_bodies,
    "timing": race,
    "figures": count_figures,
    "pictures": draw,
}
