"""The version of what results depend on, known without loading what takes long."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib.metadata import PackageNotFoundError

import bpy

from rigid_motion_batch.comparison.version import blender_version, program_version
from tests.scripts.comparing import ROOT


def test_the_version_of_blender_is_that_which_would_be_loaded() -> None:
    assert blender_version() == ".".join(map(str, bpy.app.version))


def test_a_blender_that_was_not_installed_by_pip_is_asked_itself(monkeypatch) -> None:
    def nothing_known(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("rigid_motion_batch.comparison.version.version", nothing_known)
    assert blender_version() == ".".join(map(str, bpy.app.version))


def test_numbers_are_compared_without_loading_blender(tmp_path) -> None:
    script = """
import json, sys
from rigid_motion_batch.cli import compare
code = compare.main(["assets/throw.csv", "--no-video", "--rates", "5", "--jobs", "0", "--output", sys.argv[1]])
from rigid_motion_batch.comparison.version import program_version
print(json.dumps({"code": code, "loaded": "bpy" in sys.modules, "version": program_version()}))
"""
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path], capture_output=True, text=True, timeout=60, cwd=ROOT, check=True
    )
    said = json.loads(done.stdout.splitlines()[-1])
    assert said == {"code": 0, "loaded": False, "version": program_version()}
