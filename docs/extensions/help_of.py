"""Print the --help of a script or package as JSON: `python help_of.py NAME [SUBCOMMAND]`.

The reference of commands is made from this, so it cannot differ from the commands themselves.
"""

from __future__ import annotations

import argparse
import json
import os
import runpy
import sys
from pathlib import Path


def main(name: str, *subcommands: str) -> None:
    """Run a program with --help, and print the description of its parser as JSON."""
    argparse.ArgumentParser.print_help = print_description
    sys.argv = [Path(name).name, *subcommands, "--help"]
    if name.endswith(".py"):
        sys.path[0] = str(Path(name).parent)
        runpy.run_path(name, run_name="__main__")
    else:
        runpy.run_module(name, run_name="__main__")


def print_description(parser: argparse.ArgumentParser, file: object = None) -> None:  # noqa: ARG001 - as of argparse
    """Print a parser as JSON and exit; replaces `ArgumentParser.print_help`."""
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
    # Blender must not be shut down while it is still starting.
    os._exit(0)


def subcommands_of(parser: argparse.ArgumentParser) -> list[str]:
    result = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return [name for action in result for name in action.choices]


def of_option(formatter: argparse.HelpFormatter, action: argparse.Action) -> dict[str, str]:
    """Return how an option is written, and its help text."""
    written = formatter._format_action_invocation(action)
    if not action.option_strings:
        written = formatter._format_args(action, formatter._get_default_metavar_for_positional(action))
    return {"written": written, "help": formatter._expand_help(action) if action.help else ""}


if __name__ == "__main__":
    main(*sys.argv[1:])
