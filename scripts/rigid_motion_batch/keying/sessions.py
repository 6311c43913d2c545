"""A session: inputs done one after another or side by side, each wholly or not at all, and summed up in a line.

What an input needs is done by an executor of the pipeline, here or in a worker process. What was made of the same
input before, by the same version and with the same options, is not made again. Ctrl-C ends a session between two
steps: what was written by then is whole, and nothing else was touched. `supervising` has what is between them ended,
from outside.
"""

from __future__ import annotations

import os
import signal
import sys
import tempfile
from collections.abc import Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import cast

from rigid_motion_batch.command_line import complain, few, path_line, printable
from rigid_motion_batch.files import append_lines, lines_of
from rigid_motion_batch.pipeline import steps
from rigid_motion_batch.pipeline.executors import Executor, Made, ProcessExecutor, loss, processors
from rigid_motion_batch.progress import Progress, Stage
from rigid_motion_batch.supervising import blender_program, report, stop_signals, written_of

from .planning import Job
from .work import Doing, Outcome, Work

EXTENSION = "rigid_motion"
"""The id in blender_manifest.toml, which the name of the installed module ends with."""

LOOK = 0.2
"""Seconds between two looks at whether a session is to end."""

NAMED = 5
"""The number of failed inputs that are named again at the end, where there are more inputs than that."""

ROOMS = (
    "rigid_motion/animation",
    "rigid_motion/gltf",
    "rigid_motion/motion",
    "analysis",
    "keying",
    "recordings",
    "scenes/armature.py",
)
"""The packages that the files that are written depend on."""

NOTES = "notes"
"""The file of what is said of an input while it is done."""


class Keyed(steps.Step, rooms=ROOMS):
    """Do one input, wherever that is."""

    work: Work
    body: str
    """The body that is meant of the input."""

    output: str
    """The name of what is written."""

    version: str
    """The version of Blender, where it is needed."""

    job: Job | None = None
    """The input, which has no part in the key: the same in another place is done."""

    def make(self, job: steps.Job) -> dict[str, Outcome]:
        given = cast(Job, self.job)
        blender: AbstractContextManager[None] = nullcontext()
        if self.work.needs_blender(given):
            import bpy  # noqa: F401  It brings addon_utils.

            blender = _extension()
        doing = Doing(self.work, given, partial(_keep_note, job.place))
        try:
            with blender:
                self.work.do(doing)
        except Stopped as stopped:
            stopped.partly = doing.outcome
            raise
        return {"outcome": doing.outcome}


def do_all(program: str, jobs: Sequence[Job], work: Work, workers: int | None = None) -> int:
    """Do all inputs, print the paths of what was written, and return the exit code.

    Parameters
    ----------
    program : str
        What users call it.
    jobs : sequence of Job
    work : Work
    workers : int, optional
        Processes; 0 for this one. One for each processor, and this one for a single input, where None.
    """
    stopped, unmatched = None, set()
    try:
        executor = _executor(workers, len(jobs))
    except steps.RunError as error:
        complain(program, error)
        return 2
    if workers is None and len(jobs) == 1 and not blender_program():
        work = replace(work, processes=processors())
    with (
        Progress() as progress,
        executor,
        tempfile.TemporaryDirectory(prefix="rigid-motion-") as scratch,
        _stopped_between_steps(),
    ):
        session = _Session(jobs, work, executor, progress, Path(scratch))
        try:
            with progress.stage(work.doing, len(jobs)) as stage:
                session.run(stage)
        except Stopped as signalled:
            stopped = signalled.args[0]
            executor.stop()
            session.take_partly(signalled)
        else:
            unmatched = session.unmatched()
            for name in sorted(unmatched):
                progress.note(
                    f"{program}: --objects {name}: no object or bone of that name has anything to be {work.done}"
                )
    outcomes = session.in_order
    report(ended=True)
    if not work.dry_run:
        for path in (path for outcome in outcomes for path in outcome.written):
            print(path_line(path), flush=True)
    failed = [outcome.source for outcome in outcomes if outcome.failed]
    if failed and len(jobs) > NAMED:  # What was said of them is far above.
        print(f"Failed: {printable(few(failed, NAMED))}", file=sys.stderr)
    print(_summary(outcomes, len(jobs), work, interrupted=stopped is not None), file=sys.stderr, flush=True)
    if stopped is not None:
        return 128 + stopped
    if all(outcome.unreadable for outcome in outcomes):
        return 2
    return int(bool(unmatched) or any(outcome.refused or outcome.failed or outcome.incomplete for outcome in outcomes))


