"""Doing one task: from an order, which is plain data, to files in a scratch folder and a message of what came of it.

Nothing here touches the manifest or what is in place already, so it does not matter where it happens or how it ends:
in this process, in a worker, on another machine. Orders and messages are plain data for JSON.
"""

from __future__ import annotations

import errno
import os
import shutil
import time
import traceback
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .hashing import FileState, is_regular
from .tasks import Job, TaskError, find_step, places_of

FULL_OR_FORBIDDEN = frozenset({errno.ENOSPC, errno.EDQUOT, errno.EROFS})
"""Errors that the next task will have as well."""

NEARLY_NOTHING = 1 << 20
"""Bytes; where fewer are free, the disk is full whatever the program that failed says (Blender says little)."""


@dataclass(frozen=True)
class Order:
    """A task to be done, and where."""

    name: str
    function: str
    arguments: Mapping[str, Any]
    inputs: Mapping[str, tuple[int, int] | None]
    """Path to size and time of change in ns when it was looked at, None where it was missing."""

    outputs: tuple[str, ...]
    output: str
    """The output folder."""

    scratch: str
    finished: tuple[str, ...] = ()
    """The tasks before it that are done."""

    def as_json(self) -> dict[str, Any]:
        """Every field, for `Order(**fields)`."""
        return dict(vars(self))


@dataclass(frozen=True)
class Told:
    """How far a task is."""

    name: str
    share: float
    doing: str


@dataclass(frozen=True)
class Noted:
    """A line for the user."""

    name: str
    text: str


@dataclass(frozen=True)
class Made:
    """A task's outputs are in its scratch folder."""

    name: str
    outputs: Mapping[str, FileState]
    seconds: float
    facts: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Failed:
    """A task cannot be done."""

    name: str
    message: str
    details: str = ""
    """Where in the program, for an error that nobody foresaw."""

    hopeless: bool = False
    """Whether the others will fail for the same reason: the disk is full."""


@dataclass(frozen=True)
class Lost:
    """Whoever did a task is gone; nothing is known of the task itself, so it may be tried again."""

    name: str
    message: str


Message = Told | Noted | Made | Failed | Lost
KINDS = {kind.__name__: kind for kind in (Told, Noted, Made, Failed, Lost)}


def as_json(message: Message) -> dict[str, Any]:
    """A message as plain data."""
    content = {"kind": type(message).__name__, **vars(message)}
    if isinstance(message, Made):
        content["outputs"] = {path: state.as_json() for path, state in message.outputs.items()}
    return content


def from_json(content: Mapping[str, Any]) -> Message:
    """The message of `as_json`."""
    fields = {name: value for name, value in content.items() if name != "kind"}
    if "outputs" in fields:
        fields["outputs"] = {path: FileState(**state) for path, state in fields["outputs"].items()}
    return KINDS[content["kind"]](**fields)


def perform(order: Order, tell: Callable[[Told | Noted], object]) -> Made | Failed:
    """Do a task. Its scratch folder is there afterwards if it was made.

    Parameters
    ----------
    order : Order
    tell : callable
        Takes what it says meanwhile.
    """
    scratch = Path(order.scratch)
    job = Job(
        Path(order.output),
        scratch,
        order.outputs,
        order.finished,
        progress=lambda share, doing: tell(Told(order.name, share, doing)),
        note=lambda text: tell(Noted(order.name, text)),
    )
    started = time.perf_counter()
    done: Made | Failed | None = None
    try:
        _check_files(order)
        scratch.mkdir(parents=True, exist_ok=True)
        facts = find_step(order.function)(job, **order.arguments)
        _check_inputs(order)
        outputs = {path: _state_of(scratch / place, path) for path, place in places_of(order.outputs).items()}
        done = Made(order.name, outputs, time.perf_counter() - started, dict(facts or {}))
    except TaskError as error:
        done = Failed(order.name, str(error))
    except OSError as error:
        where = f"{_shown(error.filename, order)}: " if error.filename else ""
        done = Failed(
            order.name, f"{where}{error.strerror or error}", traceback.format_exc(), error.errno in FULL_OR_FORBIDDEN
        )
    except Exception as error:
        done = Failed(order.name, f"{type(error).__name__}: {error}", traceback.format_exc())
    finally:
        if not isinstance(done, Made):
            shutil.rmtree(scratch, ignore_errors=True)
    if isinstance(done, Failed) and not done.hopeless and _is_full(Path(order.output)):
        return Failed(order.name, f"{os.strerror(errno.ENOSPC)} ({done.message})", done.details, hopeless=True)
    return done


def seen(path: Path) -> tuple[int, int] | None:
    """Size and time of change of an input, None where it is missing."""
    try:
        status = path.stat()
    except (OSError, ValueError):
        return None
    return status.st_size, status.st_mtime_ns


def _check_files(order: Order) -> None:
    """Nothing is read that never ends, or can be read only once."""
    for path in order.inputs:
        if seen(Path(path)) and not is_regular(Path(path)):
            raise TaskError(f"{path}: this is no file, but a folder, pipe or device; give a file")


def _check_inputs(order: Order) -> None:
    for path, before in order.inputs.items():
        if seen(Path(path)) != (tuple(before) if before else None):
            raise TaskError(f"{path}: this file changed while it was read; run the same command again")


def _state_of(place: Path, path: str) -> FileState:
    if not place.is_file():
        raise TaskError(f"{path}: this was to be made, and was not")
    return FileState.of(place)


def _shown(found: str | bytes | int, order: Order) -> str:
    """A path as the user knows it: the scratch folder is nobody's business."""
    found = Path(str(found))
    places = {Path(order.scratch, place): path for path, place in places_of(order.outputs).items()}
    # What takes an output's place when it is whole has a name that ends in the output's, and perhaps in another's.
    whose = [place for place in places if place.parent == found.parent and found.name.endswith(place.name)]
    if whose:
        return f"{order.output}/{places[max(whose, key=lambda place: len(place.name))]}"
    return str(found).replace(order.scratch, order.output)


def _is_full(output: Path) -> bool:
    try:
        return shutil.disk_usage(output).free < NEARLY_NOTHING
    except OSError:
        return False
