"""Shared code of studies: their command line, their clock, and writing of their figures."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping
from pathlib import Path
from typing import TypeVar

from research.pages import ROOT, write_figures
from rigid_motion_batch.command_line import Parser, parser_of
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.reading import FORMATS

EXTENSIONS = frozenset(extension for known in FORMATS for extension in known.extensions)  # of recordings

Name = TypeVar("Name", bound=Hashable)


def study_parser(name: str, description: str, epilog: str = "") -> Parser:
    """Return the parser of a study, with an option for the output folder."""
    parser = parser_of(f"research {name}", description, epilog)
    parser.set_defaults(study=name)
    parser.add_argument("--root", type=Path, default=ROOT, metavar="FOLDER", help="of docs/figures (this checkout)")
    return parser


def publish(name: str, figures: object, options: argparse.Namespace, *given: object, **versions: object) -> int:
    """Write the figures of a study that ran with these arguments, and return the exit code."""
    command = " ".join(["python scripts/research", options.study, *map(str, given)])
    print(write_figures(name, figures, command, options.root, **versions))
    return 0


def report(text: str) -> None:
    """Print the name of the current measurement."""
    print(f"{text} ...", file=sys.stderr, flush=True)


def interleaved_seconds(
    runs: Mapping[Name, Callable[[], object]],
    rounds: int,
    *,
    warm: bool = False,
    most: float = float("inf"),
    clock: Callable[[], float] = time.perf_counter,
) -> dict[Name, list[float]]:
    """Return the seconds of every round of each run; rounds are interleaved, so a slowdown of the machine affects all.

    With `warm`, an unmeasured run comes before each measured one, to fill memory and caches. A run that has used `most`
    seconds gets no further rounds.
    """
    seconds: dict[Name, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            if sum(seconds[name]) < most:
                if warm:
                    run()
                start = clock()
                run()
                seconds[name].append(clock() - start)
    return seconds


def files_in(paths: Iterable[Path], extensions: Collection[str] = EXTENSIONS) -> list[Path]:
    """Return the given files, and all files with these extensions in the given folders and subfolders, each once.

    Raises
    ------
    TrajectoryError
        If a path does not exist, or a folder has no such files.
    """
    result: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise TrajectoryError(str(path), "no such file or folder", "check the path")
        files = [file for file in sorted(path.rglob("*")) if file.is_file() and file.suffix.lower() in extensions]
        if path.is_dir() and not files:
            raise TrajectoryError(str(path), "no recording in this folder", f"known: {', '.join(sorted(extensions))}")
        result |= dict.fromkeys(files if path.is_dir() else [path])
    return list(result)
