"""Files that are whole or not there: written beside their place, under a name of their own, and moved into it.

Text is UTF-8 with LF line ends on every system, so that two runs can be compared byte by byte.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TextIO


@contextmanager
def written_beside(path: Path) -> Iterator[Path]:
    """A path next to `path` for a file that takes its place when the block ends well, and leaves no trace otherwise.

    It ends as `path` does. Folders that are missing on the way are made.

    Raises
    ------
    OSError
        Where the folder cannot be written, or (on Windows) another program has `path` open. It names `path`, and not
        what is written meanwhile.
    """
    if not path.parent.is_dir():
        path.parent.mkdir(parents=True, exist_ok=True)
    target = Path(os.path.realpath(path)) if path.is_symlink() else path
    beside = target.with_name(f".{os.getpid()}.{target.name}")
    try:
        yield beside
        beside.replace(target)
    except BaseException as error:
        with suppress(OSError):  # What went wrong before is what counts.
            beside.unlink()
        if isinstance(error, OSError) and error.filename == str(beside):
            error.filename, error.filename2 = str(path), None
        raise


@contextmanager
def replacing(path: Path) -> Iterator[TextIO]:
    """Open a text file that takes the place of `path` when the block ends well: see `written_beside`."""
    with written_beside(path) as beside, beside.open("w", encoding="utf-8", newline="\n") as stream:
        yield stream


def clear_beside(path: Path) -> None:
    """Delete what processes that were killed left of `path`: nobody may be writing it."""
    remains = re.compile(rf"\.\d+\.{re.escape(path.name)}")
    for name in os.listdir(path.parent) if path.parent.is_dir() else ():
        if remains.fullmatch(name):
            with suppress(OSError):
                path.with_name(name).unlink()


def write_text(path: Path, text: str) -> None:
    """Write all of a text file, or nothing of it."""
    with replacing(path) as stream:
        stream.write(text)
