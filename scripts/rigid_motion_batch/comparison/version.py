"""What a comparison's results depend on beside its inputs and options: this program, Blender, and NumPy."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from rigid_motion_batch.workplan import code_version
from rigid_motion_batch.workplan.sources import KEPT, SourceReader

SOURCES = (
    *("blender_manifest.toml", "rigid_motion/motion", "rigid_motion/animation"),
    *(
        f"rigid_motion_batch/{part}"
        for part in (
            *("analysis", "comparison", "recordings", "scenes", "axes.py", "command_line.py", "files.py", "hushing.py"),
            *("palette.py", "places.py", "rows.py"),
        )
    ),
)
"""Of this program: see `workplan.code_version`."""


READER = SourceReader(KEPT)


def program_version() -> str:
    """What all who work at one plan must have. Raises ImportError where there is no Blender."""
    return f"Blender {blender_version()}, NumPy {np.__version__}, program {code_version(*SOURCES)[:12]}"


def step_versions(functions: Iterable[str]) -> dict[str, dict[str, str]]:
    """What each of some steps uses, and its version: files of this program, and Blender and NumPy where it loads them.

    Steps are named as tasks name them. Raises ImportError where there is no Blender.
    """
    found = {function: _step_version(function) for function in dict.fromkeys(functions)}
    READER.keep()
    return found


@cache
def _step_version(function: str) -> dict[str, str]:
    packages = READER.sources_of(function).packages
    used = {"NumPy": np.__version__} | ({"Blender": blender_version()} if "bpy" in packages else {})
    return used | READER.versions_of(function)


def blender_version() -> str:
    """Of the Blender that this runs in, or of its module, which numbers alone need not load: that takes longest."""
    if not getattr(getattr(sys.modules.get("bpy"), "app", None), "binary_path", ""):
        with suppress(PackageNotFoundError):
            return version("bpy")
    import bpy

    return ".".join(map(str, bpy.app.version))
