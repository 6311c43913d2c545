"""Whose a file is that lies where an output goes: an input, a stranger's, or one that this program has written.

Looked at before anything is written. What the manifest lists is the program's own; where the manifest is damaged and
the folder is one that the program has worked in, so is everything.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Collection, Iterable, Iterator
from itertools import chain
from pathlib import Path

from .hashing import FileState, is_regular
from .manifest import Manifest
from .plan import Plan
from .status import few
from .workspace import Workspace

WAYS_OUT = "choose another folder with --output, or replace {} with --force"


class OutputError(Exception):
    """What must not be replaced, and the way out, in one line."""


def require_free(plan: Plan, workspace: Workspace, outputs: Collection[str] = (), *, force: bool = False) -> None:
    """Make sure that a plan replaces nothing but what this program has written.

    Parameters
    ----------
    plan : Plan
    workspace : Workspace
        Opened. Where this fails in a folder that is new to the program, what was done since then is undone.
    outputs : collection of str
        More paths in the output folder that will be written, each by a task of its name.
    force : bool
        A stranger's files may be replaced, and what was made of other inputs. Inputs and folders never are.

    Raises
    ------
    OutputError
    """
    try:
        _require_no_inputs_inside(plan, workspace)
        strangers = _strangers(plan, workspace, outputs)
        if strangers and not force:
            some = few([os.fspath(workspace.output / path) for path in strangers])
            written, them = ("was", "it") if len(strangers) == 1 else ("were", "them")
            raise OutputError(f"{some} {written} not written by this program; {WAYS_OUT.format(them)}")
    except OutputError:
        if not workspace.was_ours:
            workspace.withdraw(tuple(workspace.done_here))
        raise


def require_same_inputs(plan: Plan, workspace: Workspace, *, force: bool = False) -> None:
    """Make sure that a plan has an input in common with those that the folder holds the results of, if any.

    Compared are the tasks of the same steps: by their names, and by the content of their inputs. With `force` what the
    folder holds is from now on known as nothing but files of this program.

    Raises
    ------
    OutputError
    """
    manifest, tasks = workspace.manifest, [task for task in plan.tasks.values() if task.inputs]
    if any((record := manifest.get(task.name)) and record.key for task in tasks):
        return
    functions = {task.function for task in tasks}
    held = {
        name: record.made_of["inputs"]
        for name in manifest
        if (record := manifest.get(name))
        and record.made_of.get("function") in functions
        and isinstance(record.made_of.get("inputs"), dict)
    }
    paths = {path: digest for inputs in held.values() for path, digest in inputs.items()}
    if not paths or not {*_digests(plan)}.isdisjoint(map(str, paths.values())):
        return
    if not force:
        names = [Path(path).name for path in paths]
        other = workspace.output.with_name(Path(next(iter(plan.tasks.values())).inputs[0]).stem)
        raise OutputError(
            f"{_shown(workspace.output)} holds another comparison, of {few(names)}; choose another "
            f"folder, such as --output {_shown(other)}, or replace it with --force"
        )
    for name in held:
        manifest.withdraw(name)


def _require_no_inputs_inside(plan: Plan, workspace: Workspace) -> None:
    """Raises OutputError for inputs that the program has written itself, or that lie among what it keeps there."""
    own, output = Path(os.path.realpath(workspace.own)), Path(os.path.realpath(workspace.output))
    for path in _inputs(plan):
        place = Path(os.path.realpath(path))
        if own in place.parents:
            raise OutputError(f"{path}: this input lies in {workspace.own}, where the program works; move it elsewhere")
        if output in place.parents and _written([place.relative_to(output).as_posix()], workspace.manifest):
            raise OutputError(f"{path}: this input was written by a run into this folder; choose another with --output")


def _written(paths: Collection[str], manifest: Manifest) -> set[str]:
    """Those of some paths that the program has written."""
    records = (manifest.get(name) for name in manifest) if paths else ()
    return {path for record in records if record for path in record.outputs.keys() & paths}


def _strangers(plan: Plan, workspace: Workspace, outputs: Iterable[str]) -> list[str]:
    """The outputs in whose place there is a file that this program has not written.

    Raises OutputError where there is an input, or a folder.
    """
    manifest = workspace.manifest
    inputs = {identity: path for path in _inputs(plan) for identity in _identities(path)}
    all_ours = workspace.was_ours and not manifest.is_whole
    unknown: dict[str, None] = {}
    asked, record = "", None
    makers = ((path, task.name) for task in plan.tasks.values() for path in task.outputs)
    for path, maker in chain([("manifest.json", "")], ((path, path) for path in outputs), makers):
        place = f"{workspace.output}{os.sep}{path}"
        try:
            found = os.lstat(place)
        except FileNotFoundError:
            continue
        except NotADirectoryError:
            found = None
        if found and (found.st_dev, found.st_ino) in inputs:
            raise OutputError(
                f"{inputs[found.st_dev, found.st_ino]}: this input lies where {place} goes; choose another folder with "
                "--output"
            )
        if path.startswith("."):
            continue  # The program's own, whatever has become of it.
        if found is None or stat.S_ISDIR(found.st_mode):
            kind = "a folder where a file" if found else "a file where a folder"
            raise OutputError(f"{place}: there is {kind} goes; move it, or choose another folder with --output")
        if maker != asked:
            asked, record = maker, manifest.get(maker)
        if all_ours or (record and path in record.outputs) or (maker in manifest and record is None):
            continue
        if path == "manifest.json" and manifest.is_whole:
            continue
        unknown[path] = None
    written = _written(unknown.keys(), manifest)
    return [path for path in unknown if path not in written]


def _inputs(plan: Plan) -> dict[str, None]:
    """The inputs of all tasks, as paths from the current folder or as they are."""
    shown = {path: None for task in plan.tasks.values() for path in task.inputs}
    here = Path.cwd()
    return shown if plan.folder == here else {os.fspath(plan.folder / path): None for path in shown}


def _identities(path: str) -> Iterator[tuple[int, int]]:
    """What a path is in the file system, and what it leads to."""
    for look in (os.lstat, os.stat):
        try:
            found = look(path)
        except (OSError, ValueError):
            continue
        yield found.st_dev, found.st_ino


def _digests(plan: Plan) -> Iterator[str]:
    """Of the inputs that there are."""
    for path in _inputs(plan):
        if is_regular(Path(path)):
            yield FileState.of(Path(path)).sha256


def _shown(path: Path) -> str:
    """A path as one would type it."""
    return os.fspath(path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path)
