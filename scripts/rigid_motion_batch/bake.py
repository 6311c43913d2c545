"""Bake rigid in-betweens into real keys, or take that back, in .blend files and without a window.

In each file, every object and every pose bone with rigid-motion modes gets keys that any program can play. Its own keys
stay in the file, so that it can be un-baked. The result is a new file beside the old one, which stays as it is.
"""

from __future__ import annotations

import argparse
import math
import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from rigid_motion_batch.command_line import as_called, program_of
from rigid_motion_batch.system_libraries import require_blender

SCRIPT = "bake.py"
PROGRAM = program_of(SCRIPT)

require_blender(SCRIPT)

import addon_utils
import bpy

from rigid_motion import animation
from rigid_motion.animation.transforms import BoneTransform, Transform
from rigid_motion_batch.bake_targets import (
    Result,
    baking,
    described,
    groups_of,
    matching,
    matching_missing,
    title_of,
    unbaking,
)
from rigid_motion_batch.blend_files import (
    HERE,
    FileProblem,
    Missing,
    Unreadable,
    missing_data,
    named,
    only_overridden,
    open_file,
    refuse_read_only,
    refuse_to_replace,
    write_file,
)
from rigid_motion_batch.command_line import number
from rigid_motion_batch.progress import Progress

STOPPING = (signal.SIGINT, signal.SIGTERM)
"""What Ctrl-C sends, and what a farm does that takes a job back."""

EXTENSION = "rigid_motion"
"""The id in blender_manifest.toml, which the name of the installed module ends with."""

SMALLEST_STEP = 0.01
"""Keys closer than that are one key to Blender."""

EPILOG = """
examples:
  python scripts/bake.py shot.blend
  python scripts/bake.py shots/*.blend --output farm
  python scripts/bake.py shot.blend --objects 'Camera,Tool*' --step 0.25
  python scripts/bake.py shot.blend --objects 'Rig/Hand*,Rig/Foot*'
  python scripts/bake.py shot.blend --dry-run
  python scripts/bake.py farm/shot-baked.blend --unbake
  blender --background --python scripts/bake.py -- shot.blend

what is written:
  NAME-baked.blend or NAME-unbaked.blend, beside the file or in --output. The program opens the new file again to check
  it, and then moves it into place. It replaces an existing file only with --overwrite, and never one that is
  read-only. With --in-place it replaces the file itself in the same way, and keeps the one before as NAME.blend1. A
  file in which there is nothing to do is not written. At the end the paths that were written are printed on standard
  output, one a line; everything else goes to standard error.
  Textures and libraries are found from the new place, too. A relative output path of the render, and disk caches of
  simulations (blendcache_NAME), depend on the place and the name of the file, as after Save As.

what is run:
  Nothing in the files: scripts and Python expressions stay in them, switched off. If a farm should run them, let it
  render with `blender --enable-autoexec`. Baking reads keys, and needs no scripts.

missing libraries:
  Each is named, with what is missing from it. An object counts as not done if it is missing, if it overrides a missing
  one or moves by a missing Action. So does a file that lacks a collection or a scene, which may hold such objects,
  unless --objects says which ones you mean. The other objects are baked and written, and the file keeps its links.
  Missing meshes, materials, textures and the like do not matter for baking, and do not change the exit code.

exit code:
  0    all done, or nothing to do, so that a second command may follow:
       python scripts/bake.py shot.blend --output farm && blender --background farm/shot-baked.blend --render-anim
  1    some objects, bones or files could not be done, and are named with the reason: a driven channel, an infinite
       key, a missing library, one damaged file of many, a full disk, an --objects NAME that nothing has. The others
       are done.
  2    a wrong option, or none of the files could be read: nothing was done
  130  stopped by Ctrl-C, and 143 by SIGTERM: the files written by then are complete, nothing else was changed
"""


@dataclass(frozen=True)
class Job:
    """A file to be done."""

    source: Path
    output: Path
    """The same where it is done in place."""


