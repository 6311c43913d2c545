"""Make the examples: write the start files of each example to its own folder.

python scripts/bootstrap.py examples [NAME ...] [--picture] [--check]

With --picture, also render the pictures of the READMEs. With --check, run every command in the READMEs in a temporary
folder, without films, to see whether it works.
"""

from __future__ import annotations

import argparse
import glob
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
sys.path[:0] = [str(ROOT)]

from scripts import bootstrap

NAMES = "lid", "sword", "hand", "dancer", "camera", "farm"

PROMPT = "python scripts/bootstrap.py "
"""The start of every command in the READMEs."""

QUICK = {"compare": ("--no-video", "--jobs", "0"), "bundle": ("--no-video", "--jobs", "0")}
"""Options added to commands by --check, to make them quicker."""


def main(arguments: list[str] | None = None) -> int:
    """Make or check the named examples (default: all), and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of {', '.join(NAMES)} (all)")
    parser.add_argument("--picture", action="store_true", help="render the pictures of the READMEs anew, too")
    parser.add_argument("--check", action="store_true", help="run what the READMEs say, in a temporary folder")
    options = parser.parse_args(arguments)
    if unknown := [name for name in options.names if name not in NAMES]:
        parser.error(f"there is no example {unknown[0]!r}; the examples are {', '.join(NAMES)}")
    names = options.names or NAMES
    if options.check:
        return check(names)
    picture = ["--picture"] if options.picture else []
    return max(subprocess.call([sys.executable, str(HERE / name / "make.py"), *picture]) for name in names)


def check(names: tuple[str, ...] | list[str]) -> int:
    """Run the commands in the READMEs of these examples, print which READMEs fail, and return 1 if any does."""
    failed = 0
    with tempfile.TemporaryDirectory() as folder:
        copy_to(Path(folder))
        for name in names:
            try:
                run_readme(name, Path(folder))
                print(f"{name}: works", flush=True)
            except subprocess.CalledProcessError as error:
                failed += 1
                print(f"{name}: {shlex.join(error.cmd)} failed:\n{error.stdout}{error.stderr}", flush=True)
    return int(failed > 0)


def copy_to(folder: Path) -> None:
    """Copy the examples, without generated files, to a folder in which commands can run."""
    made = shutil.ignore_patterns("*.blend", "*.csv", "takes", "__pycache__")
    shutil.copytree(HERE, folder / HERE.name, ignore=made)


def commands_of(name: str) -> list[str]:
    """Return the commands in the README of an example, as typed."""
    lines = (HERE / name / "README.md").read_text(encoding="utf-8").splitlines()
    return [line.strip() for line in lines if line.startswith(f"    {PROMPT}")]


def run_readme(name: str, folder: Path) -> str:
    """Run the commands of a README in a folder with a copy of the examples, and return what they print.

    After `bundle`, also run the command in its last line of output, as that README says.

    Raises
    ------
    subprocess.CalledProcessError
        If a command fails.
    """
    printed = []
    for line in commands_of(name):
        printed.append(run(shlex.split(line.removeprefix(PROMPT)), folder))
        if line.startswith(f"{PROMPT}bundle "):
            printed.append(run(shlex.split(printed[-1].splitlines()[-1]), folder))
    return "".join(printed)


def run(words: list[str], folder: Path) -> str:
    """Run a command of bootstrap.py with this Python and the `QUICK` options, and return its output."""
    command, *rest = words
    (program, *options), _ = bootstrap.COMMANDS[command]
    if Path(program).is_relative_to(HERE):
        program = folder / HERE.name / Path(program).name
    # Not pathlib's glob, which refuses absolute patterns.
    rest = [result for word in rest for result in (sorted(glob.glob(word, root_dir=folder)) or [word])]  # noqa: PTH207
    paths = [folder, ROOT, ROOT / "addon", ROOT / "scripts"]
    done = subprocess.run(
        [sys.executable, str(program), *options, *rest, *QUICK.get(command, ())],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


if __name__ == "__main__":
    sys.exit(main())
