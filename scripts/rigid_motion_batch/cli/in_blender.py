"""A command that was started in a Blender whose Python lacks the libraries: it runs in a Python that has them.

That Python is the one of `--environment DIR`, or of an environment of the checkout, which is made where there is none.
The Blender that the command was started in makes the films. Standard library alone.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import cast

from rigid_motion_batch.places import CHECKOUT
from rigid_motion_batch.supervising import blender_program

LIBRARIES = ("filelock", "jinja2", "numpy", "pebble", "rich", "vl_convert")
"""Modules of the packages that a comparison needs beside Blender."""

OPTION = "--environment"


class NoEnvironment(Exception):
    """Why there is no Python to run in, and what to do about it."""


def elsewhere(script: str, arguments: list[str]) -> list[str] | None:
    """Return the command line that does the work of a script in another Python; None where this one has all it needs.

    Parameters
    ----------
    script : str
        Its path.
    arguments : list of str
        Those of the user; `--environment DIR` is taken out of them.

    Raises
    ------
    NoEnvironment
    """
    rest, folder = _without_option(arguments)
    if not folder and all(map(find_spec, LIBRARIES)):
        return None
    python = _checked(Path(folder)) if folder else _found() or _made()
    return [str(python), script, *rest, "--blender", blender_program()]


def become(command: list[str]) -> int:
    """Run a command in the place of this process, or wait for it where that cannot be."""
    print(f"{Path(command[1]).name}: runs in {Path(command[0]).parents[1]}", file=sys.stderr, flush=True)
    if os.name != "nt":
        os.execv(command[0], command)
    return subprocess.call(command)


def _without_option(arguments: list[str]) -> tuple[list[str], str]:
    """Return the arguments without `--environment DIR`, and DIR; empty where it was not given."""
    rest, folder = [], ""
    given = iter(arguments)
    for argument in given:
        name, equals, value = argument.partition("=")
        if name != OPTION:
            rest.append(argument)
            continue
        folder = value if equals else next(given, "")
        if not folder:
            raise NoEnvironment(f"{OPTION} needs a folder: one that `python scripts/bootstrap.py environment` has made")
    return rest, folder


def _python_in(folder: Path) -> Path:
    return folder.absolute() / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def _lacks(python: Path) -> str:
    """Return what a Python lacks of all that is needed, as it says itself; empty where it lacks nothing."""
    code = f"import sys, {', '.join(LIBRARIES)}; sys.exit(sys.version_info < (3, 11) and 'Python 3.11 or newer')"
    # Without what would have it look for modules in this one.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONHOME", "PYTHONPATH")}
    try:
        tried = subprocess.run([python, "-c", code], capture_output=True, text=True, errors="replace", env=environment)
    except OSError as error:
        return str(error)
    return (tried.stderr.strip() or "it does not start").splitlines()[-1] if tried.returncode else ""


def _checked(folder: Path) -> Path:
    python = _python_in(folder)
    if lacks := _lacks(python):
        raise NoEnvironment(
            f"{OPTION} {folder}: {lacks}. Make one with `python scripts/bootstrap.py environment {folder}`"
        )
    return python


def _found() -> Path | None:
    """Return the Python of an environment of the checkout that has everything."""
    folders = sorted((cast(Path, CHECKOUT) / ".venv").glob("*python-*"), reverse=True)
    return next((python for python in map(_python_in, folders) if python.exists() and not _lacks(python)), None)


def _made() -> Path:
    """Return the Python of an environment that is made by Blender's own."""
    bootstrap = cast(Path, CHECKOUT) / "scripts" / "bootstrap.py"
    made = subprocess.run([sys.executable, bootstrap, "environment"], stdout=subprocess.PIPE, text=True)
    if made.returncode:
        missing = ", ".join(name for name in LIBRARIES if not find_spec(name))
        raise NoEnvironment(
            f"this Blender's Python has no {missing}, and could not make an environment that has. With Python 3.11 "
            f"or newer and a network run\n  python3 {bootstrap} environment DIR\nand give it with {OPTION} DIR"
        )
    return _python_in(Path(made.stdout.splitlines()[-1]))
