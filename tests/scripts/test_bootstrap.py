"""The set-up in one command: what it installs, and what it says where it cannot."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.system_libraries import DEBIAN, way_out
from scripts import bootstrap

ROOT = Path(__file__).resolve().parents[2]


def run(*arguments: str) -> subprocess.CompletedProcess:
    command = [sys.executable, ROOT / "scripts" / "bootstrap.py", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60)


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",)])
def test_help_shows_the_commands(arguments):
    done = run(*arguments)
    assert done.returncode == 0
    for command in bootstrap.COMMANDS:
        assert f"bootstrap.py {command}" in done.stdout


def test_an_unknown_command_is_refused_with_the_known_ones():
    done = run("compair")
    assert done.returncode == 2
    assert "did you mean compare?" in done.stderr
    assert all(command in done.stderr for command in bootstrap.COMMANDS)


@pytest.mark.parametrize("given", [["--blender", "2.79"], ["--blender"]])
def test_a_blender_that_does_not_fit_the_python_is_refused(given):
    done = run("test", *given)
    assert done.returncode == 2
    assert bootstrap._project()["tool"]["rigid-motion"]["blender"][bootstrap.PYTHON][0] in done.stderr


def test_every_package_is_pinned():
    project = bootstrap._project()
    groups = tuple(project["dependency-groups"])
    for requirement in bootstrap._requirements(project, "5.2.3", groups):
        assert re.match(r"[\w.-]+==\d[\w.]*(;|$)", requirement), requirement


def test_the_blender_that_is_asked_for_is_the_only_one():
    requirements = bootstrap._requirements(bootstrap._project(), "4.5.15", ())
    assert [r for r in requirements if r.startswith("bpy")] == ["bpy==4.5.15"]


@pytest.mark.parametrize("kind", ["", "ImportError: "])
def test_a_missing_system_library_is_named_with_the_packages_to_install(kind):
    said = way_out(f"{kind}libXi.so.6: cannot open shared object file: No such file or directory")
    assert "the system library libXi.so.6," in said
    assert f"apt-get install -y {DEBIAN}" in said
    assert DEBIAN in (ROOT / "README.md").read_text(encoding="utf-8")
