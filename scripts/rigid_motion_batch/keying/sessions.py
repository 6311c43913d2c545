"""Sessions: process inputs one by one or in parallel, each completely or not at all, and sum up in one line.

An executor of the pipeline processes each input, in this process or in a worker. Results that the same version made of
the same input with the same options are not made again. Ctrl-C ends a session: files written by then are complete, and
no other file was touched. If Blender does not react, `supervising` ends it from outside.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import cast

from rigid_motion_batch.command_line import complain, listed, path_line, printable
from rigid_motion_batch.files import append_lines, lines_of
from rigid_motion_batch.pipeline import steps
from rigid_motion_batch.pipeline.executors import Executor, Made, ProcessExecutor, loss, processors
from rigid_motion_batch.places import EXTENSION
from rigid_motion_batch.progress import Progress, Stage
from rigid_motion_batch.supervising import blender_program, report

from .planning import InputJob
from .records import FileProblem
from .reductions import as_text
from .work import Outcome, RunningJob, Work

MAX_NAMED_FAILURES = 5
"""How many failed inputs the summary names again, if there are more inputs than that."""

ROOMS = (
    "rigid_motion/animation",
    "rigid_motion/gltf",
    "rigid_motion/motion",
    "analysis",
    "keying",
    "recordings",
    "report/data.py",
    "report/reduced.py",
    "scenes/armature.py",
)
"""The packages and modules whose code determines the written files."""


class Keyed(steps.Step, rooms=ROOMS):
    """A pipeline step that processes one input, in whichever process it runs."""

    work: Work
    body: str
    """The body of the input to process."""

    output: str
    """The name of the output file."""

    version: str
    """The version of Blender, if the input needs Blender."""

    job: InputJob | None = None
    """The input. It is not part of the key: the same file in another place counts as done."""

    def make(self, job: steps.StepJob) -> dict[str, Outcome]:
        given = cast(InputJob, self.job)
        blender: AbstractContextManager[None] = nullcontext()
        if self.work.needs_blender(given):
            import bpy  # noqa: F401  It makes addon_utils importable.

            blender = _local_extension()
        doing = RunningJob(self.work, given, lambda text: append_lines(job.place / "notes", [{"note": text}]))
        with blender:
            self.work.do(doing)
        return {"outcome": doing.outcome}


def do_all(
    program: str,
    jobs: Sequence[InputJob],
    work: Work,
    workers: int | None = None,
    *,
    as_json: bool = False,
    page: Callable[[Sequence[Outcome]], Path] | None = None,
) -> int:
    """Process all inputs, print the paths of written files (or JSON), and return the exit code.

    Parameters
    ----------
    program : str
        The name of the command, for messages.
    jobs : sequence of InputJob
    work : Work
    workers : int, optional
        Number of processes; 0 for this one only. If None, one for each processor, or this process for a single input.
    as_json : bool
    page : callable, optional
        Writes a report page and returns its path; not called if the session was stopped. Raises FileProblem.
    """
    stopped, unmatched = False, set()
    report(prints_paths=not as_json)
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
    ):
        session = _Session(jobs, work, executor, progress, Path(scratch))
        try:
            with progress.stage(work.doing, len(jobs)) as stage:
                session.run(stage)
        except KeyboardInterrupt:
            stopped = True
            executor.stop()
        else:
            unmatched = session.unmatched()
            for name in sorted(unmatched):
                progress.note(
                    f"{program}: --objects {name}: no object or bone of that name has anything to be {work.done}"
                )
    outcomes, unwritten = session.in_order, False
    paths = [path for outcome in outcomes for path in outcome.written]
    if page and not stopped:
        try:
            paths.append(page(outcomes))
            if as_json:
                print(f"{program}: the page is {path_line(paths[-1])}", file=sys.stderr)
        except FileProblem as problem:
            unwritten = True
            complain(program, problem)
    report(ended=True)
    if as_json:
        print(json.dumps([outcome.as_data() for outcome in outcomes], indent=1, ensure_ascii=False), flush=True)
    elif not work.dry_run:
        for path in paths:
            print(path_line(path), flush=True)
    print(_summary(outcomes, len(jobs), work, interrupted=stopped), file=sys.stderr, flush=True)
    if stopped:
        return 130
    if all(outcome.unreadable for outcome in outcomes):
        return 2
    return int(
        unwritten
        or bool(unmatched)
        or any(outcome.refused or outcome.failed or outcome.incomplete for outcome in outcomes)
    )


class _Session:
    """The state of a session: its inputs, those at work, and the outcomes so far."""

    def __init__(
        self, jobs: Sequence[InputJob], work: Work, executor: Executor, progress: Progress, scratch: Path
    ) -> None:
        self._jobs, self._work, self._executor, self._note = jobs, work, executor, progress.note
        self._scratch = scratch
        self._outcomes: dict[int, Outcome] = {}
        """Outcomes by the index of the input."""
        self._at_work: dict[int, str] = {}
        """The key of the result, by the index of each input at work."""
        self._futures: dict[Future[Made], tuple[int, steps.StepJob]] = {}

    @property
    def in_order(self) -> list[Outcome]:
        return [outcome for _, outcome in sorted(self._outcomes.items())]

    def run(self, stage: Stage) -> None:
        for place, job in enumerate(self._jobs):
            while len(self._at_work) >= self._executor.capacity:
                self._wait(stage)
            self._start_job(place, job, stage)
        while self._at_work:
            self._wait(stage)
        self._show_progress(stage)

    def _wait(self, stage: Stage) -> None:
        ended, _ = wait(self._futures, steps.LOOK_INTERVAL_S, FIRST_COMPLETED)
        for future in ended:
            self._finish_job(future, *self._futures.pop(future))
        self._show_progress(stage)

    def unmatched(self) -> set[str]:
        """Return the requested names and patterns that matched no object or bone."""
        outcomes = self._outcomes.values()
        seen = any(not outcome.failed for outcome in outcomes)
        return set(self._work.objects or ()).difference(*(outcome.matched for outcome in outcomes)) if seen else set()

    def _show_progress(self, stage: Stage) -> None:
        at_work = [self._jobs[place] for place in self._at_work]
        stage.reach(len(self._outcomes), ", ".join(job.title for job in at_work))
        summary = _summary(self.in_order, len(self._jobs), self._work, interrupted=True)
        report(at=", ".join(job.source for job in at_work), summary=summary)

    def _start_job(self, place: int, job: InputJob, stage: Stage) -> None:
        """Start an input, unless it is done already or cannot be processed."""
        if job.problem:
            self._note(f"{job.source}: {job.problem}")
            self._outcomes[place] = Outcome(job.source, failed=True, unreadable=True, reason=job.problem)
            return
        task = _task_of(self._work, job)
        key = task.key if task.inputs else ""
        if key and (result := self._work.record_of(job).done(key)):
            written, facts = result
            self._note(f"{job.source}: already {self._work.done}: {', '.join(map(str, written))}")
            old, matched = facts.get("numbers", {}), set(facts.get("matched", ()))
            self._outcomes[place] = outcome = Outcome(job.source, old=old, matched=matched)
            for path in written:
                outcome.add_written(path)
            return
        step = replace(cast(Keyed, task.step), work=self._work, job=job)
        request = steps.StepJob(replace(task, step=step), self._scratch / str(place), job.folder)
        self._at_work[place] = key
        self._show_progress(stage)
        self._futures[self._executor.submit(request)] = place, request

    def _finish_job(self, future: Future[Made], place: int, request: steps.StepJob) -> None:
        """Collect the outcome of an input that has ended."""
        job, key = self._jobs[place], self._at_work.pop(place)
        for line in lines_of(request.place / "notes"):  # Also the notes of a worker that was killed.
            self._note(str(line.get("note")))
        outcome = Outcome(job.source, failed=True)
        try:
            outcome = future.result()["facts"]["outcome"]
        except steps.TaskError as error:
            outcome.reason = str(error).removeprefix(f"{job.source}: ")
            self._note(f"{job.source}: {outcome.reason}")
        except (CancelledError, Exception) as error:
            outcome.reason = f"{loss(error, request)}: leave it out, or see whether Blender opens it"
            self._note(f"{job.source}: {outcome.reason}")
        else:
            if key and outcome.is_complete and not self._work.dry_run:
                facts = {"matched": sorted(outcome.matched), "numbers": asdict(outcome.numbers)}
                self._work.record_of(job).keep(key, outcome.written, outcome.beside, outcome.read, facts)
        self._outcomes[place] = outcome


def _task_of(work: Work, job: InputJob) -> steps.Task:
    """Return the task whose key identifies a result: input, options, version of the program and of Blender."""
    blender = ""
    if work.needs_blender(job):
        import bpy

        blender = bpy.app.version_string
    options = replace(work, overwrite=False, dry_run=False, processes=1)
    body = job.source.removeprefix(os.fspath(job.file))
    # An input that will be replaced, or is not a file, has no digest.
    digest = "" if job.in_place else steps.sha256_in(job.file)
    inputs = {os.fspath(job.file): digest} if digest else {}
    return steps.Task(Keyed(options, body, job.output.name, blender), job.title, inputs=inputs)


def _executor(workers: int | None, count: int) -> Executor:
    """Return the executor for `count` inputs. Raises RunError if there cannot be that many processes."""
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
    """Return a sentence that sums up all outcomes."""
    done = [outcome for outcome in outcomes if outcome.done]
    kinds = {kind: sum(getattr(outcome, f"{kind}s") for outcome in done) for kind in ("object", "bone", "clip")}
    what = " and ".join(counted(number, kind) for kind, number in kinds.items() if number)
    files = f" of {counted(len(done), 'file')}" if done and count > 1 else ""
    refused = sum(outcome.refused for outcome in outcomes)
    summary = f"{what or 'Nothing'}{files} {'to be ' * work.dry_run}{work.done}{f', {refused} not' * bool(refused)}"
    failed = [outcome.source for outcome in outcomes if outcome.failed]
    others = {
        f"already {work.done}": sum(outcome.old is not None for outcome in outcomes),
        "written as exported": sum(
            bool(outcome.written) and not outcome.done and outcome.old is None for outcome in outcomes
        ),
        "left alone": sum(outcome.state == "left alone" for outcome in outcomes),
        "failed" + f" ({printable(listed(failed, MAX_NAMED_FAILURES))})" * (count > MAX_NAMED_FAILURES): len(failed),
        "incomplete": sum(outcome.incomplete for outcome in outcomes),
        "not reached": interrupted * (count - len(outcomes)),
    }
    some = [(number, state) for state, number in others.items() if number]
    rest = [f"{number if place else counted(number, 'file')} {state}" for place, (number, state) in enumerate(some)]
    summary += _bytes_of(done) + _largest_error(done, count) + ("; " * bool(rest)) + ", ".join(rest)
    return f"{'Stopped. ' * interrupted}{summary}."


def _bytes_of(outcomes: Sequence[Outcome]) -> str:
    """Return the total bytes before and after; nothing unless all of them are known."""
    sizes = [(outcome.numbers.bytes_before, outcome.numbers.bytes_after) for outcome in outcomes]
    if not sizes or any(None in pair for pair in sizes):
        return ""
    before, after = (f"{sum(map(int, side)):,}".replace(",", " ") for side in zip(*sizes, strict=True))
    return f", {before} to {after} bytes"


def _largest_error(outcomes: Sequence[Outcome], count: int) -> str:
    """Return the largest error of all clips, and where it is; nothing if none was measured."""
    clips = [(clip, outcome) for outcome in outcomes for clip in outcome.numbers.clips if not clip.reason]
    if not clips:
        return ""
    clip, outcome = max(clips, key=lambda pair: pair[0].error)
    file = Path(outcome.source)
    place = ", ".join(filter(None, (file.name * (count > 1), clip.name * (clip.name != file.stem), clip.where)))
    place = f" ({printable(place)})" if place else ""
    return f"; at most {as_text(clip.error)} off{place}"


def counted(count: int, what: str) -> str:
    """Return a count with its noun, "1 bone" or "24 bones"."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


@contextmanager
def _local_extension() -> Iterator[None]:
    """Register the extension's data and handlers from this checkout, in place of an installed one."""
    import addon_utils
    import bpy

    from rigid_motion import animation

    enabled = [addon.module for addon in cast(bpy.types.Preferences, bpy.context.preferences).addons]
    installed = [name for name in enabled if name.rpartition(".")[2] == EXTENSION.name]
    for name in installed:
        addon_utils.disable(name)
    animation.register()
    try:
        yield
    finally:
        animation.unregister()
        for name in installed:
            addon_utils.enable(name)
