"""Tests of bootstrap.py: the packages that it installs, and its messages if it cannot."""

import re
from pathlib import Path

import pytest

from rigid_motion_batch.cli.commands import COMMANDS
from rigid_motion_batch.cli.reduce import IN_FOLDERS
from rigid_motion_batch.recordings.gltf import ENDINGS
from rigid_motion_batch.recordings.reading import JSON, TEXT
from rigid_motion_batch.system_libraries import DEBIAN, way_out
from scripts import bootstrap
from tests.scripts.processes import ROOT, run_python

BOOTSTRAP = ROOT / "scripts" / "bootstrap.py"


@pytest.mark.parametrize("arguments", [(), ("--help",), ("-h",)])
def test_help_shows_the_commands(arguments):
    done = run_python(BOOTSTRAP, *arguments)
    assert done.returncode == 0
    for command in bootstrap.COMMANDS:
        assert f"bootstrap.py {command}" in done.stdout


def test_an_unknown_command_is_refused_with_the_known_ones():
    done = run_python(BOOTSTRAP, "compair")
    assert done.returncode == 2
    assert "did you mean compare?" in done.stderr
    assert all(command in done.stderr for command in bootstrap.COMMANDS)


@pytest.mark.parametrize("given", [["--blender", "2.79"], ["--blender"]])
def test_a_blender_that_does_not_fit_the_python_is_refused(given):
    done = run_python(BOOTSTRAP, "test", *given)
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


@pytest.fixture
def installed(monkeypatch, tmp_path) -> list[str | None]:
    """The versions of Blender that are set up, in a checkout without any; nothing is installed or run."""
    blenders: list[str | None] = []

    def install(blender: str | None, *_: object) -> Path:
        blenders.append(blender)
        return tmp_path / "python"

    monkeypatch.setattr(bootstrap, "_folder", lambda _: tmp_path / "none")
    monkeypatch.setattr(bootstrap, "install", install)
    monkeypatch.setattr(bootstrap, "_blender_starts", lambda _: True)
    monkeypatch.setattr(bootstrap, "_become", lambda *_: 0)
    return blenders


@pytest.mark.parametrize("command", sorted({*bootstrap.COMMANDS} - {bootstrap.DRAWING}))
def test_no_blender_is_set_up_for_the_help_of_a_command(installed, command):
    assert bootstrap.main([command, "--help"]) == bootstrap.main([command, "-h"]) == 0
    assert installed == [None, None]


@pytest.mark.parametrize(("marks", "is_needed"), [("not blender and not once", False), ("blender", True)])
def test_tests_that_need_no_blender_run_without_one(installed, marks, is_needed):
    assert bootstrap.main(["test", "-m", marks, "tests/motion"]) == 0
    assert [blender is not None for blender in installed] == [is_needed]


HELPS = """
import sys
sys.modules["bpy"] = None
from rigid_motion_batch.cli.commands import COMMANDS, main
for command in COMMANDS:
    try:
        main([command, "--help"])
    except SystemExit as ended:
        assert not ended.code, command
"""


def test_commands_say_what_they_do_where_there_is_no_blender():
    done = run_python("-c", HELPS)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("usage: ") >= len(COMMANDS)


@pytest.mark.parametrize(
    ("arguments", "is_needed"),
    [
        ("walk.glb", False),
        ("walk.glb --tolerance 2mm --output small b.GLTF avatar.vrm --shared wave.vrma", False),
        ("--json walk.glb walk.glb", False),
        ("walk.glb shot.blend", True),
        ("walk.glb --shared hand.csv", False),
        ("hand.csv --tolerance 2mm", False),
        ("hand.csv --blend", True),
        ("hand.csv --glb", True),
        ("walk.glb --shared hand.csv:left", True),
        ("walk.glb gone.fbx", True),
        ("walk.glb --blend", True),
        ("folder empty", False),
        ("folder --glb --output gone", False),
        ("shots", True),
        ("", True),
    ],
)
def test_gltf_files_and_tables_are_reduced_without_a_blender(installed, monkeypatch, tmp_path, arguments, is_needed):
    monkeypatch.chdir(tmp_path)
    for name in ("small", "empty", "folder", "shots/b"):
        (tmp_path / name).mkdir(parents=True)
    files = "walk.glb wave.vrma hand.csv folder/Walk.GLB folder/a.png shots/a.glb shots/b/c.fbx"
    for name in files.split():
        (tmp_path / name).touch()
    assert bootstrap.main(["reduce", *arguments.split()]) == 0
    assert [blender is not None for blender in installed] == [is_needed]
    assert bootstrap.GLTF == ENDINGS
    assert (*TEXT, *JSON) == bootstrap.TABLES
    assert {*IN_FOLDERS} <= {*bootstrap.GLTF, *bootstrap.TABLES, *bootstrap.IN_BLENDER}


@pytest.mark.parametrize("kind", ["", "ImportError: "])
def test_a_missing_system_library_is_named_with_the_packages_to_install(kind):
    said = way_out(f"{kind}libXi.so.6: cannot open shared object file: No such file or directory")
    assert "the system library libXi.so.6," in said
    assert f"apt-get install -y {DEBIAN}" in said
    assert DEBIAN in (ROOT / "README.md").read_text(encoding="utf-8")
