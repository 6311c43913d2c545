"""What a comparison's results depend on beside its inputs and options: this program, Blender, and NumPy."""

from __future__ import annotations

import numpy as np

from scripts.workplan import code_version

SOURCES = (
    *("blender_manifest.toml", "addon/motion", "addon/animation"),
    *("scripts/comparison", "scripts/files.py", "scripts/trajectories"),
)
"""Of this program: see `workplan.code_version`."""


def program_version() -> str:
    """The same wherever the same results come out."""
    import bpy  # Numbers alone need no Blender.

    return f"Blender {bpy.app.version_string}, NumPy {np.__version__}, program {code_version(*SOURCES)[:12]}"
