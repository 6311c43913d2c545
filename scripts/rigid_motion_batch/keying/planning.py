"""Planning a session: the inputs found in the named files and folders, and where each result goes.

No Blender is needed here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.gltf import ENDINGS as GLTF
from rigid_motion_batch.recordings.reading import JSON, TEXT, split_source

from .records import is_made

ALL = ":*"
"""Suffix of a recording's path that means all of its bodies."""

NAMES_OF_FILES = {".blend", ".bvh", *TEXT, *JSON, *GLTF}
"""Endings that mark a name as a file, not a folder."""


@dataclass(frozen=True)
class InputJob:
    """An input to process."""

    source: str
    """The file as the user named it, with the body of a recording if one was named."""

    folder: Path
    """The folder for the result."""

    output: Path
    """The file to write: the source itself if it is replaced in place; without an ending for a recording."""

    endings: tuple[str, ...] = ("",)
    """Endings that the output may get."""

    ending: str = ""
    """The ending that the user has named."""

    is_recording: bool = False
    is_found: bool = False
    """True if the file was found in a folder, not named by the user."""

    problem: str = ""
    """Why the input cannot be processed, and what the user can do."""

    @property
    def file(self) -> Path:
        return file_and_body(self.source)[0] if self.is_recording else Path(self.source)

    @property
    def title(self) -> str:
        return os.path.basename(self.source)

    @property
    def in_place(self) -> bool:
        return self.output == self.file


def file_and_body(source: str) -> tuple[Path, str | None]:
    """Return the file of a recording and the requested body, if any; the text as a path if there is no such file."""
    try:
        return split_source(source)
    except TrajectoryError:
        return Path(source), None


def results_below(
    folder: Path, endings: tuple[str, ...], made: Callable[[Path], bool], problems: list[OSError]
) -> Iterator[Path]:
    """Yield the files in and below a folder, except hidden files, results, and links that lead outside.

    Errors of unreadable folders are added to `problems`.
    """
    root = os.path.realpath(folder)
    for place, folders, names in os.walk(folder, onerror=problems.append):
        folders[:] = [name for name in folders if not name.startswith(".")]
        for path in (Path(place, name) for name in names if name.lower().endswith(endings)):
            is_inside = not path.is_symlink() or Path(os.path.realpath(path)).is_relative_to(root)
            if not path.name.startswith(".") and path.is_file() and is_inside and not made(path):
                yield path


def planned(
    inputs: Sequence[str],
    output: Path | None,
    endings: tuple[str, ...],
    made: Callable[[Path], bool],
    job_of: Callable[[str, Path], InputJob],
) -> list[InputJob]:
    """Return the jobs in the order of the inputs, sorted by path within folders; a file named twice is one job.

    Parameters
    ----------
    inputs : sequence of str
    output : Path, optional
        The folder for all results, with the same subfolders as the inputs; None writes beside each input.
    endings : tuple of str
        Endings of the files to take from folders.
    made : callable
        Returns whether a file is a result.
    job_of : callable
        Returns the job for an input and the folder of its result.
    """
    jobs: dict[object, InputJob] = {}
    for given in inputs:
        if not os.path.isdir(given):
            job = job_of(given, output or file_and_body(given)[0].parent)
            jobs.setdefault(_identity(job), job)
            continue
        closed: list[OSError] = []
        paths = sorted(results_below(Path(given), endings, made, closed))
        for path in paths:
            folder = output / path.parent.relative_to(given) if output else path.parent
            job = replace(job_of(os.fspath(path), folder), is_found=True)
            jobs.setdefault(_identity(job), job)
        problems = {error.filename: f"this folder cannot be read ({error.strerror}): allow it" for error in closed}
        if not (paths or problems):
            nothing = f"there is nothing to be done in this folder: name one with {', '.join(endings)} files, or a file"
            problems = {given: nothing}
        for place, problem in problems.items():
            jobs.setdefault(place, InputJob(place, Path(place), Path(place), problem=problem))
    return list(_without_conflicts(list(jobs.values())))


def named_file(output: Path | None, inputs: Sequence[str], endings: Collection[str]) -> Path | None:
    """Return the output if it names a file (for a single input); None if it is a folder.

    Raises
    ------
    ValueError
        If there are several inputs, or the input cannot become such a file.
    """
    if output is None or output.is_dir() or not (output.exists() or output.suffix.lower() in NAMES_OF_FILES):
        return None
    if len(inputs) > 1 or os.path.isdir(inputs[0]) or inputs[0].endswith(ALL):
        raise ValueError(f"--output {output} is a file, and there may be several results: give a folder")
    if output.suffix.lower() not in endings:
        raise ValueError(f"--output {output}: {inputs[0]} becomes a {' or '.join(endings)} file here: name such a one")
    return output


def place_of(path: Path) -> str:
    """Return the real location of a path: the same text for all paths that lead to it."""
    return os.path.normcase(os.path.realpath(path))  # Path.resolve of Python 3.11 fails where links go in circles.


def _identity(job: InputJob) -> object:
    return (place_of(job.file), file_and_body(job.source)[1]) if job.is_recording else place_of(job.file)


def _without_conflicts(jobs: list[InputJob]) -> Iterator[InputJob]:
    """Yield the jobs except for results of other inputs; a job that would overwrite another file gets a problem."""
    outputs = {place_of(path) for job in jobs if not job.in_place for path in _possible_outputs(job)}
    jobs = [job for job in jobs if place_of(job.file) not in outputs or not is_made(job.file)]
    sources = {place_of(job.file) for job in jobs}
    taken: dict[str, str] = {}
    for job in jobs:
        for path in () if job.problem or job.in_place else _possible_outputs(job):
            if (place := place_of(path)) in sources:
                problem = f"this would be written over {path}, which is to be read too: leave one of them out"
                job = replace(job, problem=problem)
            elif place in taken and not job.problem:
                job = replace(job, problem=f"{taken[place]} is written to {path} too: use another --output for it")
            taken.setdefault(place, job.source)
        yield job


def _possible_outputs(job: InputJob) -> list[Path]:
    """Return the files that may be written, as far as known before a recording is read."""
    is_single = not job.source.endswith(ALL)
    return [job.output.with_name(f"{job.output.name}{ending}") for ending in job.endings if is_single]