class _Session:
    """Inputs that are being done."""

    def __init__(self, jobs: Sequence[Job], work: Work, executor: Executor, progress: Progress, scratch: Path) -> None:
        self._jobs, self._work, self._executor, self._note = jobs, work, executor, progress.note
        self._scratch = scratch
        self._outcomes: dict[int, Outcome] = {}
        """By the places of the inputs."""
        self._at_work: dict[int, str] = {}
        """Places of inputs to the keys of their results."""
        self._futures: dict[Future[Made], tuple[int, steps.Job]] = {}

    @property
    def in_order(self) -> list[Outcome]:
        return [outcome for _, outcome in sorted(self._outcomes.items())]

    def run(self, stage: Stage) -> None:
        waiting = iter(enumerate(self._jobs))
        more = True
        while more or self._at_work:
            stop_if_asked()
            while more and len(self._at_work) < self._executor.capacity:
                place, job = next(waiting, (0, None))
                if more := job is not None:
                    self._begin(place, job, stage)
                    stop_if_asked()
            ended, _ = wait(self._futures, LOOK, FIRST_COMPLETED)
            for future in ended:
                self._end(future, *self._futures.pop(future))
            self._show(stage)

    def take_partly(self, stopped: Stopped) -> None:
        """Count what is complete of inputs that were stopped in this process, or in workers."""
        for place in self._at_work:
            source = self._jobs[place].source
            outcome = stopped.partly or Outcome(source, written=list(map(Path, written_of(source))))
            if outcome.written:
                self._outcomes[place] = outcome

    def unmatched(self) -> set[str]:
        """Return the names and patterns that were asked for, and that nothing has."""
        outcomes = self._outcomes.values()
        seen = any(not outcome.failed for outcome in outcomes)
        return set(self._work.objects or ()).difference(*(outcome.matched for outcome in outcomes)) if seen else set()

    def _show(self, stage: Stage) -> None:
        at_work = [self._jobs[place] for place in self._at_work]
        stage.reach(len(self._outcomes), ", ".join(job.title for job in at_work))
        summary = _summary(self.in_order, len(self._jobs), self._work, interrupted=True)
        report(at=", ".join(job.source for job in at_work), summary=summary)

    def _begin(self, place: int, job: Job, stage: Stage) -> None:
        """Have an input done, unless it is done already or cannot be."""
        if job.problem:
            self._note(f"{job.source}: {job.problem}")
            self._outcomes[place] = Outcome(job.source, failed=True, unreadable=True)
            return
        task = _task(self._work, job)
        key = task.key if task.inputs else ""
        if key and (result := self._work.record_of(job).done(key)):
            written, facts = result
            self._note(f"{job.source}: already {self._work.done}: {', '.join(map(str, written))}")
            self._outcomes[place] = outcome = Outcome(job.source, is_old=True, matched=set(facts.get("matched", ())))
            for path in written:
                outcome.add_written(path)
            return
        step = replace(cast(Keyed, task.step), work=self._work, job=job)
        request = steps.Job(replace(task, step=step), self._scratch / str(place), job.folder)
        self._at_work[place] = key
        self._show(stage)
        stop_if_asked()
        self._futures[self._executor.submit(request)] = place, request

    def _end(self, future: Future[Made], place: int, request: steps.Job) -> None:
        """Take what came of an input."""
        job, key = self._jobs[place], self._at_work.pop(place)
        for line in lines_of(request.place / NOTES):  # Also of one that was killed.
            self._note(str(line.get("note")))
        outcome = Outcome(job.source, failed=True)
        try:
            outcome = future.result()["facts"]["outcome"]
        except steps.TaskError as error:
            self._note(f"{job.source}: {str(error).removeprefix(f'{job.source}: ')}")
        except (CancelledError, Exception) as error:
            self._note(f"{job.source}: {loss(error, request)}: leave it out, or see whether Blender opens it")
        else:
            if key and outcome.is_whole and not self._work.dry_run:
                facts = {"matched": sorted(outcome.matched)}
                self._work.record_of(job).keep(key, outcome.written, outcome.beside, outcome.read, facts)
        self._outcomes[place] = outcome


