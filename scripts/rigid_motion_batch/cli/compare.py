"""Compare interpolation modes on recorded trajectories: the program that people run.

Its options are in `comparison.options`, its tasks in `comparison.planning`; here they are done, in an output folder.
"""

from __future__ import annotations

import argparse
import sys
import time

from rigid_motion_batch.cli.compare_options import ALL, SCRIPT, parse
from rigid_motion_batch.command_line import as_typed, complain, path_line, program_of
from rigid_motion_batch.comparison import steps
from rigid_motion_batch.comparison.explaining import explain_comparison
from rigid_motion_batch.comparison.planning import (
    Wanted,
    comparison_tasks,
    look_into,
    plan_of,
    reading_tasks,
    without_films,
)
from rigid_motion_batch.comparison.report.pages import Settings
from rigid_motion_batch.comparison.steps import DECIMATED, FILM, JOINT_METRICS, KEYS_NEEDED, METRICS, REPORT
from rigid_motion_batch.comparison.version import blender_version, program_version
from rigid_motion_batch.places import CHECKOUT, manifest
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.scenes.settings import SubjectError
from rigid_motion_batch.supervising import report
from rigid_motion_batch.system_libraries import missing_for_rendering, way_out
from rigid_motion_batch.workplan import (
    Executor,
    ExecutorError,
    FolderInUse,
    ManifestError,
    Outcome,
    Plan,
    ProcessExecutor,
    SerialExecutor,
    State,
    Workspace,
    run,
)
from rigid_motion_batch.workplan.ownership import OutputError, require_free, require_same_inputs
from rigid_motion_batch.workplan.status import Status

PROGRAM = program_of(SCRIPT)


def main(arguments: list[str]) -> int:
    """Run a comparison, and return the exit code."""
    options = parse(arguments)
    command = as_typed(PROGRAM, arguments, options.inputs)
    needs_screen = not (options.explain or options.no_video or options.engine == "cycles")
    missing = missing_for_rendering() if needs_screen else None
    if missing:
        print(f"{PROGRAM}: {way_out(missing)}\nOr go without videos: --no-video", file=sys.stderr)
        return 2
    try:
        if options.explain:
            asked = wanted(options, command)
            reading = reading_tasks(options.inputs, options.axes, options.reading)
            print(*explain_comparison(options.output, reading, asked, force=options.force), sep="\n")
            return 0
        if not options.no_video:
            require_subject(options.object)
        version = program_version()
        with (
            Progress() as progress,
            Workspace(options.output) as workspace,
            _executor(options, progress, version) as executor,
        ):
            return _Run(options, workspace, executor, progress, command, version).run()
    except ImportError as error:
        print(f"{PROGRAM}: {error}\n{way_out(str(error))}", file=sys.stderr)
    except (SubjectError, FolderInUse, ManifestError, ExecutorError, OutputError) as error:
        complain(PROGRAM, error)
    except OSError as error:
        complain(PROGRAM, error, options.output)
    return 2


def require_subject(wanted: str) -> None:
    """Make sure that the object to show can be had.

    Raises
    ------
    SubjectError
        Where it cannot.
    ImportError
        Where there is no Blender to ask.
    """
    # Only here is Blender loaded, which takes longer than all else before the work begins.
    from rigid_motion_batch.scenes.subject import load_subject

    load_subject(wanted)


def _executor(options: argparse.Namespace, progress: Progress, version: str) -> Executor:
    """Who does the work. Raises ExecutorError where Dask is wanted, and is not there."""
    if options.scheduler is None:
        return SerialExecutor() if options.jobs == 0 else ProcessExecutor(options.jobs)
    try:
        from rigid_motion_batch.workplan.dask_executor import DaskExecutor
    except ImportError as error:
        way_out = "python scripts/bootstrap.py dask" if CHECKOUT else "pip install 'rigid-motion[farm]'"
        raise ExecutorError(f"--scheduler: {error}; `{way_out}` installs it") from None
    return DaskExecutor(
        options.scheduler,
        options.output,
        identify=f"{steps.__name__}:{steps.identify.__name__}",
        version=version,
        note=lambda text: progress.note(f"{PROGRAM}: {text}"),
    )


