"""Plans: tasks that read one another's outputs, checked before anything is done, and written as JSON for others to run.

A plan may have come from a file, so what it says of paths is not believed: no output lies outside the output folder.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from itertools import accumulate
from pathlib import Path

import numpy as np

from rigid_motion_batch.files import replacing

from .hashing import is_regular, version_from
from .tasks import FUNCTION, Task

SCHEMA = 1

OWN_NAMES = frozenset({".workplan", "manifest.json"})
"""What lies in an output folder beside the outputs."""


class PlanError(ValueError):
    """What is wrong with a plan, and with which task."""


class Plan:
    """Tasks in an order in which they can be done.

    Parameters
    ----------
    tasks : iterable of Task
        In the order in which they are wanted; tasks that others read are done before these.
    version : str
        Of the program: whoever does a task must have the same. Where it changes, everything is done again (see
        `code_version`), but for the steps of which more is known:
    versions : mapping, optional
        A step, as tasks name it, to what it uses, and the version of each: where these change, it is done again.
    folder : Path, optional
        Where relative inputs count from; the current one unless given.

    Raises
    ------
    PlanError
        For names or outputs that occur twice, outputs that are not below the output folder, tasks that wait for tasks
        that do not exist, or for one another.
    """

    def __init__(
        self,
        tasks: Iterable[Task],
        version: str,
        folder: Path | None = None,
        *,
        versions: Mapping[str, Mapping[str, str]] | None = None,
    ) -> None:
        listed = list(tasks)
        by_name = {task.name: task for task in listed}
        _check_names(listed, by_name)
        _check_outputs(listed)
        self.version, self.versions = version, dict(versions or {})
        self._version_of = {function: version_from(parts) for function, parts in self.versions.items()}
        self.folder = Path.cwd() if folder is None else folder
        self.tasks: Mapping[str, Task] = by_name
        self.order: tuple[str, ...] = _ordered(by_name)
        self.place: Mapping[str, int] = {name: place for place, name in enumerate(self.order)}
        """Task to where it is in the order."""

        self.readers: Mapping[str, tuple[str, ...]] = _Readers(self.tasks, self.order, self.place)
        """Task to the tasks that read its outputs, in their order."""

        self.late: frozenset[str] = _late(self.tasks, self.order)
        """Partial tasks and those after them: whether there is anything to do shows when the others are through."""

    def version_of(self, function: str) -> str:
        """The version of a step."""
        return self._version_of.get(function, self.version)

    def parts_of(self, function: str) -> Mapping[str, str]:
        """What a step uses, and the version of each; nothing where that is not known."""
        return self.versions.get(function, {})

    def write(self, path: Path) -> None:
        """Write the plan as JSON, a line for each task."""
        header = {"schema": SCHEMA, "version": self.version, "versions": self.versions}
        header["folder"] = os.fspath(self.folder)
        if path.is_symlink():
            path.unlink()  # Whoever put it there, what it leads to is not ours.
        with replacing(path) as stream:
            stream.write(json.dumps(header)[:-1] + ', "tasks": [')
            for number, name in enumerate(self.order):
                stream.write(f"{',' if number else ''}\n{json.dumps(self.tasks[name].as_json())}")
            stream.write("\n]}\n")

    @classmethod
    def read(cls, path: Path, folder: Path | None = None) -> Plan:
        """Read a plan that was written.

        Parameters
        ----------
        path : Path
        folder : Path, optional
            Where relative inputs count from here; where they did when it was written unless given.

        Raises
        ------
        PlanError
            Where the file is not such a plan.
        OSError
            Where it cannot be read.
        """
        if path.exists() and not is_regular(path):
            raise PlanError(f"{path}: this is no file; take it away, and run the program that plans once more")
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["schema"] != SCHEMA:
                raise PlanError(f"{path}: a plan of schema {content['schema']}; this program knows {SCHEMA}")
            tasks = (Task(**fields) for fields in content["tasks"])
            versions = content.get("versions")
            return cls(tasks, content["version"], folder or Path(content["folder"]), versions=versions)
        except PlanError:
            raise
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise PlanError(f"{path}: this is not a plan ({error}); run the program that plans once more") from None


def _check_names(listed: list[Task], tasks: Mapping[str, Task]) -> None:
    for task in listed:
        if not task.name or not task.name.isprintable():
            raise PlanError(f"task {task.name!r}: a name is one line of text")
        if tasks[task.name] is not task:
            raise PlanError(f"task {task.name!r}: there are two of that name")
        if not FUNCTION.fullmatch(task.function):
            raise PlanError(f"task {task.name!r}: {task.function!r} is no function; write package.module:function")
        if not (isinstance(task.arguments, dict) and isinstance(task.weight, int | float) and task.weight >= 0.0):
            raise PlanError(f"task {task.name!r}: arguments have names, and a weight is a number from 0")
        if not task.outputs:
            raise PlanError(f"task {task.name!r}: it makes nothing; name at least one output")
        for before in task.after:
            if before not in tasks:
                raise PlanError(f"task {task.name!r}: there is no task {before!r} to come before it")
            if tasks[before].temporary and task.partial:
                raise PlanError(f"task {task.name!r}: {before!r} is temporary, and a partial task cannot ask for it")


def _check_outputs(listed: list[Task]) -> None:
    for task in listed:
        for output in task.outputs:
            _check_path(task, output)
    suspects = _suspects(listed)
    if not suspects:
        return
    makers: dict[str, str] = {}
    for task, output in _folded_outputs(listed):
        if hash(output) in suspects:
            if output in makers:
                raise PlanError(f"task {task.name!r}: {output!r} is made by {makers[output]!r} already")
            makers[output] = task.name
    for task, output in _folded_outputs(listed):
        for folder in _folders_of(output):
            if folder in makers:
                raise PlanError(
                    f"task {task.name!r}: {output!r} lies in {folder!r}, which is a file of {makers[folder]!r}"
                )


def _suspects(listed: list[Task]) -> set[int]:
    """The hashes that outputs have in common with one another, or with the folders that they lie in.

    Of ten thousand clips there are half a million outputs: as text they would take more memory than all else.
    """
    files = np.fromiter((hash(output) for _, output in _folded_outputs(listed)), np.int64)
    files.sort()
    folders = np.fromiter((hash(folder) for task in listed for folder in _folders_of_task(task)), np.int64)
    twice = files[1:][files[1:] == files[:-1]]
    both = folders[np.searchsorted(files, folders) < np.searchsorted(files, folders, side="right")]
    return {*twice.tolist(), *both.tolist()}


def _folded_outputs(listed: list[Task]) -> Iterator[tuple[Task, str]]:
    """Every output with its task. Windows and macOS take "Hand" and "hand" for one name."""
    return ((task, output.casefold()) for task in listed for output in task.outputs)


def _folders_of_task(task: Task) -> set[str]:
    return {folder for output in task.outputs for folder in _folders_of(output.casefold())}


def _folders_of(path: str) -> Iterator[str]:
    return accumulate(path.split("/")[:-1], "{}/{}".format)


def _check_path(task: Task, output: str) -> None:
    parts = output.split("/")
    # A colon in the first part would be a drive of Windows, and in another a stream of a file.
    if not output.isprintable() or any(character in output for character in "\\:") or {"", ".", ".."} & {*parts}:
        raise PlanError(f"task {task.name!r}: {output!r} is no path below the output folder")
    if parts[0].casefold() in OWN_NAMES:
        raise PlanError(f"task {task.name!r}: {parts[0]!r} is where the work plan keeps its own files")


def _ordered(tasks: Mapping[str, Task]) -> tuple[str, ...]:
    """Every task behind those it reads from, and otherwise as they were listed."""
    order: dict[str, None] = {}
    begun: dict[str, None] = {}
    """Those that wait for the ones behind them."""
    for name in tasks:
        waiting = [name]
        while waiting:
            latest = waiting[-1]
            open_ones = [before for before in tasks[latest].after if before not in order]
            if not open_ones:
                order[waiting.pop()] = None
                begun.pop(latest, None)
            elif latest in begun:
                circle = [*begun][[*begun].index(latest) :]
                raise PlanError(f"tasks wait for one another: {', '.join(map(repr, [*circle, latest]))}")
            else:
                begun[latest] = None
                waiting.extend(reversed(open_ones))
    return tuple(order)


class _Readers(Mapping[str, tuple[str, ...]]):
    """Task to the tasks that read its outputs: as numbers, the places of those of the first task, of the second, ..."""

    def __init__(self, tasks: Mapping[str, Task], order: tuple[str, ...], place: Mapping[str, int]) -> None:
        read = np.fromiter((place[before] for name in order for before in tasks[name].after), np.int32)
        reader = np.repeat(np.arange(len(order), dtype=np.int32), [len(tasks[name].after) for name in order])
        self._order, self._place = order, place
        self._readers = reader[np.argsort(read, kind="stable")]
        self._begins = np.searchsorted(np.sort(read), np.arange(len(order) + 1))

    def __getitem__(self, name: str) -> tuple[str, ...]:
        place = self._place[name]
        readers = self._readers[self._begins[place] : self._begins[place + 1]]
        return tuple(map(self._order.__getitem__, readers.tolist()))

    def __iter__(self) -> Iterator[str]:
        return iter(self._order)

    def __len__(self) -> int:
        return len(self._order)


def _late(tasks: Mapping[str, Task], order: Iterable[str]) -> frozenset[str]:
    late: set[str] = set()
    for name in order:
        if tasks[name].partial or not late.isdisjoint(tasks[name].after):
            late.add(name)
    return frozenset(late)
