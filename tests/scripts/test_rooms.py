"""Tests of imports: the packages that a worker in Blender uses may import only NumPy and Blender's modules."""

import sys

import pytest

from tests.scripts.processes import run_python

IMPORTING = """
import importlib, pkgutil, sys
from pathlib import Path
{bpy}
before = set(sys.modules)
room = importlib.import_module("rigid_motion_batch.{room}")
for module in pkgutil.iter_modules(room.__path__):
    importlib.import_module(f"rigid_motion_batch.{room}.{{module.name}}")
print(*sorted({{name.partition(".")[0] for name in set(sys.modules) - before if "cython" not in name}}))
print(*sorted({{".".join(name.split(".")[:2]) for name in sys.modules if name.startswith("rigid_motion_batch.")}}))
"""
ALLOWED = {"numpy", "bpy_extras", "rigid_motion", "rigid_motion_batch"}


def imported(room: str) -> tuple[set[str], set[str]]:
    """Return the packages outside Python that all modules of a package import, and the parts of the batch half."""
    bpy = "" if room == "analysis" else "import bpy"
    code = IMPORTING.format(room=room, bpy=bpy)
    result = run_python("-c", code)
    assert result.returncode == 0, result.stderr
    packages, parts = (set(line.split()) for line in result.stdout.strip().splitlines()[-2:])
    return packages - set(sys.stdlib_module_names), parts


@pytest.mark.blender
@pytest.mark.any_blender
@pytest.mark.parametrize("room", ["recordings", "analysis", "scenes"])
def test_a_worker_needs_numpy_and_blender_alone(room: str) -> None:
    packages, parts = imported(room)
    assert packages <= ALLOWED
    drawing = {f"rigid_motion_batch.{name}" for name in ("report", "pipeline", "cli")}
    assert not parts & drawing
    assert room != "analysis" or "bpy" not in packages
