"""What a comparison would do, and why: planned as for a run, with nothing done."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rigid_motion_batch.workplan import Task, Workspace
from rigid_motion_batch.workplan.hashing import is_regular
from rigid_motion_batch.workplan.status import Status, explain

from .planning import Wanted, comparison_tasks, look_into, plan_of
from .version import program_version


def explain_comparison(output: Path, reading: Sequence[Task], wanted: Wanted, *, force: bool) -> list[str]:
    """What a run into a folder would do, in lines, as far as the recordings have been read before by these tasks.

    Raises
    ------
    FolderInUse, ManifestError, OSError
        As `Workspace` does.
    """
    with Workspace(output, shared=True) as workspace:
        known = [task for task in reading if all(is_regular(workspace.output / path) for path in task.outputs)]
        try:
            compared = _compared(workspace.output, known, wanted)
        except Exception:  # What was read may be damaged in any way: a run reads it again.
            known, compared = [], []
        tasks = {task.name: task for task in [*reading, *compared]}
        plan = plan_of(list(tasks.values()), program_version())
        survey = Status(plan, workspace.manifest, workspace.output, force=force).survey()
    wanted_names, known_names = ({task.name for task in some} for some in (reading, known))
    to_do = sum(bool(standing.reasons) for standing in survey.values())
    lines = explain(survey, plan)
    if unread := len(wanted_names - known_names):
        lines.append(f"Yet to be read: {unread} of {len(wanted_names)} recordings; more follows from what they hold.")
    return [*lines, f"To do: {to_do} of {len(survey)} tasks."]


def _compared(output: Path, known: list[Task], wanted: Wanted) -> list[Task]:
    """The tasks of a comparison of the recordings that are known; none where there is nothing to compare."""
    found = look_into(output, known, wanted.choices, wanted.radii)
    return comparison_tasks(found.studies, known, wanted) if found.studies else []
