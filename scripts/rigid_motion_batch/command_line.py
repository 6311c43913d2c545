"""Command-line tools that all commands share, in Python and in Blender: parsers, argument types, messages."""

from __future__ import annotations

import argparse
import difflib
import json
import math
import os
import shlex
import sys
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NoReturn

INSTALLED = "rigid-motion"
"""The command that pip installs."""

MOST_INPUTS = 12
"""The number of inputs after which a typed command is cut short."""

BREAK_LINES = ("Cc", "Cs", "Zl", "Zp")
"""Unicode categories of control characters, surrogates, and separators of lines and paragraphs."""


def own_arguments(script: str) -> list[str]:
    """Return the arguments that are meant for a script, given its `__file__`.

    In Blender (`blender --background --python SCRIPT -- ARGUMENTS`), these are the arguments after "--"; in Python,
    all.
    """
    if Path(sys.argv[0]).name == Path(script).name:
        return sys.argv[1:]
    return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []


def program_of(script: str) -> str:
    """Return the name of a command as it was started: its script, such as "bake.py", or "rigid-motion bake"."""
    called = Path(sys.argv[0]).name if sys.argv else ""
    return called if called.startswith(f"{INSTALLED} ") else script


def as_called(text: str, script: str) -> str:
    """Return a text with its examples of `python scripts/...` in the form in which the user started the command."""
    program = program_of(script)
    if program == script:
        return text
    lines = (line for line in text.splitlines() if f"blender --background --python scripts/{script}" not in line)
    return "\n".join(lines).replace(f"python scripts/{script}", program)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are two lines, for any input, and suggest what the user may have meant."""

    def error(self, message: str) -> NoReturn:
        names = [
            self._get_formatter()._format_args(action, action.dest.upper()) for action in self._get_positional_actions()
        ]
        usage = " ".join([self.prog, *names, "[options]"])
        error = f"{self.prog}: error: {printable(message)}"
        self.exit(2, f"usage: {usage}   (--help lists the options)\n{error}\n")

    def parse_args(  # type: ignore[override]  # what it returns is Any, whatever the namespace is
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> Any:
        options, unknown = self.parse_known_args(args, namespace)
        if unknown:
            name = next((word for word in unknown if word.startswith("-")), unknown[0]).partition("=")[0]
            self.error(f"unrecognized arguments: {name}{did_you_mean(name, self._all_options())}")
        return options

    def _all_options(self) -> list[str]:
        """Return the options of this parser, and of its subcommands."""
        below = [action.choices.values() for action in self._actions if isinstance(action, argparse._SubParsersAction)]
        return [
            *self._option_string_actions,
            *(name for ones in below for item in ones for name in item._all_options()),
        ]

    def _get_value(self, action: argparse.Action, text: str) -> Any:
        try:
            value = self._registry_get("type", action.type, action.type)(text)
        except ValueError as error:  # Its message says what is wrong; argparse would name the type.
            raise argparse.ArgumentError(action, str(error)) from None
        if action.choices is None or isinstance(action, argparse._SubParsersAction) or not isinstance(value, str):
            return value
        fitting = (choice for choice in action.choices if str(choice).lower() == value.lower())
        return value if value in action.choices else next(fitting, value)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            known = list(map(str, action.choices))
            meant = did_you_mean(str(value), known)
            raise argparse.ArgumentError(action, f"invalid choice: {value!r}{meant} (choose from {', '.join(known)})")


def did_you_mean(word: str, words: Iterable[str]) -> str:
    """Return the nearest of some words as the end of an error message; empty if none is near."""
    known = {name.lower().lstrip("-"): name for name in words}
    near = difflib.get_close_matches(word.lower().lstrip("-"), known, n=1, cutoff=0.7)
    return f": did you mean {known[near[0]]}?" if near else ""


def parser_of(script: str, description: str, epilog: str = "", **options: Any) -> Parser:
    """Return the parser of a command.

    Its help shows these texts as they are written, with examples as the user types commands.
    """
    return Parser(
        prog=program_of(script),
        description=as_called(description, script),
        epilog=as_called(epilog, script),
        formatter_class=argparse.RawDescriptionHelpFormatter,
        **options,
    )


def as_typed(program: str, arguments: Sequence[str], inputs: Sequence[str]) -> str:
    """Return a command as one would type it; of many inputs, only the first few and the number of others."""
    left_out = set(inputs[MOST_INPUTS:]) - set(inputs[:MOST_INPUTS])
    typed = shlex.join([*program.split(), *(argument for argument in arguments if argument not in left_out)])
    return f"{typed} # and {len(left_out)} more" if left_out else typed


# Types of arguments: each raises ValueError with what is wrong and the way out, which `Parser` prints.


def number(text: str) -> float:
    """Return the number in an option; NaN, which is within no bounds, if it is no number."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def bounded(what: str, least: float, most: float, above: bool = False) -> Callable[[str], float]:
    """Return an argument type: a number from `least` to `most`, or above `least`."""

    def parse_number(text: str) -> float:
        value = number(text)
        if not least <= value <= most or (above and value == least):
            raise ValueError(f"{text!r} is not a {what}; give {'more than ' * above}{least:.7g} to {most:.7g}")
        return value

    return parse_number


def whole(what: str, least: int, most: int) -> Callable[[str], int]:
    """Return an argument type: a whole number from `least` to `most`."""

    def parse_whole(text: str) -> int:
        if not (text.isascii() and text.isdecimal() and least <= float(text) <= most):
            raise ValueError(f"{text!r} is not a {what}; give a whole number from {least} to {most}")
        return int(text)

    return parse_whole


def folder_path(text: str) -> Path:
    """Return the folder that an option names."""
    if not text.strip() or "\0" in text:
        raise ValueError(f"{text!r} is not a folder; give one such as renders/hand, or . for this one")
    return Path(text)


def not_empty(text: str) -> str:
    """Return the file that an argument names."""
    if not text.strip():
        raise ValueError(f"{text!r} is not a file: a variable of a script may be empty")
    return text


def printable(text: str) -> str:
    r"""Return the text in one line, with control characters escaped as in Python: a line break becomes \n."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def complain(program: str, problem: object, place: object = "") -> None:
    """Print an error in one line on standard error: for an OSError its file, or else `place`, and the reason."""
    if isinstance(problem, OSError):
        problem = f"{problem.filename or place}: {problem.strerror or problem}"
    print(f"{program}: {printable(str(problem))}", file=sys.stderr)


def path_line(path: str | os.PathLike[str]) -> str:
    """Return a path as a line of output.

    A path that would break the line, or contains control characters of terminals, is written as JSON.
    """
    text = os.fspath(path)
    odd = text.startswith('"') or any(unicodedata.category(c) in BREAK_LINES for c in text)
    return json.dumps(text) if odd else text


def listed(names: Iterable[str], limit: int = 30, more: int = 0) -> str:
    """Return the names separated by commas, cut off after `limit`; `more` further names are not among them."""
    names = [*names]
    left = max(len(names) - limit, 0) + more
    return ", ".join(names[:limit]) + (f" and {left} more" if left else "")
