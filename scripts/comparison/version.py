"""What a comparison's results depend on beside its inputs and options: this program, Blender, and NumPy."""

from __future__ import annotations

import sys
from contextlib import suppress
from importlib.metadata import PackageNotFoundError, version

import numpy as np

from scripts.workplan import code_version

SOURCES = (
    *("blender_manifest.toml", "addon/motion", "addon/animation"),
    *("scripts/comparison", "scripts/files.py", "scripts/trajectories"),
)
"""Of this program: see `workplan.code_version`."""


def program_version() -> str:
    """The same wherever the same results come out. Raises ImportError where there is no Blender."""
    return f"Blender {blender_version()}, NumPy {np.__version__}, program {code_version(*SOURCES)[:12]}"


def blender_version() -> str:
    """Of the Blender that this runs in, or of its module, which numbers alone need not load: that takes longest."""
    if not getattr(getattr(sys.modules.get("bpy"), "app", None), "binary_path", ""):
        with suppress(PackageNotFoundError):
            return version("bpy")
    import bpy

    return ".".join(map(str, bpy.app.version))
