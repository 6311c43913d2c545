"""Saving of .blend files, complete or not at all, with the reason if it fails."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import bpy

CUT_OFF = "it broke off half-way, the disk may be full"


def save_copy(path: Path, **options: Any) -> None:
    """Save the open file as a copy at a free path, with these options of Blender.

    Raises
    ------
    OSError
        With the path and the reason.
    """
    whole = str(path.absolute())  # Blender 4.5 takes a relative path as relative to $PWD, wherever it runs.
    try:
        bpy.ops.wm.save_as_mainfile(filepath=whole, copy=True, check_existing=False, **options)
        # Blender does not notice a full disk when it writes compressed files.
        with cast(Any, bpy.data.libraries).load(whole):
            pass
    except RuntimeError as error:
        said = " ".join(str(error).split())
        # Blender names a file that it cannot open, with the reason; its messages about a full disk vary.
        raise OSError(None, said.rpartition(": ")[2] if path.name in said else CUT_OFF, str(path)) from None
    except OSError:
        raise OSError(None, CUT_OFF, str(path)) from None
