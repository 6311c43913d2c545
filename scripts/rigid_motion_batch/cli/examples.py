"""Make the examples of the checkout: the files that each of them begins with."""

from __future__ import annotations

import sys

from rigid_motion_batch.command_line import complain, parser_of, program_of
from rigid_motion_batch.places import CHECKOUT

PROGRAM = program_of("examples")


def main(arguments: list[str]) -> int:
    """Make them, and return the exit code."""
    if CHECKOUT is None:
        parser = parser_of("examples", __doc__)
        parser.add_argument("names", nargs="*", metavar="NAME", help="some of the examples (all)")
        parser.parse_args(arguments)
        complain(PROGRAM, "the examples are in a checkout of the source, and pip has installed the program alone")
        return 2
    sys.path.insert(1, str(CHECKOUT))
    from examples.make_examples import main as make

    return make(arguments)
