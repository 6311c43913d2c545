"""What the program that plans and runs keeps in memory of many tasks."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.radii import Radii
from rigid_motion_batch.comparison.planning import Study, Wanted, comparison_tasks, reading_tasks
from rigid_motion_batch.comparison.report.pages import Settings
from rigid_motion_batch.comparison.storage import ClipReference
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.workplan import Plan, SerialExecutor, Workspace
from rigid_motion_batch.workplan.running import RETRIES, _Run

CLIPS = 200

MOST = 10_000
"""Bytes a clip: ten thousand, and Python with the program, are to stay within 150 MB."""

WANTED = Wanted(
    choices=tuple(map(Uniform, ("5", "10", "15", "20"))),
    modes=tuple(MODES),
    radii=Radii(),
    settings=Settings(radius=0.1, program="Rigid Motion", blender="5", command="compare.py"),
    stage=None,
    every_film=False,
    count_keys=False,
)


@pytest.fixture
def traced() -> Iterator[None]:
    tracemalloc.start()
    yield
    tracemalloc.stop()


def begun(clips: int, workspace: Workspace) -> _Run:
    """A comparison of clips, planned and looked through, of which nothing is done yet."""
    read = reading_tasks([f"night/clip{number:05}.csv" for number in range(clips)], "blender")
    studies = [
        Study(
            ClipReference(f"clip{number:05}", task.arguments["recording"], 0),
            270,
            dict.fromkeys(WANTED.choices, (0.0, 3.0)),
        )
        for number, task in enumerate(read)
    ]
    plan = Plan(comparison_tasks(studies, read, WANTED), "1")
    return _Run(plan, workspace, SerialExecutor(), False, RETRIES, Progress(), str, True)


def test_a_clip_takes_ten_kilobytes_at_most_while_it_is_planned_and_done(tmp_path: Path, traced: None) -> None:
    with Workspace(tmp_path / "out") as workspace:
        begun(1, workspace)  # What is kept once for all.
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        run = begun(CLIPS, workspace)
        _, peak = tracemalloc.get_traced_memory()
    assert len(run.plan.order) > 6 * CLIPS
    assert (peak - before) / CLIPS < MOST
