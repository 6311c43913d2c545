"""System libraries that Blender's wheel needs on Linux, and messages for missing ones."""

from __future__ import annotations

import ctypes
import re
import sys

from rigid_motion_batch.command_line import program_of
from rigid_motion_batch.places import CHECKOUT, install_command
from rigid_motion_batch.silencing import silenced
from rigid_motion_batch.supervising import ended_at_once

DEBIAN = "libx11-6 libxrender1 libxfixes3 libxi6 libxkbcommon0 libsm6 libice6 libgl1 libegl1 libgl1-mesa-dri"
"""Package names in Debian and Ubuntu."""

FEDORA = "libX11 libXrender libXfixes libXi libxkbcommon libSM libICE mesa-libGL mesa-libEGL mesa-dri-drivers"
"""Package names in Fedora and its relatives."""

BLENDER_PYTHONS = ("3.11", "3.13")
"""The versions of Python for which there are wheels of Blender."""

LOADED_LATE = ("libEGL.so.1", "libGL.so.1")
"""Libraries that Blender loads only when it renders. If it cannot, it aborts the whole process."""


def missing_for_rendering() -> str | None:
    """Return the dynamic linker's message about the first missing library; None if none is missing."""
    if sys.platform != "linux":
        return None
    for library in LOADED_LATE:
        try:
            ctypes.CDLL(library)
        except OSError as error:
            return str(error)
    return None


def require_blender(script: str) -> None:
    """Load Blender, or end the command with exit code 2 and a message with what to do."""
    if problem := blender_problem(script):
        print(f"{program_of(script)}: {problem}", file=sys.stderr)
        sys.exit(2)


def blender_problem(script: str) -> str:
    """Load Blender, and return why that failed in a script and what to do; empty if it worked."""
    try:
        with ended_at_once(), silenced():  # If OCIO is set, Blender prints that.
            import bpy  # noqa: F401
    except ImportError as error:
        return problem_of(error, script)
    return ""


def problem_of(error: ImportError, script: str = "compare.py") -> str:
    """Return which module is missing and how to install it: one line in an installation by pip, a few in a checkout."""
    if CHECKOUT or not isinstance(error, ModuleNotFoundError):
        return f"{error}\n{way_out(str(error), script)}"
    if error.name != "bpy":
        return f"this needs the module {error.name}, which {install_command('compare', 'compare')} brings"
    return (
        f"this needs Blender, which {install_command('blender', 'compare')} brings, with Python "
        f"{' or '.join(BLENDER_PYTHONS)}"
    )


def way_out(error: str, script: str = "compare.py") -> str:
    """Return what to do about an error message of `import bpy` in a script, in a few lines."""
    missing = re.search(r"(\S+): cannot open shared object file", error)
    if missing:
        return (
            f"Blender needs the system library {missing[1]}, which this machine does not have. Install, as root:\n"
            f"  Debian, Ubuntu:  apt-get install -y {DEBIAN}\n"
            f"  Fedora, RHEL:    dnf install -y {FEDORA}"
        )
    module = re.search(r"No module named '([\w.]+)'", error)
    if module and module[1] != "bpy":
        return (
            "python scripts/bootstrap.py, as in the README, brings it; compare --blender PROGRAM films with a Blender."
        )
    here = ".".join(map(str, sys.version_info[:2]))
    fitting = f"Python {' or '.join(BLENDER_PYTHONS)}"
    lines = [f"Blender has no wheel for Python {here}: use {fitting}."] if here not in BLENDER_PYTHONS else []
    lines.append("Run this by `python scripts/bootstrap.py`, which installs it,")
    lines.append(f"or inside Blender: blender --background --python scripts/{script} -- INPUT")
    return "\n".join(lines)


def without_blender(what: str, *, films: bool) -> str:
    """Return the message for a comparison that needs Blender without having it, in a few lines; `what` begins it."""
    here = ".".join(map(str, sys.version_info[:2]))
    fits = here in BLENDER_PYTHONS
    where = "" if fits else f" with Python {' or '.join(BLENDER_PYTHONS)}"
    lines = [
        f"{what} Blender, which is not here{'' if fits else f', and has no wheel for Python {here}'}.",
        f"  {install_command('blender', 'compare')}{where} brings it; --blender PROGRAM uses one that is installed.",
    ]
    return "\n".join([*lines, *(["  --no-video does without: numbers and report."] if films else [])])
