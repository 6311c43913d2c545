"""Saving .blend files whole, and the reason where that cannot be."""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import bpy

CUT_OFF = "it broke off half-way, the disk may be full"


def save_copy(path: Path, **options: Any) -> None:
    """Save what is open at a path that is free, as a copy, with these options of Blender.

    Raises
    ------
    OSError
        With the path and the reason.
    """
    whole = str(path.absolute())  # Blender 4.5 takes a relative one to be one of $PWD, wherever it runs.
    try:
        bpy.ops.wm.save_as_mainfile(filepath=whole, copy=True, check_existing=False, **options)
        # Of compressed files Blender does not notice that a disk is full.
        with cast(Any, bpy.data.libraries).load(whole):
            pass
    except RuntimeError as error:
        said = " ".join(str(error).split())
        # A file that it cannot open it names, with the reason; what it says of a full disk may be anything.
        raise OSError(None, said.rpartition(": ")[2] if path.name in said else CUT_OFF, str(path)) from None
    except OSError:
        raise OSError(None, CUT_OFF, str(path)) from None
