"""The `clean` command: cleans all bodies of a recording, and writes a file of the same format beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rigid_motion.motion import Cleaned, shell_error
from rigid_motion.motion.quaternions import normalise
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.recordings import ReadingOptions, Recording, Trajectory, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.cleaning import cleaned_clip, described, fill_in, rows_of
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.reading import read_all_singles

from .planning import ALL
from .records import FileProblem, is_made
from .work import RunningJob

SUFFIX = "-cleaned"
"""Name ending of written files."""

MAX_WRITTEN_ROUNDING = 1e-6
"""How far written samples may be from the cleaned ones, in the unit of the file: its numbers have limited digits."""

TABLES = (".csv", ".tum")
"""The table formats that any rigid motion can be written to."""


@dataclass(frozen=True)
class Cleaning:
    """Settings for cleaning: plain data."""

    tolerance: Tolerance | None
    """How far a sample may be moved; None for any distance."""

    radius: float | None
    """Radius around each body or joint, in metres; None for the default."""

    axes: str | None
    reading: ReadingOptions


class CleanedBody(NamedTuple):
    """A cleaned body: its samples are rows `rows` of trajectory number `number`."""

    clip: Clip
    found: Cleaned
    trajectory: Trajectory
    rows: np.ndarray
    number: int


def do_cleaning(doing: RunningJob, how: Cleaning) -> None:
    """Clean the requested bodies of a recording, and write the file with them."""
    job = doing.job
    if job.file.stem.endswith(SUFFIX) and is_made(job.file):
        doing.leave_alone("this was cleaned before")
        return
    recording: Recording | None = None
    with doing.failing(), doing.reading():
        recording = read_all_singles(job.source, how.reading)
    if recording is not None:
        with doing.failing():
            _clean(doing, how, recording)


def _clean(doing: RunningJob, how: Cleaning, recording: Recording) -> None:
    job = doing.job
    doing.require_free(job.output)
    done: list[CleanedBody] = []
    for number, trajectory in enumerate(recording.trajectories):
        axes = how.axes or recording.axes
        try:
            clip = make_clip(trajectory, job.source, trajectory.name, axes, how.reading, measured=recording.measured)
        except TrajectoryError as error:
            doing.say(f"{trajectory.name} is unchanged: {error.problem}")
            continue
        tolerance = how.tolerance.tolerance(clip) if how.tolerance else None
        _, found = cleaned_clip(clip, tolerance, how.radius)
        rows = rows_of(clip, trajectory)
        body = f"{trajectory.name}: " if len(recording.trajectories) > 1 else ""
        said = "; ".join(described(clip, found, rows))
        written = trajectory.cells is None or trajectory.cells.times is not None
        stays = "; its times stay as stamped" if "clock" in said and not written else ""
        doing.say(f"{body}{said}{stays}")
        done.append(CleanedBody(clip, found, trajectory, rows, number))
    if not done:
        raise FileProblem("no body of it has two poses that can be used: record at least 2")
    if not doing.work.dry_run:
        with doing.record.writing(job.output) as beside:
            _write(beside, recording, done, how, job.output)
    doing.outcome.objects += len(done)
    doing.tell_written(job.output)


def _write(beside: Path, recording: Recording, done: list[CleanedBody], how: Cleaning, output: Path) -> None:
    """Write a file like the recording, or a table if the output is named so, and check that it reads back the same."""
    clip, found = done[0].clip, done[0].found
    if output.suffix.lower() != recording.path.suffix.lower():
        if clip.rest_body or len(done) > 1:
            raise FileProblem(f"a table holds one rigid motion: name a {recording.path.suffix} file with --output")
        write_poses(beside, found.times, found.poses)
        return
    table = next(ending for ending in TABLES if ending != output.suffix.lower())
    way_out = f"name a table, --output {output.stem}{table}, or clean all of the file"
    if (cells := done[0].trajectory.cells) is None:
        raise FileProblem(f"this cannot be written as it was read: {way_out}")
    numbers = np.full(cells.shape, np.nan)
    for each in done:
        fill_in(numbers, each.clip, each.found, each.trajectory, each.rows)
    cells.write(beside, numbers)
    body = f":{recording.body}" if recording.body else ALL if len(recording.trajectories) > 1 else ""
    again = read_trajectories(f"{beside}{body}", how.reading).trajectories
    for each in done:
        poses = again[each.number].poses[..., each.rows]
        poses = replace(poses, quaternions=normalise(poses.quaternions))
        if not shell_error(poses, each.found.poses).max() < MAX_WRITTEN_ROUNDING:
            raise FileProblem(f"this cannot be written so that it reads as it was meant: {way_out}")
