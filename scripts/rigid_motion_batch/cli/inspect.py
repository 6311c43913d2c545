"""Inspect recordings: bodies, units, axes, rate, length, and what looks wrong, with its remedy.

The program reads a recording like the other commands, with the same options, and reports what it found. It changes
nothing. Only FBX and .blend files need Blender.
"""

from __future__ import annotations

import argparse
import json
import textwrap
from collections.abc import Iterator
from dataclasses import asdict

from rigid_motion_batch.command_line import INSTALLED, Parser, complain, listed, not_empty, printable
from rigid_motion_batch.places import CHECKOUT
from rigid_motion_batch.recordings import TrajectoryError, files_of
from rigid_motion_batch.recordings.inspecting import Contents, Inspection, MeasuredJitter, inspect
from rigid_motion_batch.recordings.options import add_reading_options, reading_options

PROGRAM = f"{'python scripts/bootstrap.py' if CHECKOUT else INSTALLED} inspect"

MAX_LISTED_NAMES = 12
"""Names of bodies or joints in one line, at most."""

LINE_CHARACTERS = 100
"""Width of a line, in characters."""

EPILOG = f"""
examples:
  {PROGRAM} hand.csv
  {PROGRAM} hand.csv --axes unity --scale 0.01
  {PROGRAM} log.csv:left --columns t=when,device=who --time-unit ms
  {PROGRAM} dance.bvh dance.bvh:LeftHand
  {PROGRAM} takes/
  {PROGRAM} take.csv --json

Exit code: 0 all could be read, 1 some could not, 2 none could, or a wrong option.
"""


def main(arguments: list[str]) -> int:
    """Inspect the recordings, and return the exit code."""
    options = _parse(arguments)
    result, failures = [], 0
    for source in (file for given in options.inputs for file in files_of(given)):
        try:
            inspection = inspect(source, options.axes, options.reading)
        except TrajectoryError as error:
            failures += 1
            result.append({"source": source, "error": str(error)})
            complain(PROGRAM, error)
            continue
        result.append(asdict(inspection))
        if not options.json:
            print(*_lines(inspection), sep="\n", flush=True)
    if options.json:
        print(json.dumps(result, indent=1, ensure_ascii=False))
    return 0 if not failures else 1 if failures < len(result) else 2


def _parse(arguments: list[str]) -> argparse.Namespace:
    formatter = argparse.RawDescriptionHelpFormatter
    parser = Parser(prog=PROGRAM, description=__doc__, epilog=EPILOG, formatter_class=formatter)
    parser.add_argument(
        "inputs", nargs="+", type=not_empty, metavar="INPUT", help="recordings, bodies of them (FILE:BODY), or folders"
    )
    parser.add_argument("--json", action="store_true", help="print everything as JSON, a list with an entry for each")
    add_reading_options(parser)
    options = parser.parse_args(arguments)
    try:
        options.reading = reading_options(options)
    except ValueError as error:
        parser.error(str(error))
    return options


def _lines(result: Inspection) -> Iterator[str]:
    """Yield the contents of a recording as lines of text."""
    size = f"{result.bytes / 1e6:.1f} MB" if result.bytes >= 1e6 else f"{result.bytes / 1e3:.1f} KB"
    yield printable(f"{result.source}: {result.format}, {size}")
    if len(result.bodies) > 1:
        yield from _row("bodies", f"{listed(result.bodies, MAX_LISTED_NAMES)} ({len(result.bodies)})")
    axes = f"{result.axes.name} ({result.axes.described}), {result.axes.known_from}"
    if result.axes.others:
        axes += f"; {result.contents[0].up} seems to be up, as in {' and '.join(result.axes.others)}: --axes"
    yield from _row("axes", axes)
    for body in result.contents:
        yield from _row("body", printable(body.name))
        yield from _body_lines(body)
    for name, problem in result.unreadable:
        yield from _row("body", f"{printable(name)}: {problem}")
    if result.note:
        yield from _row("note", result.note)


def _body_lines(body: Contents) -> Iterator[str]:
    timing, size = body.timing, body.size
    if body.joints:
        yield from _row("  joints", f"{listed(body.joints, MAX_LISTED_NAMES)} ({len(body.joints)})")
    samples = f"{timing.samples} in {timing.seconds:.4g} s"
    if timing.recorded != timing.samples:
        samples += f", of {timing.recorded} in the file"
    yield from _row("  samples", samples)
    rate = f"{timing.rate:.4g} a second, {'even' if timing.even else 'uneven'}"
    rate += f": intervals from {1e3 * timing.shortest:.3g} to {1e3 * timing.longest:.3g} ms"
    if timing.gaps:
        rate += f", {timing.gaps} gap{'s' * (timing.gaps > 1)}"
    yield from _row("  rate", rate)
    yield from _row("  lengths", f"{body.unit.name}, {body.unit.known_from}")
    extent = " x ".join(f"{length:.3g}" for length in size.extent)
    motion = f"{extent} m along x, y, z; {size.path:.3g} m of path; mostly below {size.speed:.3g} m/s and "
    motion += f"{size.turning:.3g} degrees/s; turns up to {size.turned:.3g} degrees away from its first pose"
    yield from _row("  motion", motion + "; it grows or shrinks" * body.scaled)
    if body.jitter:
        yield from _row("  jitter", _jitter(body.jitter))
    for repair in body.repairs:
        yield from _row("  repaired", repair)
    for warning in body.warnings:
        yield from _row("  warning", printable(warning.text))
        if warning.way_out:
            yield from _row("", f"-> {warning.way_out}")


def _jitter(found: MeasuredJitter) -> str:
    text = "not distinguishable from motion"
    if found.position or found.rotation:
        text = f"{1e3 * found.position:.2g} mm and {found.rotation:.2g} degrees"
    if found.spikes:
        text += f"; {len(found.spikes)} samples are spikes or repeat the one before: at "
        text += f"{listed([f'{time:.4g} s' for time in found.spikes], MAX_LISTED_NAMES)}"
    return text


def _row(name: str, text: str) -> list[str]:
    return textwrap.wrap(
        text, LINE_CHARACTERS, initial_indent=f"  {name:<11}", subsequent_indent=" " * 13, break_on_hyphens=False
    )
