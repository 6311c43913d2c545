"""A work plan: many small tasks whose results are kept, so that a second run does only what is missing or has changed.

A task names a function, its arguments, the files it reads and the files it makes. A plan is tasks in an order that
their results ask for; a manifest in the output folder says what was made of what; executors do the work, here or in
processes. A program plans and runs like this:

    from rigid_motion_batch.workplan import Plan, ProcessExecutor, Task, Workspace, code_version, run

    plan = Plan([
        Task("count hand", "rigid_motion_batch.counting:count", {"column": "x"},
             inputs=("hand.csv",), outputs=("hand.json",)),
        Task("report", "rigid_motion_batch.counting:report", outputs=("report.html",), after=("count hand",)),
    ], version=code_version("rigid_motion_batch/counting.py"))
    with Workspace(Path("renders/counting")) as workspace, ProcessExecutor(jobs=2) as executor:
        outcome = run(plan, workspace, executor)

and `rigid_motion_batch/counting.py` holds the steps, functions that are given a `Job` for their files:

    @step
    def count(job: Job, *, column: str) -> None:
        job.writes("hand.json").write_text(...)

Whatever happens to the program, its processes or the machine, what is in place in the output folder under a name of
the plan is whole, and the same call goes on from there.
"""

from .executors import Executor, ExecutorError, SerialExecutor
from .hashing import code_version
from .lock import FolderInUse
from .manifest import ManifestError
from .plan import Plan, PlanError
from .processes import ProcessExecutor
from .running import Outcome, State, run
from .tasks import Job, Task, TaskError, step
from .workspace import Workspace

__all__ = [
    "Executor",
    "ExecutorError",
    "FolderInUse",
    "Job",
    "ManifestError",
    "Outcome",
    "Plan",
    "PlanError",
    "ProcessExecutor",
    "SerialExecutor",
    "State",
    "Task",
    "TaskError",
    "Workspace",
    "code_version",
    "run",
    "step",
]