def _task(work: Work, job: Job) -> steps.Task:
    """Return what has the key of a result: the input, these options, the version of the program and of Blender."""
    blender = ""
    if work.needs_blender(job):
        import bpy

        blender = bpy.app.version_string
    options = replace(work, overwrite=False, dry_run=False, processes=1)
    body = job.source.removeprefix(os.fspath(job.file))
    return steps.Task(Keyed(options, body, job.output.name, blender), job.title, inputs=_inputs(job))


def _keep_note(place: Path, text: str) -> None:
    append_lines(place / NOTES, [{"note": text}])


def _inputs(job: Job) -> dict[str, str]:
    """Return the file of an input as it is now; none where that is no file, or is to be replaced."""
    digest = "" if job.in_place else steps.sha256_in(job.file)
    return {os.fspath(job.file): digest} if digest else {}


def _executor(workers: int | None, count: int) -> Executor:
    """Return the executor of so many inputs. Raises RunError where there cannot be that many processes."""
    if workers == 0 or (workers is None and count == 1):
        return Executor()
    try:
        if blender_program():
            raise ImportError("Blender itself starts no workers")
        return ProcessExecutor(min(workers or processors(), count))
    except ImportError as error:
        if workers is None:
            return Executor()
        raise steps.RunError(f"--jobs {workers}: {error}; leave it out, and inputs are done one by one") from None


def _summary(outcomes: Sequence[Outcome], count: int, work: Work, *, interrupted: bool) -> str:
    """Return what came of it all, in a line."""
    would = "to be " if work.dry_run else ""
    objects, bones, clips = (
        sum(getattr(outcome, what) for outcome in outcomes) for what in ("objects", "bones", "clips")
    )
    refused = sum(outcome.refused for outcome in outcomes)
    written, failed = sum(bool(outcome.written) for outcome in outcomes), sum(outcome.failed for outcome in outcomes)
    old = sum(outcome.is_old for outcome in outcomes)
    idle = sum(not (outcome.written or outcome.failed) for outcome in outcomes)
    parts = [f"{written - old} {would}written"]
    parts += [f"{old} already {work.done}"] if old else []
    parts += [f"{idle} left alone"] if idle else []
    parts += [f"{failed} failed"] if failed else []
    parts += [f"{incomplete} incomplete"] if (incomplete := sum(outcome.incomplete for outcome in outcomes)) else []
    parts += [f"{count - len(outcomes)} not reached"] if interrupted else []
    done = [counted(objects, "object")] if objects or not (bones or clips) else []
    done += [counted(bones, "bone")] if bones else []
    done += [counted(clips, "clip")] if clips else []
    summary = f"{' and '.join(done)} {would}{work.done}" + (f", {refused} not" if refused else "")
    return f"{'Stopped. ' if interrupted else ''}{summary}; {counted(count, 'file')}: {', '.join(parts)}."


def counted(count: int, what: str) -> str:
    """Return how many there are of something, "1 bone" or "24 bones"."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


@contextmanager
def _extension() -> Iterator[None]:
    """Use what the extension keeps in files and follows from this checkout, in place of one that is installed."""
    import addon_utils
    import bpy

    from rigid_motion import animation

    enabled = [addon.module for addon in cast(bpy.types.Preferences, bpy.context.preferences).addons]
    installed = [name for name in enabled if name.rpartition(".")[2] == EXTENSION]
    for name in installed:
        addon_utils.disable(name)
    animation.register()
    try:
        yield
    finally:
        animation.unregister()
        for name in installed:
            addon_utils.enable(name)


class Stopped(KeyboardInterrupt):
    """By Ctrl-C or SIGTERM. `args` are the number of the signal."""

    partly: Outcome | None = None
    """The outcome of the input that it came in."""


_received: list[int] = []
"""Signals that are to stop this process."""


def stop_if_asked() -> None:
    """Raise `Stopped` after Ctrl-C or SIGTERM. Blender swallows what is raised while it works.

    A step that takes too long, or is done in a worker, is ended from outside.
    """
    if _received:
        raise Stopped(_received[0])


@contextmanager
def _stopped_between_steps() -> Iterator[None]:
    """Have the signals that stop a command wait for `stop_if_asked`."""
    _received.clear()
    before = {item: signal.signal(item, lambda number, _: _received.append(number)) for item in stop_signals()}
    try:
        yield
    finally:
        _received.clear()
        for one, handler in before.items():
            # None stands for the Blender program's own, which Python cannot put back.
            signal.signal(one, signal.SIG_DFL if handler is None else handler)
