"""The tasks of a comparison that was made, which are done, and what was wrong with those that failed."""

from __future__ import annotations

from pathlib import Path

from rigid_motion_batch.command_line import complain, parser_of, printable, program_of
from rigid_motion_batch.pipeline.steps import OWN_FOLDER
from rigid_motion_batch.pipeline.store import Store

SCRIPT = "tasks"

EPILOG = """
examples:
  rigid-motion tasks list renders/hand
  rigid-motion tasks list renders/hand --failed

To do a part of a comparison, as the workers of a farm do, give its command --only STAGE and --part K/N.
Exit code: 0 all tasks are done, 1 some failed, 2 there is no comparison.
"""


def main(arguments: list[str]) -> int:
    """List tasks, and return the exit code."""
    parser = parser_of(SCRIPT, __doc__, EPILOG)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    listing = commands.add_parser("list", help="list the tasks, and which are done")
    listing.add_argument("output", type=Path, metavar="OUTPUT", help="the output folder")
    listing.add_argument("--failed", action="store_true", help="only those that failed, with Python's messages")
    options = parser.parse_args(arguments)
    if not (options.output / OWN_FOLDER).is_dir():
        complain(program_of(SCRIPT), f"{options.output}: no comparison was made in this folder")
        return 2
    store = Store(options.output, alone=False)
    failures = store.noted("failures.json")
    for name, key in store.latest().items():
        index = store.index_of(key) or {}
        if not (name in failures or options.failed):
            print(printable(f"{name}: done in {index.get('seconds', 0.0):.1f} s"))
    for name, failure in failures.items():
        print(printable(f"{name}: failed: {failure['message']}"))
        if options.failed and failure.get("details"):
            print(failure["details"])
    return int(bool(failures))
