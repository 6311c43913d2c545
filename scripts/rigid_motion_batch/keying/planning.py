"""Which inputs there are, and where the result of each goes: files and folders as they were named.

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
"""Behind a recording: all of its bodies."""

NAMES_OF_FILES = {".blend", ".bvh", *TEXT, *JSON, *GLTF}
"""Endings that the name of a folder does not have."""


@dataclass(frozen=True)
class InputJob:
    """An input to be done."""

    source: str
    """The file as it was named, and of a recording the body, where one was."""

    folder: Path
    """The folder that the result goes to."""

    output: Path
    """The file that is written, the same as the source where it is done in place; of a recording without its ending."""

    endings: tuple[str, ...] = ("",)
    """Endings that the output may get."""

    ending: str = ""
    """The one of them that the user has named."""

    is_recording: bool = False
    is_found: bool = False
    """True if it was found in a folder, and not named."""

    problem: str = ""
    """The reason why it cannot be done, and the way out."""

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
    """Return the file of a recording, and which body of it is meant; all of it where there is no such file."""
    try:
        return split_source(source)
    except TrajectoryError:
        return Path(source), None


def results_below(
    folder: Path, endings: tuple[str, ...], made: Callable[[Path], bool], problems: list[OSError]
) -> Iterator[Path]:
    """Yield the files of a folder and of those below it, but for hidden ones, results, and links that lead out.

    Why folders cannot be read is added to the problems.
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
    """Return what is to be done, in the order of the inputs and of the paths in folders;
    a file that is named twice is one.

    Parameters
    ----------
    inputs : sequence of str
    output : Path, optional
        The folder for all results, with the folders that lie in those of the inputs; beside each input otherwise.
    endings : tuple of str
        Of the files that are taken of a folder.
    made : callable
        Whether a file is a result.
    job_of : callable
        Given an input and the folder of its result.
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
    return list(_settled(list(jobs.values())))


def named_file(output: Path | None, inputs: Sequence[str], endings: Collection[str]) -> Path | None:
    """Return the output where it is the name of a file, for the one input that there is; None where it is a folder.

    Raises
    ------
    ValueError
        Where there are several inputs, or none that becomes such a file.
    """
    if output is None or output.is_dir() or not (output.exists() or output.suffix.lower() in NAMES_OF_FILES):
        return None
    if len(inputs) > 1 or os.path.isdir(inputs[0]) or inputs[0].endswith(ALL):
        raise ValueError(f"--output {output} is a file, and there may be several results: give a folder")
    if output.suffix.lower() not in endings:
        raise ValueError(f"--output {output}: {inputs[0]} becomes a {' or '.join(endings)} file here: name such a one")
    return output


def place_of(path: Path) -> str:
    """Return where a path leads to; the same for all paths that lead there."""
    return os.path.normcase(os.path.realpath(path))  # Path.resolve of Python 3.11 fails where links go in circles.


def _identity(job: InputJob) -> object:
    return (place_of(job.file), file_and_body(job.source)[1]) if job.is_recording else place_of(job.file)


def _settled(jobs: list[InputJob]) -> Iterator[InputJob]:
    """Yield the jobs without what this program made of others; what would be written over another is a problem."""
    outputs = {place_of(path) for job in jobs if not job.in_place for path in _outputs(job)}
    jobs = [job for job in jobs if place_of(job.file) not in outputs or not is_made(job.file)]
    sources = {place_of(job.file) for job in jobs}
    taken: dict[str, str] = {}
    for job in jobs:
        for path in () if job.problem or job.in_place else _outputs(job):
            if (place := place_of(path)) in sources:
                problem = f"this would be written over {path}, which is to be read too: leave one of them out"
                job = replace(job, problem=problem)
            elif place in taken and not job.problem:
                job = replace(job, problem=f"{taken[place]} is written to {path} too: use another --output for it")
            taken.setdefault(place, job.source)
        yield job


def _outputs(job: InputJob) -> list[Path]:
    """Return the files that may be written, as far as one can say before a recording is read."""
    some = not job.source.endswith(ALL)
    return [job.output.with_name(f"{job.output.name}{ending}") for ending in job.endings if some]
