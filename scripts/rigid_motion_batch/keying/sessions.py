"""A session, mostly in Blender: inputs done one after another, each wholly or not at all, and summed up in a line.

Ctrl-C ends it between two steps: what was written by then is whole, and nothing else was touched. `supervising` has
what is between them ended, from outside.
"""

from __future__ import annotations

import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol, TypeVar

from rigid_motion_batch.command_line import path_line
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.supervising import report, stop_signals

EXTENSION = "rigid_motion"
"""The id in blender_manifest.toml, which the name of the installed module ends with."""

Note = Callable[[str], None]
"""Writes a line for the user."""

StopIfAsked = Callable[[], None]
"""Raises `Stopped` after Ctrl-C or SIGTERM."""


class Input(Protocol):
    """What is to be done."""

    @property
    def source(self) -> str | os.PathLike[str]:
        """The file, as the user has named it."""

    @property
    def title(self) -> str:
        """What the progress bar calls it."""


SomeInput = TypeVar("SomeInput", bound=Input)


@dataclass(frozen=True)
class Work:
    """What a session does, in words."""

    program: str
    doing: str
    """As a heading: "Baking"."""

    done: str
    """What becomes of objects: "baked"."""

    asked: Sequence[str] | None = None
    """The names and patterns of the objects that are meant; None for all."""

    dry_run: bool = False
    in_blender: bool = True


@dataclass
class Outcome:
    """What became of an input."""

    objects: int = 0
    bones: int = 0
    clips: int = 0
    """How many of them were done."""

    refused: int = 0
    """How many objects and bones were not."""

    failed: bool = False
    unreadable: bool = False
    incomplete: bool = False
    """Whether there may be objects in it that nobody can look at, for a library is missing."""

    written: list[Path] = field(default_factory=list)
    """Where to, or where it would have been."""

    matched: set[str] = field(default_factory=set)
    """Of the names and patterns that were asked for, those that there was an object or a bone for."""

    def add_written(self, path: Path) -> None:
        """Note that a file is complete at its place."""
        self.written.append(path)
        report(written=os.fspath(path))

    @property
    def done(self) -> int:
        return self.objects + self.bones + self.clips


def do_all(
    inputs: Sequence[SomeInput], work: Work, begin: Callable[[Note, StopIfAsked], Callable[[SomeInput], Outcome]]
) -> int:
    """Do all inputs, print the paths that were written, and return the exit code.

    Parameters
    ----------
    inputs : sequence of Input
    work : Work
    begin : callable
        Given what writes notes and what ends the session, returns what does one input.
    """
    outcomes: list[Outcome] = []
    stopped, unmatched = None, set()
    extension = _extension() if work.in_blender else nullcontext()
    with Progress() as progress, extension, _stopped_between_steps() as stop_if_asked:
        do = begin(progress.note, stop_if_asked)
        try:
            with progress.stage(work.doing, len(inputs)) as stage:
                for one in inputs:
                    stage.say(one.title)
                    summary = _summary(outcomes, len(inputs), work, interrupted=True)
                    report(at=os.fspath(one.source), summary=summary)
                    outcomes.append(do(one))
                    stage.advance()
        except Stopped as signalled:
            stopped = signalled.args[0]
            outcomes += [signalled.partly] if signalled.partly and signalled.partly.written else []
        else:
            seen = [one for one in outcomes if not one.failed]
            unmatched = set(work.asked or ()).difference(*(one.matched for one in outcomes)) if seen else set()
            for name in sorted(unmatched):
                progress.note(
                    f"{work.program}: --objects {name}: no object or bone of that name has anything to be {work.done}"
                )
    report(ended=True)
    if not work.dry_run:
        for path in (path for one in outcomes for path in one.written):
            print(path_line(path), flush=True)
    print(_summary(outcomes, len(inputs), work, interrupted=stopped is not None), file=sys.stderr, flush=True)
    if stopped is not None:
        return 128 + stopped
    if all(one.unreadable for one in outcomes):
        return 2
    return int(bool(unmatched) or any(one.refused or one.failed or one.incomplete for one in outcomes))


def _summary(outcomes: Sequence[Outcome], count: int, work: Work, *, interrupted: bool) -> str:
    """What came of it all, in a line."""
    would = "to be " if work.dry_run else ""
    objects, bones, clips = (sum(getattr(one, what) for one in outcomes) for what in ("objects", "bones", "clips"))
    refused = sum(one.refused for one in outcomes)
    written, failed = sum(bool(one.written) for one in outcomes), sum(one.failed for one in outcomes)
    idle = sum(not (one.written or one.failed) for one in outcomes)
    parts = [f"{written} {would}written"]
    parts += [f"{idle} left alone"] if idle else []
    parts += [f"{failed} failed"] if failed else []
    parts += [f"{incomplete} incomplete"] if (incomplete := sum(one.incomplete for one in outcomes)) else []
    parts += [f"{count - len(outcomes)} not reached"] if interrupted else []
    done = [counted(objects, "object")] if objects or not (bones or clips) else []
    done += [counted(bones, "bone")] if bones else []
    done += [counted(clips, "clip")] if clips else []
    told = f"{' and '.join(done)} {would}{work.done}" + (f", {refused} not" if refused else "")
    return f"{'Stopped. ' if interrupted else ''}{told}; {counted(count, 'file')}: {', '.join(parts)}."


def counted(count: int, what: str) -> str:
    """How many there are of something, "1 bone" or "24 bones"."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def tell_failure(note: Note, title: object, error: Exception) -> None:
    """Say where the program failed: what nobody foresaw in one input must not keep the others from being done."""
    note(f"{title}: not written, for this program failed ({type(error).__name__}: {error}):")
    traceback.print_exception(error)


@contextmanager
def _extension() -> Iterator[None]:
    """What the extension keeps in files and follows, from this checkout, in place of one that is installed."""
    import addon_utils
    import bpy

    from rigid_motion import animation

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


class Stopped(KeyboardInterrupt):
    """By Ctrl-C or SIGTERM. `args` are the number of the signal."""

    partly: Outcome | None = None
    """What became of the input that it came in."""


@contextmanager
def _stopped_between_steps() -> Iterator[StopIfAsked]:
    """A function that raises `Stopped` after Ctrl-C or SIGTERM. Blender swallows what is raised while it works.

    A step that takes too long is ended by the parent of this process: see `supervising`.
    """
    received: list[int] = []
    before = {one: signal.signal(one, lambda number, _: received.append(number)) for one in stop_signals()}

    def stop_if_asked() -> None:
        if received:
            raise Stopped(received[0])

    try:
        yield stop_if_asked
    finally:
        for one, handler in before.items():
            # None stands for the Blender program's own, which Python cannot put back.
            signal.signal(one, signal.SIG_DFL if handler is None else handler)
