"""Completion of commands, options and files in a shell, by shtab from the parsers of the commands."""

from __future__ import annotations

import argparse
import io
from contextlib import redirect_stderr
from importlib import import_module
from typing import Any, cast

import shtab

from rigid_motion_batch.command_line import INSTALLED, parser_of

from .commands import COMMANDS

SCRIPT = "completion"

DESCRIPTION = f"""Print what has a shell complete `{INSTALLED}`: its commands, their options, and files.
"""

EPILOG = f"""
examples:
  eval "$({INSTALLED} completion bash)"                                          in this shell
  {INSTALLED} completion bash > ~/.local/share/bash-completion/completions/{INSTALLED}
  {INSTALLED} completion zsh > ~/.zfunc/_{INSTALLED}                             a folder of $fpath
  {INSTALLED} completion fish > ~/.config/fish/completions/{INSTALLED}.fish
"""


def main(arguments: list[str]) -> int:
    """Print the script of a shell, and return the exit code."""
    parser = parser_of(SCRIPT, DESCRIPTION, EPILOG)
    parser.add_argument("shell", choices=shtab.SUPPORTED_SHELLS, metavar="SHELL", help="%(choices)s")
    shell = parser.parse_args(arguments).shell
    print(shtab.complete(whole_parser(), shell, root_prefix="rigid_motion"))
    return 0


def whole_parser() -> argparse.ArgumentParser:
    """Return a parser with all commands. Those that need packages that are not here take files alone."""
    whole = argparse.ArgumentParser(INSTALLED)
    commands = whole.add_subparsers()
    for name, (module, about) in COMMANDS.items():
        result = parser_of_module(module)
        parser = commands.add_parser(name, help=about, parents=[result] if result else [], add_help=False)
        if not result:
            parser.add_argument("files", nargs="*")
        for action in parser._actions:
            if not action.choices and action.nargs != 0:
                cast(Any, action).complete = shtab.FILE
    return whole


class _Shown(Exception):
    """Raised with a parser that is to show its help."""


def parser_of_module(module: str) -> argparse.ArgumentParser | None:
    """Return the parser of a command, which makes it to show its help; None where it cannot be made here."""

    def show(parser: argparse.ArgumentParser, file: object = None) -> None:  # noqa: ARG001 - as that of argparse
        raise _Shown(parser)

    parsers: Any = argparse.ArgumentParser
    before, parsers.print_help = parsers.print_help, show
    try:
        with redirect_stderr(io.StringIO()):
            import_module(f".{module}", __package__).main(["--help"])
    except _Shown as shown:
        return shown.args[0]
    except (ImportError, SystemExit):
        pass
    finally:
        parsers.print_help = before
    return None
