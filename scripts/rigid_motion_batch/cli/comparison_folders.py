"""The output folder of a comparison: find a free folder, and recognize a folder that compares other recordings."""

from __future__ import annotations

import os
from contextlib import suppress
from itertools import count
from pathlib import Path

from rigid_motion_batch.pipeline.steps import OWN_FOLDER, RunError
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.places import output_folder
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import folder_names
from rigid_motion_batch.recordings.reading import split_source

from .compare_options import own_recordings

RECORD = "comparison.json"
"""The file in the store that names the recordings of a comparison, by paths relative to the output folder."""


def free_folder(sources: list[str]) -> Path:
    """Return `renders/NAME`, named after the first recording.

    The name gets a number if that folder holds another comparison or anything else.
    """
    if sources == own_recordings():
        name = "comparison"
    else:
        file, _, body = Path(sources[0]).name.partition(":")
        name = Path(file).stem + (f"-{body}" if body not in ("", "*") else "")
    (name,) = folder_names([name])
    numbered = (output_folder(name if number == 1 else f"{name}-{number}") for number in count(1))
    return next(folder for folder in numbered if _is_free(folder) or _is_same(folder, sources))


def _is_free(folder: Path) -> bool:
    return not folder.exists() or (folder.is_dir() and not any(folder.iterdir()))


def _is_same(folder: Path, sources: list[str]) -> bool:
    """Return whether a folder holds a comparison of any of these recordings."""
    held = _recordings_of(folder)
    return held is not None and (not held or not held.keys().isdisjoint(_relative_to(sources, folder)))


def _recordings_of(folder: Path) -> dict[str, str] | None:
    """Return the recordings of the comparison in a folder, with their digests; None if it holds no comparison."""
    return Store(folder).noted(RECORD) if (folder / OWN_FOLDER).is_dir() else None


def _relative_to(sources: list[str], folder: Path) -> list[str]:
    """Return the sources relative to a folder, so that both can be moved together."""
    here = os.path.abspath(folder)
    return [os.path.relpath(source, here) if Path(source).drive == folder.drive else source for source in sources]


def require_same_comparison(output: Path, sources: list[str]) -> None:
    """Raise RunError if a folder holds a comparison of other recordings."""
    held = _recordings_of(output)
    if held and not _is_same(output, sources) and not {*held.values()} & {*_digests(sources, Store(output)).values()}:
        names = ", ".join(sorted(Path(item).name for item in held)[:3]) + (" and more" if len(held) > 3 else "")
        raise RunError(
            f"{_short(output)} holds another comparison, of {names}; choose another folder, such as --output "
            f"{_short(free_folder(sources))}, or replace it with --overwrite"
        )


def _short(path: Path) -> str:
    """Return a path as a user would type it here."""
    path, here = path.absolute(), Path.cwd()
    return os.fspath(path.relative_to(here) if path.is_relative_to(here) else path)


def _digests(sources: list[str], store: Store) -> dict[str, str]:
    """Return the digest of the file of each source that exists."""
    result = {}
    for source in sources:
        with suppress(TrajectoryError):
            (result[source],) = store.inputs(split_source(source)[0]).values()
    return result


def note_recordings(store: Store, sources: list[str]) -> None:
    """Record in a folder which recordings it compares."""
    digests = _digests(sources, store)
    store.note(RECORD, dict(zip(_relative_to([*digests], store.output), digests.values(), strict=True)))