class _Run:
    """A comparison in its output folder."""

    def __init__(
        self,
        options: argparse.Namespace,
        workspace: Workspace,
        executor: Executor,
        progress: Progress,
        command: str,
        version: str,
    ) -> None:
        self.options, self.workspace, self.executor, self.progress = options, workspace, executor, progress
        self.command, self.version = command, version

    def run(self) -> int:
        """Read the recordings, see what there is to do, do it, and say what came of it."""
        started = time.perf_counter()
        options = self.options
        reading = reading_tasks(options.inputs, options.axes, options.reading)
        first = plan_of(list({task.name: task for task in reading}.values()), self.version)
        require_same_inputs(first, self.workspace, force=options.force)
        require_free(
            first, self.workspace, (METRICS, JOINT_METRICS, DECIMATED, KEYS_NEEDED, REPORT), force=options.force
        )
        read = self._do(first, "Reading")
        if read.interrupted:
            return 130
        there = [task for task in reading if read.states[task.name].there]
        if read.problem or not there:
            return 2
        try:
            found = look_into(self.workspace.output, there, options.choices, options.radius)
        except Exception:  # What was read before may be damaged in any way: it is read again.
            self.workspace.withdraw_damaged(first.order) or self.workspace.withdraw(first.order)
            read = self._do(first, "Reading")
            found = look_into(self.workspace.output, there, options.choices, options.radius)
        del first, reading  # Of ten thousand clips all of this is a third of the memory.
        for note in found.notes:
            self.progress.note(note)
        if not found.studies:
            higher = "--budget" if options.budget else "--rates"
            self.progress.note(f"{PROGRAM}: every clip is too short for two keys at these rates; give higher {higher}")
            return 2
        asked = wanted(options, self.command)
        for note in filter(None, (study.left_out(asked.stage) for study in found.studies if asked.stage)):
            self.progress.note(note)
        for note in filter(None, (study.not_decimated for study in found.studies)):
            self.progress.note(note)
        tasks = comparison_tasks(found.studies, there, asked)
        del there, found
        plan = plan_of(tasks, self.version)
        del tasks
        require_free(plan, self.workspace, force=options.force)
        for table in (JOINT_METRICS, DECIMATED, KEYS_NEEDED):
            if table not in plan.tasks:
                # What an earlier run found must not pass for a finding of this.
                (options.output / table).unlink(missing_ok=True)
        if asked.stage and self._has_films_to_make(plan):
            # The numbers take seconds, and films minutes: nobody has to wait for the one to see the other.
            measured = self._do(plan_of(without_films(plan.tasks.values()), self.version), "Measuring")
            if measured.interrupted or measured.problem:
                return 130 if measured.interrupted else 2
            page = self.workspace.output / REPORT
            self.progress.note(f"All numbers are there, and films come as they are made: {page}")
        outcome = self._do(plan, "Filming" if asked.stage else "Comparing")
        outcome.states |= read.states
        self._say(outcome, time.perf_counter() - started)
        return 130 if outcome.interrupted else 2 if outcome.problem else int(State.FAILED in outcome.states.values())

    def _has_films_to_make(self, plan: Plan) -> bool:
        films = [name for name, task in plan.tasks.items() if any(path.endswith(FILM) for path in task.outputs)]
        status = Status(plan, self.workspace.manifest, self.workspace.output, force=self.options.force)
        return any(map(status.reasons, films))

    def _do(self, plan: Plan, title: str) -> Outcome:
        outcome = run(
            plan,
            self.workspace,
            self.executor,
            force=self.options.force,
            progress=self.progress,
            title=title,
            describe=lambda problem: f"{PROGRAM}: {problem}",
        )
        if outcome.problem:
            self.progress.note(
                f"{PROGRAM}: {outcome.problem}; nothing that is done is lost: put that right, and run the same "
                "command again"
            )
        return outcome

    def _say(self, outcome: Outcome, seconds: float) -> None:
        """What came of it, and last the path of the report."""
        work = rendering = 0.0
        for record in map(self.workspace.manifest.get, outcome.of(State.DONE)):
            if record:
                work, rendering = work + record.seconds, rendering + record.facts.get("rendering", 0.0)
        share = f", {rendering:.1f} s ({rendering / work:.0%}) of them Blender's rendering" if rendering else ""
        lines = [f"{seconds:.1f} s in all; {work:.1f} s of work{share}.", f"Tasks: {outcome}."]
        page = self.workspace.output / REPORT
        if outcome.interrupted:
            holds = "the report holds what was ready" if outcome.states[REPORT].there else "there is no new report yet"
            lines.append(f"Stopped; {holds}. The same command goes on from here.")
        report(ended=True)
        for line in lines:
            print(line, file=sys.stderr)
        if outcome.states[REPORT].there:
            print(path_line(page), flush=True)


def wanted(options: argparse.Namespace, command: str) -> Wanted:
    """What is wanted of every clip, by these options of that command."""
    stage = options.stage
    settings = Settings(
        radius=options.radius.rigid,
        joint_radius=options.radius.joint,
        program=f"{manifest()['name']} {manifest()['version']}",
        blender=blender_version(),
        command=command,
        details={}
        if options.no_video
        else {
            "Videos": f"{stage.engine}, {stage.resolution[0]} x {stage.resolution[1]}, {stage.fps} frames/s",
            "Speed of the videos": "real time" if stage.slow_motion == 1 else f"{stage.slow_motion:g} times slower",
        },
    )
    return Wanted(
        choices=tuple(options.choices),
        modes=options.modes.names,
        radii=options.radius,
        settings=settings,
        stage=None if options.no_video else stage,
        every_film=options.films == ALL,
        count_keys=options.decimate == "adaptive",
        fit=options.fit,
        shared=options.shared,
    )
