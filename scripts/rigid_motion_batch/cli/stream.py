"""Motion over a network: what a recording costs as a stream."""

from __future__ import annotations

import argparse

from rigid_motion_batch.command_line import Parser, as_called, complain, program_of
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.arguments import add_reading_options, reading_options
from rigid_motion_batch.supervising import report

from . import stream_measure

SCRIPT = "stream.py"
PROGRAM = program_of(SCRIPT)


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; a wrong one ends the program with code 2 and a line that says what is wrong."""
    style = {"formatter_class": argparse.RawDescriptionHelpFormatter}
    parser = Parser(prog=PROGRAM, description=__doc__, **style)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    measuring = commands.add_parser(
        "measure",
        help="what a recording costs as a stream",
        description=stream_measure.__doc__,
        epilog=as_called(stream_measure.EPILOG, SCRIPT),
        **style,
    )
    stream_measure.add_options(measuring)
    add_reading_options(measuring)
    options = parser.parse_args(arguments)
    try:
        options.reading = reading_options(options)
    except ValueError as error:
        measuring.error(str(error))
    return options


def main(arguments: list[str]) -> int:
    """Measure, and return the exit code."""
    options = parse(arguments)
    try:
        stream_measure.run(options)
        report(ended=True)
        return 0
    except (TrajectoryError, RuntimeError, ValueError) as error:
        complain(PROGRAM, error)
    except OSError as error:
        complain(PROGRAM, error, options.output or options.command)
    return 2