@dataclass
class Outcome:
    """What became of a file."""

    objects: int = 0
    bones: int = 0
    """How many of them were done."""

    refused: int = 0
    """How many objects and bones were not."""

    failed: bool = False
    unreadable: bool = False
    incomplete: bool = False
    """Whether there may be objects in it that nobody can look at, for a library is missing."""

    written: Path | None = None
    """Where to, or where it would have been."""

    matched: set[str] = field(default_factory=set)
    """Of the names and patterns that were asked for, those that there was an object or a bone for."""

    @property
    def done(self) -> int:
        return self.objects + self.bones


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; a wrong one ends the program with code 2 and a line that says what is wrong."""
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description=__doc__,
        epilog=as_called(EPILOG, SCRIPT),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE.blend", help="files to bake")
    parser.add_argument("--unbake", action="store_true", help="give baked objects and bones their own keys back")
    parser.add_argument(
        "--objects",
        type=_names,
        metavar="NAME,...",
        help="only these objects, and of rigs all of their bones; Rig/Hand is one bone; * and ? stand for any letters, "
        "as in 'Tool*' and 'Rig/*' (all with modes)",
    )
    parser.add_argument("--dry-run", action="store_true", help="do everything but write, and say what would be written")
    keys = parser.add_argument_group("keys")
    keys.add_argument(
        "--step", type=_step, metavar="N", help="frames from key to key; 0.25 for keys between the frames (1)"
    )
    keys.add_argument(
        "--first", type=_frame, metavar="FRAME", help="bake from here on, widened to whole segments (first key)"
    )
    keys.add_argument("--last", type=_frame, metavar="FRAME", help="bake up to here (last key)")
    places = parser.add_argument_group("files")
    places.add_argument("--output", type=Path, metavar="FOLDER", help="where to write (beside each file)")
    places.add_argument("--overwrite", action="store_true", help="replace files of an earlier run")
    places.add_argument("--in-place", action="store_true", help="save the files themselves")
    options = parser.parse_args(arguments)
    if options.unbake:
        for option in ("step", "first", "last"):
            if getattr(options, option) is not None:
                parser.error(f"--{option} is for baking, and says nothing to --unbake: leave it out")
    if None not in (options.first, options.last) and options.first > options.last:
        parser.error(f"--last {options.last:g} is before --first {options.first:g}")
    if options.in_place and options.output:
        parser.error("--in-place saves the files themselves, --output writes others: give one of them")
    if options.output and options.output.exists() and not options.output.is_dir():
        parser.error(f"--output {options.output} is a file: give a folder")
    options.action = unbaking() if options.unbake else baking(options.step or 1.0, options.first, options.last)
    try:
        options.jobs = jobs_of(options.files, options.action.suffix, options.output, in_place=options.in_place)
    except ValueError as error:
        parser.error(str(error))
    return options


def jobs_of(files: Sequence[Path], suffix: str, folder: Path | None, *, in_place: bool) -> list[Job]:
    """What to read and where to write it; a file that is named twice is one.

    Raises
    ------
    ValueError
        Where two files would be written to one place, or one over another that is to be read.
    """
    sources: dict[str, Path] = {}
    for path in files:
        sources.setdefault(_place(path), path)
    jobs, places = [], {}
    for path in sources.values():
        output = path if in_place else (folder or path.parent) / f"{path.stem}{suffix}.blend"
        place = _place(output)
        if place in places:
            raise ValueError(
                f"{places[place]} and {path} would both be written to {output}: do them one after the other, with "
                "another --output"
            )
        if not in_place and place in sources:
            raise ValueError(f"{path} would be written over {output}, which is to be read too: leave one of them out")
        places[place] = path
        jobs.append(Job(path, output))
    return jobs


def _place(path: Path) -> str:
    """Where a path leads to; the same for all paths that lead there."""
    return os.path.normcase(os.path.realpath(path))  # Path.resolve of Python 3.11 fails where links go in circles.


def main(arguments: list[str]) -> int:
    """Do all files, and return the exit code."""
    options = parse(arguments)
    outcomes: list[Outcome] = []
    stopped = None
    with Progress() as progress, _extension(), _stopped_between_steps() as stop_if_asked:
        run = _Run(options, progress.note, stop_if_asked)
        try:
            with progress.stage("Un-baking" if options.unbake else "Baking", len(options.jobs)) as stage:
                for job in options.jobs:
                    stage.say(job.source.name)
                    outcomes.append(run.do(job))
                    stage.advance()
        except _Stopped as signalled:
            stopped = signalled.args[0]
        else:
            seen = [one for one in outcomes if not one.failed]
            unmatched = set(options.objects or ()).difference(*(one.matched for one in outcomes)) if seen else set()
            for name in sorted(unmatched):
                progress.note(
                    f"{PROGRAM}: --objects {name}: no object or bone of that name has anything to be {run.action.done}"
                )
    if not options.dry_run:
        for one in outcomes:
            if one.written is not None:
                print(one.written, flush=True)
    print(_summary(outcomes, len(options.jobs), options, interrupted=stopped is not None), file=sys.stderr, flush=True)
    if stopped is not None:
        return 128 + stopped
    if all(one.unreadable for one in outcomes):
        return 2
    return int(bool(unmatched) or any(one.refused or one.failed or one.incomplete for one in outcomes))


def _summary(outcomes: Sequence[Outcome], count: int, options: argparse.Namespace, *, interrupted: bool) -> str:
    """What came of it all, in a line."""
    action, would = options.action, "to be " if options.dry_run else ""
    objects, bones = sum(one.objects for one in outcomes), sum(one.bones for one in outcomes)
    refused = sum(one.refused for one in outcomes)
    written, failed = sum(one.written is not None for one in outcomes), sum(one.failed for one in outcomes)
    idle = len(outcomes) - written - failed
    parts = [f"{written} {would}written"]
    parts += [f"{idle} left alone"] if idle else []
    parts += [f"{failed} failed"] if failed else []
    parts += [f"{incomplete} incomplete"] if (incomplete := sum(one.incomplete for one in outcomes)) else []
    parts += [f"{count - len(outcomes)} not reached"] if interrupted else []
    done = [_counted(objects, "object")] if objects or not bones else []
    done += [_counted(bones, "bone")] if bones else []
    told = f"{' and '.join(done)} {would}{action.done}" + (f", {refused} not" if refused else "")
    return f"{'Stopped. ' if interrupted else ''}{told}; {_counted(count, 'file')}: {', '.join(parts)}."


def _counted(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


class _Run:
    """Doing files, one after the other."""

    def __init__(
        self, options: argparse.Namespace, note: Callable[[str], None], stop_if_asked: Callable[[], None]
    ) -> None:
        self.options, self.action = options, options.action
        self._note, self._stop_if_asked = note, stop_if_asked
        self._would = "would be " if options.dry_run else ""

    def do(self, job: Job) -> Outcome:
        """Open a file, do what is in it, and write it."""
        outcome = Outcome()
        try:
            if job.output != job.source:
                refuse_to_replace(job.output, overwrite=self.options.overwrite)
            open_file(job.source)
            self._stop_if_asked()
            missing = missing_data()
            for library in missing.libraries:
                self._note(f"{job.source}: {library}")
            if missing.hides_objects and self.options.objects is None:
                outcome.incomplete = True
                self._note(
                    f"{job.source}: incomplete, for there may be objects to be {self.action.done} in what is missing"
                )
            self._do_objects(job, outcome, missing)
            self._finish(job, outcome)
        except FileProblem as problem:
            outcome = Outcome(failed=True, unreadable=isinstance(problem, Unreadable), matched=outcome.matched)
            self._note(f"{job.source}: {problem}")
        except Exception as error:
            # What nobody foresaw in one file must not keep the others from being done.
            outcome = Outcome(failed=True, matched=outcome.matched)
            self._note(f"{job.source}: not written, for this program failed ({type(error).__name__}: {error}):")
            traceback.print_exc()
        return outcome

    def _do_objects(self, job: Job, outcome: Outcome, missing: Missing) -> None:
        overridden = only_overridden()
        for obj in [obj for obj in bpy.data.objects if obj not in overridden]:
            if obj in missing.reasons:
                fitting = {"*"} if self._asked is None else matching_missing(obj, self._asked)
                if fitting:
                    self._begin(job, outcome, fitting)
                    self._refuse(job, outcome, obj.name, missing.reasons[obj])
                continue
            for targets in groups_of(obj):
                fitting = {
                    target: {"*"} if self._asked is None else matching(target, self._asked) for target in targets
                }
                concerned = self.action.concerned([target for target, names in fitting.items() if names])
                if concerned:
                    self._begin(job, outcome, set().union(*(fitting[target] for target in concerned)))
                    self._do_targets(job, outcome, concerned)
                    self._stop_if_asked()

    @property
    def _asked(self) -> list[str] | None:
        return self.options.objects

    def _begin(self, job: Job, outcome: Outcome, fitting: set[str]) -> None:
        """Note which names and patterns there is something to do for."""
        if not outcome.matched:  # Only a file in which there is something to do is written.
            refuse_read_only(job.output)
        outcome.matched |= fitting

    def _do_targets(self, job: Job, outcome: Outcome, targets: Sequence[Transform]) -> None:
        """Do an object, or bones of a rig."""
        library = targets[0].animated.library
        if library is not None:
            reason = f"it is linked from {library.filepath}: use --in-place on that file, or make it local"
            self._refuse(job, outcome, title_of(targets), reason, len(targets))
            return
        result = self.action.act(targets)
        for target, reason in result.refused.items():
            self._refuse(job, outcome, target.name, reason)
        if result.done:
            self._tell_done(job, outcome, result)

    def _refuse(self, job: Job, outcome: Outcome, name: str, reason: str, count: int = 1) -> None:
        outcome.refused += count
        self._note(f"{job.source}: {name}: not {self.action.done}: {reason}")

    def _tell_done(self, job: Job, outcome: Outcome, result: Result) -> None:
        targets = list(result.done)
        if isinstance(targets[0], BoneTransform):
            outcome.bones += len(targets)
        else:
            outcome.objects += len(targets)
        span = f", {result.span}" if result.span else ""
        told = f"{self._would}{self.action.done}{span}{described(result.done)}"
        self._note(f"{job.source}: {title_of(targets)}{' ' if len(targets) > 1 else ': '}{told}")

    def _finish(self, job: Job, outcome: Outcome) -> None:
        if not outcome.done:
            why = "nothing could be" if outcome.refused else "nothing to be"
            self._note(f"{job.source}: {why} {self.action.done}; left alone")
            return
        if (before := bpy.data.version[:2]) < HERE:
            self._note(
                f"{job.source}: was saved by Blender {named(before)}; what is written is of Blender {named(HERE)}"
            )
        if not self.options.dry_run:
            write_file(job.source, job.output, self._stop_if_asked)
        self._note(f"{job.source}: {self._would}written to {job.output}")
        outcome.written = job.output


@contextmanager
def _extension() -> Iterator[None]:
    """What the extension keeps in files and follows, from this checkout, in place of one that is installed."""
    enabled = [addon.module for addon in bpy.context.preferences.addons]
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


class _Stopped(KeyboardInterrupt):
    """By Ctrl-C or SIGTERM. `args` are the number of the signal."""


@contextmanager
def _stopped_between_steps() -> Iterator[Callable[[], None]]:
    """A function that raises _Stopped after Ctrl-C or SIGTERM. Blender swallows what is raised while it works."""
    received: list[int] = []
    before = {one: signal.signal(one, lambda number, _: received.append(number)) for one in STOPPING}

    def stop_if_asked() -> None:
        if received:
            raise _Stopped(received[0])

    try:
        yield stop_if_asked
    finally:
        for one, handler in before.items():
            # None stands for the Blender program's own, which Python cannot put back.
            signal.signal(one, signal.SIG_DFL if handler is None else handler)


def _names(text: str) -> list[str]:
    names = [name.strip() for name in text.split(",") if name.strip()]
    if not names:
        raise argparse.ArgumentTypeError("name an object, or several as in Camera,'Tool*','Rig/*'")
    return names


def _frame(text: str) -> float:
    frame = number(text)
    if not math.isfinite(frame):
        raise argparse.ArgumentTypeError(f"{text!r} is not a frame")
    return frame


def _step(text: str) -> float:
    step = number(text)
    if not SMALLEST_STEP <= step < math.inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a number of frames, {SMALLEST_STEP} or more")
    return step
