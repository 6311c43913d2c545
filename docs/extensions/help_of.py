"""What a script or a package says of its options, as JSON: `python help_of.py NAME [SUBCOMMAND]` asks it for --help.

So the reference of commands has what they have, without a copy of it that could be wrong.
"""

from __future__ import annotations

import argparse
import json
import os
import runpy
import sys
from pathlib import Path


def main(name: str, *subcommands: str) -> None:
    """Print the description of the parser that answers to --help."""
    argparse.ArgumentParser.print_help = print_description
    sys.argv = [Path(name).name, *subcommands, "--help"]
    if name.endswith(".py"):
        sys.path[0] = str(Path(name).parent)
        runpy.run_path(name, run_name="__main__")
    else:
        runpy.run_module(name, run_name="__main__")


def print_description(parser: argparse.ArgumentParser, file: object = None) -> None:  # noqa: ARG001 - as of argparse
    """In place of the help for people, and the end of the program."""
    formatter = argparse.HelpFormatter(prog=parser.prog, width=100)
    print(
        json.dumps(
            {
                "usage": parser.format_usage().removeprefix("usage: ").strip(),
                "description": parser.description or "",
                "epilog": parser.epilog or "",
                "groups": [
                    {"title": group.title, "options": [of_option(formatter, action) for action in group._group_actions]}
                    for group in parser._action_groups
                    if group._group_actions
                ],
                "subcommands": subcommands_of(parser),
            }
        )
    )
    sys.stdout.flush()
    # Blender may not be taken down in the middle of starting.
    os._exit(0)


def subcommands_of(parser: argparse.ArgumentParser) -> list[str]:
    result = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return [name for action in result for name in action.choices]


def of_option(formatter: argparse.HelpFormatter, action: argparse.Action) -> dict[str, str]:
    """How an option is written, and what it does."""
    written = formatter._format_action_invocation(action)
    if not action.option_strings:
        written = formatter._format_args(action, formatter._get_default_metavar_for_positional(action))
    return {"written": written, "help": formatter._expand_help(action) if action.help else ""}


if __name__ == "__main__":
    main(*sys.argv[1:])
