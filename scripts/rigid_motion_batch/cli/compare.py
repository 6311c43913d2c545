"""The command `compare`: compare interpolation modes on recorded trajectories, and print the outcome.

The options are in `compare_options`, the tasks in `pipeline.comparison`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import webbrowser
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any

from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.cli.compare_options import ALL, SCRIPT, parse
from rigid_motion_batch.cli.comparison_folders import free_folder, note_recordings, require_same_comparison
from rigid_motion_batch.command_line import as_typed, complain, path_line, program_of
from rigid_motion_batch.pipeline import comparison_steps as steps
from rigid_motion_batch.pipeline.comparison import IN_BLENDER, TABLES, ComparisonPlan
from rigid_motion_batch.pipeline.executors import Executor, ProcessExecutor, processors
from rigid_motion_batch.pipeline.running import FAILED, STATES, Plan, Run, share_of, tasks_left
from rigid_motion_batch.pipeline.steps import VERSION_VARIABLE, RunError, version_here
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.pipeline.studies import Comparison
from rigid_motion_batch.places import install_command, manifest
from rigid_motion_batch.progress import FARM_VARIABLE, Progress
from rigid_motion_batch.report.held import slip_sentences, still_sentences
from rigid_motion_batch.report.numbers import error_is
from rigid_motion_batch.report.settings import PageSettings
from rigid_motion_batch.scenes.settings import MODELS, SubjectError
from rigid_motion_batch.supervising import blender_program, report
from rigid_motion_batch.system_libraries import missing_for_rendering, way_out, without_blender

from . import terminal

PROGRAM = program_of(SCRIPT)

TEXT_OPTIONS = ("--json", "--open", "--quiet")
"""Options that affect only the printed output: a report leaves them out of its command."""

DRAWING_STAGES = steps.STAGES[steps.STAGES.index("build") :]
"""Stages after all measurements."""

BLENDER_START_S = 120.0
"""Seconds that a Blender has to print its version."""


def main(arguments: list[str]) -> int:
    """Run a comparison, and return the exit code."""
    options = parse(arguments)
    try:
        if (requested := os.environ.get(VERSION_VARIABLE)) and requested != (result := version_here()):
            raise RunError(f"this machine has {result}, and the bundle is of {requested}")
        if not find_spec("vl_convert"):
            raise RunError(f"this needs the module vl_convert, which {install_command('compare', 'compare')} brings")
        blender = _blender(options)
        said = [argument for argument in arguments if argument not in TEXT_OPTIONS]
        comparison = comparison_of(options, as_typed(PROGRAM, said, options.inputs), blender)
        output = options.output or free_folder(options.inputs)
        if not options.overwrite:
            require_same_comparison(output, options.inputs)
        with Store(output, alone=not options.only, overwrite=options.overwrite) as store:
            plan = ComparisonPlan(comparison, store)
            with (
                Progress(quiet=options.quiet, program=PROGRAM) as progress,
                _executor(options.jobs) as executor,
            ):
                return _Comparing(options, plan, executor, progress).run()
    except (SubjectError, RunError) as error:
        print(*(f"{PROGRAM}: {error}".splitlines()), sep="\n", file=sys.stderr)
    except OSError as error:
        complain(PROGRAM, error, options.output or "")
    return 2


def comparison_of(options: argparse.Namespace, command: str, blender: str) -> Comparison:
    """Return the comparison that these options of a command request, with a Blender of this version."""
    stage, details = options.stage, {"Blender": blender} if blender else {}
    if stage:
        speed = "real time" if stage.slow_motion == 1 else f"{stage.slow_motion:g} times slower"
        details["Videos"] = f"{stage.engine}, {stage.resolution[0]} x {stage.resolution[1]}, {stage.fps} frames/s"
        details["Speed of the videos"] = speed
    return Comparison(
        sources=tuple(options.inputs),
        choices=tuple(options.choices),
        modes=options.modes,
        against=options.against or "",
        held=tuple(map(tuple, options.held)),
        reference=options.reference,
        axes=options.axes,
        reading=options.reading,
        radii=options.radius,
        shared=options.shared,
        count_keys=bool(options.tolerance or options.budget),
        fit=options.fit,
        stage=stage,
        every_film=options.films == ALL,
        about=PageSettings(
            options.radius.rigid,
            f"{manifest()['name']} {manifest()['version']}",
            command,
            reference=options.reference,
            joint_radius=options.radius.joint,
            details=details,
        ),
        subject=options.subject,
        blender=blender,
    )


# -- requirements -----------------------------------------------------------------------------------------------------


def _blender(options: argparse.Namespace) -> str:
    """Return the version of the Blender that films and reads; empty if none is needed and there is none.

    Raises
    ------
    RunError, SubjectError
        If a Blender is needed and missing. The message says what to do.
    """
    read = next((item for item in [*options.inputs, options.against or ""] if _suffix(item) in IN_BLENDER), None)
    if not (options.blender or blender_program() or find_spec("bpy")):
        if options.stage or read:
            raise RunError(without_blender(f"{read} is read by" if read else "Videos are made by", films=not read))
        return ""
    # Another Blender program has libraries of its own.
    on_screen = options.stage and options.engine != "cycles" and not options.blender
    if on_screen and (missing := missing_for_rendering()):
        raise RunError(f"{way_out(missing)}\nOr go without videos: --no-video")
    if options.blender:
        return version_of(options.blender)
    if options.stage and options.subject not in MODELS:
        # Blender is loaded only here: loading takes longer than all other work before the tasks begin.
        from rigid_motion_batch.scenes.subject import load_subject

        load_subject(options.subject)
    try:
        return version("bpy")
    except PackageNotFoundError:
        import bpy

        return ".".join(map(str, bpy.app.version))


def version_of(blender: str) -> str:
    """Return the version of a Blender program, "5.2.3". Raises RunError if it cannot be run or is no Blender."""
    reason = "this does not say that it is Blender"
    try:
        ended = subprocess.run([blender, "--version"], capture_output=True, timeout=BLENDER_START_S, check=False)
        if said := re.search(rb"^Blender (\d+\.\d+\.\d+)", ended.stdout, re.MULTILINE):
            return said[1].decode()
    except (OSError, ValueError, subprocess.TimeoutExpired) as error:
        reason = getattr(error, "strerror", None) or str(error)
    raise RunError(f"{blender}: {reason}; give the path of a Blender program")


def _suffix(source: str) -> str:
    """Return the suffix of the file of a source: ".fbx" for walk.fbx:Hand."""
    lower = source.lower()
    return next((end for end in IN_BLENDER if lower.endswith(end) or f"{end}:" in lower), "")


def _executor(jobs: int | None) -> Executor:
    """Return the executor of the tasks with this number of processes: 0 is this process, None one per processor."""
    return Executor() if jobs == 0 else ProcessExecutor(jobs or processors())


# -- running ----------------------------------------------------------------------------------------------------------


class _Comparing:
    """A comparison in its opened folder."""

    def __init__(
        self, options: argparse.Namespace, plan: ComparisonPlan, executor: Executor, progress: Progress
    ) -> None:
        self.options, self.plan, self.store = options, plan, plan.store
        self.progress, self.notes = progress, list[str]()
        self.work = Run(plan.store, executor, progress, options.blender or "")
        self.page = False
        """Whether this run has a page."""

    def run(self) -> int:
        """Read the recordings, plan the tasks, do them, and print the outcome; return the exit code."""
        report(summary="Stopped. There is no new report yet; the same command continues from here.")
        if not self.options.only or self.options.only == "read":
            self._do_tasks("Reading", self.plan.reading)
            if self.work.interrupted or self.work.problem or self.options.only:
                return self._end()
        notes = self.plan.inspect_clips()
        warnings = [
            "; ".join(filter(None, (f"{study.name}: {warning.text}", warning.way_out)))
            for study in self.plan.studies
            for warning in study.facts.warnings
        ]
        for note in dict.fromkeys([*notes, *warnings]):
            self._note(note, "yellow" if note in warnings else "")
        if not self.plan.studies:
            self._say_nothing_to_compare()
            return 2
        if self.options.only:
            if self.options.only in DRAWING_STAGES:
                self.plan.conclude()
            self._do_tasks(self.options.only.capitalize(), self.plan.tasks)
            if self.options.only == "report":
                self._report_missing()
            return self._end()
        self._require_tolerances()
        note_recordings(self.store, self.options.inputs)
        # Tables of an earlier run are no results of this one.
        self.store.withdraw(TABLES.keys() - self.plan.tables)
        self._do_tasks("Measuring", self.plan.measuring)
        if self.work.interrupted or self.work.problem:
            return self._end()
        self.plan.conclude()
        self._show_numbers()
        films = (task.name for task in self.plan.tasks() if isinstance(task.step, steps.Encode))
        if not tasks_left(self.plan.tasks, self.store)[0].keys().isdisjoint(films):
            # Pages take seconds and films minutes: show the pages first.
            self._do_tasks("Reporting", lambda: self.plan.tasks(films=False))
            if self.work.interrupted or self.work.problem:
                return self._end()
            report(summary="Stopped. The report holds what was ready; the same command continues from here.")
            report(written=os.fspath(self.store.output / steps.PAGE))
            self._note(f"All numbers are there, and films come as they are made: {self.store.output / steps.PAGE}")
            self._do_tasks("Filming", self.plan.tasks)
        else:
            self._do_tasks("Reporting", self.plan.tasks)
        return self._end()

    def _do_tasks(self, title: str, tasks: Plan) -> None:
        self.work.do(lambda: share_of(tasks, self.options.only or "", *self.options.part), title)
        self.page |= tasks != self.plan.measuring and bool(self.plan.studies) and not self.work.interrupted

    def _note(self, text: str, style: str = "") -> None:
        self.notes.append(text)
        if not self.options.quiet:
            self.progress.note(text, style)

    def _say_nothing_to_compare(self) -> None:
        if not any(self.store.index_of(task.key) for task in self.plan.reading()):
            if self.options.only or not self.work.failures:
                complain(PROGRAM, "none of the recordings has been read; --only read does that")
        elif not self.work.failures:
            higher = "--budget" if self.options.budget else "--rates"
            complain(PROGRAM, f"every clip is too short for two keys at these rates; give higher {higher}")

    def _report_missing(self) -> None:
        """Report the tasks that the stages before the report have not done."""
        tasks = (task for task in chain(self.plan.reading(), self.plan.tasks()) if task.step.stage != "report")
        for task in tasks:
            if not self.store.index_of(task.key):
                self.work.failures[task.name] = "not done: see the message of its stage"
                complain(PROGRAM, f"{task.name}: {self.work.failures[task.name]}")

    def _require_tolerances(self) -> None:
        """Raise RunError if a tolerance is larger than the motion of every clip."""
        radius = self.plan.comparison.radii.rigid
        for choice in self.plan.comparison.choices:
            clips = map(self.plan.read, self.plan.studies)
            problem = ""
            if isinstance(choice, Tolerance) and all(problem := choice.problem_with(clip, radius) for clip in clips):
                raise RunError(problem)

    # -- output -------------------------------------------------------------------------------------------------------

    def _show_numbers(self) -> None:
        if self.options.quiet or self.options.json:
            return
        found = self.plan.found
        if found.numbers and found.verdict:
            bodies, radii = [bool(study.facts.joints) for study in self.plan.studies], self.options.radius
            rigid, joint = None if all(bodies) else radii.rigid, radii.joint if any(bodies) else None
            choice = found.verdict.choice
            terminal.show(
                error_is(rigid, joint, len(found.numbers.clips)),
                terminal.table_of(terminal.lines_of(found.numbers)),
                *terminal.notes_below(found.numbers),
                *slip_sentences(found.slips, found.numbers, choice),
                *still_sentences(found.numbers, choice),
                "",
                found.verdict.text,
            )

    def _end(self) -> int:
        """Print the outcome, and the path of the report last; return the exit code."""
        outcome, page = self.work, self.store.output / steps.PAGE
        there = self.page and page.exists() and not self.options.only
        report(ended=True)
        if outcome.problem:
            complain(PROGRAM, f"{outcome.problem}; no finished work is lost: fix that, and run this again")
        if outcome.failures and not self.options.quiet:
            print(f"{PROGRAM}: {len(outcome.failures)} failed, as said above", file=sys.stderr)
        if outcome.interrupted:
            holds = "The report holds what was ready" if there else "There is no new report yet"
            print(f"Stopped. {holds}; the same command continues from here.", file=sys.stderr)
        # After a failure, a farm would not begin the next stages: the report stage reports what is missing.
        failed = outcome.failures and not (os.environ.get(FARM_VARIABLE) == "openjd" and self.options.only != "report")
        code = 130 if outcome.interrupted else 2 if outcome.problem else int(bool(failed))
        if self.options.json:
            print(json.dumps(self._as_data(page if there else None, code), indent=1, ensure_ascii=False), flush=True)
        elif there:
            print(path_line(page), flush=True)
        if there and self.options.open:
            webbrowser.open(page.absolute().as_uri())
        return code

    def _as_data(self, page: Path | None, code: int) -> dict[str, Any]:
        found = self.plan.found
        counts = {**self.work.counts, FAILED: len(self.work.failures)}
        return {
            "report": os.fspath(page) if page else None,
            "exit_code": code,
            "verdict": found.verdict.sentence if found.verdict else None,
            "wins": found.verdict.wins if found.verdict else "",
            "table": [asdict(line) for line in terminal.lines_of(found.numbers)] if found.numbers else [],
            "slips": [asdict(row) for pair in found.slips for some in pair.choices for row in some.rows],
            "clips": list(found.numbers.clips) if found.numbers else [],
            "notes": self.notes,
            "failures": self.work.failures,
            "tasks": {state: counts[state] for state in STATES if counts.get(state)},
        }
