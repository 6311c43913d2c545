"""Tests of the wheel that pip installs, in an environment without anything from the checkout."""

import os
import subprocess
import sys
import venv
import zipfile
from importlib.metadata import distribution
from pathlib import Path

import pytest

from rigid_motion_batch.cli.commands import COMMANDS
from rigid_motion_batch.places import CHECKOUT, manifest
from tests.gltf.making import walk
from tests.thoroughness import sample

pytestmark = [pytest.mark.blender, pytest.mark.any_blender]

BESIDES = (
    *("bpy", "filelock", "jinja2", "markdown-it-py", "markupsafe", "mdurl", "numpy", "pebble", "pygments", "rich"),
    "vl-convert-python",
)
"""Packages of the extra `blender` and dependencies, linked from the environment of these tests."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    options = ("--no-deps", "--no-build-isolation", "--disable-pip-version-check", "--wheel-dir", folder)
    done = run(sys.executable, "-m", "pip", "wheel", CHECKOUT, *options)
    assert done.returncode == 0, done.stderr
    (made,) = folder.glob("*.whl")
    return made


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command in an environment with the wheel, its dependencies, and Blender."""
    return command_of(tmp_path_factory.mktemp("environment"), wheel, BESIDES)


@pytest.fixture(scope="module")
def bare(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command in an environment with only the wheel and NumPy."""
    return command_of(tmp_path_factory.mktemp("bare"), wheel, ("numpy",))


def command_of(folder: Path, wheel: Path, besides: tuple[str, ...]) -> Path:
    """Return the command `rigid-motion` of a new environment in a folder, with these packages besides the wheel."""
    made = venv.EnvBuilder(with_pip=False).ensure_directories(folder)
    venv.create(folder, with_pip=False)
    to = Path(made.env_dir) / "lib" / f"python{sys.version_info.major}.{sys.version_info.minor}" / "site-packages"
    for name in besides:
        lend(name, to)
    options = ("--no-deps", "--no-index", "--disable-pip-version-check")
    done = run(sys.executable, "-m", "pip", "--python", made.env_exe, "install", *options, wheel)
    assert done.returncode == 0, done.stderr
    return Path(made.bin_path) / "rigid-motion"


def lend(name: str, to: Path) -> None:
    """Link a package and its metadata from the environment of these tests."""
    for part in {Path(file).parts[0] for file in distribution(name).files} - {"..", "__pycache__"}:
        (to / part).symlink_to(distribution(name).locate_file(part))


def run(*command: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    command = list(map(str, command))
    return subprocess.run(command, capture_output=True, text=True, timeout=300, cwd=cwd, env=environment)


def test_the_wheel_holds_two_packages_with_their_types_and_no_name_besides(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as opened:
        names = opened.namelist()
    assert {name.split("/")[0].removesuffix(f"-{manifest()['version']}.dist-info") for name in names} == {
        "rigid_motion",
        "rigid_motion_batch",
    }
    assert {"rigid_motion/py.typed", "rigid_motion_batch/py.typed", "rigid_motion/blender_manifest.toml"} <= {*names}
    assert "rigid_motion/streams/tables.json" in names
    modules = {
        f"{package.name}/{path.relative_to(package).as_posix()}"
        for package in (CHECKOUT / "addon" / "rigid_motion", CHECKOUT / "scripts" / "rigid_motion_batch")
        for path in package.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }
    assert modules <= {*names}


def test_the_main_job_runs_on_the_motions_that_come_along(installed: Path, tmp_path: Path) -> None:
    done = run(installed, "compare", "--no-video", "--rates", "5", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    report = Path(done.stdout.splitlines()[-1])
    assert report == tmp_path / "renders" / "comparison" / "report.html"
    assert "rigid-motion compare --no-video --rates 5" in report.read_text(encoding="utf-8")
    rows = (report.parent / "metrics.csv").read_text(encoding="utf-8").splitlines()
    clips = {path.stem for path in (CHECKOUT / "assets").glob("*.csv")} - {"hold"} | {"hold-hand", "hold-tool"}
    assert {row.split(",")[0] for row in rows[1:]} == clips


def test_the_zip_for_blender_is_the_same_as_from_the_checkout(installed, tmp_path, extension_zip):
    done = run(installed, "build", "--output", tmp_path)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.strip()).read_bytes() == extension_zip.read_bytes()


@pytest.mark.parametrize("command", sample(list(COMMANDS)))
def test_help_shows_every_command_as_it_is_typed(command: str, installed: Path) -> None:
    done = run(installed, command, "--help")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith(f"usage: rigid-motion {command}")
    assert "python scripts/" not in done.stdout


def test_a_command_that_there_is_not_is_said(installed: Path) -> None:
    done = run(installed, "compair")
    assert done.returncode == 2
    assert "'compair'" in done.stderr
    assert "compare" in done.stderr
    assert run(installed, "--version").stdout == f"rigid-motion {manifest()['version']}\n"


NEEDS_BLENDER = "this needs Blender, which `pip install 'rigid-motion[blender]'` brings, with Python 3.11 or 3.13"


def test_glb_files_are_reduced_and_looked_into_with_numpy_alone(bare: Path, tmp_path: Path) -> None:
    (tmp_path / "clips").mkdir()
    walk(joints=2, seconds=1.0).write(tmp_path / "clips" / "walk.glb")
    done = run(bare, "reduce", "clips", "--output", "small", "--tolerance", "2mm", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, f"{Path('small', 'walk-reduced.glb')}\n"), done.stderr
    done = run(bare, "inspect", "clips/walk.glb", "small/walk-reduced.glb", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("  body       walk") == 2


def test_without_blender_what_needs_it_is_one_line_and_all_else_is_done(bare: Path, tmp_path: Path) -> None:
    for command in ("bake", "reduce"):
        done = run(bare, command, "shot.blend", cwd=tmp_path)
        assert (done.returncode, done.stderr) == (2, f"rigid-motion {command}: {NEEDS_BLENDER}\n")
    (tmp_path / "clips").mkdir()
    walk(joints=2, seconds=1.0).write(tmp_path / "clips" / "walk.glb")
    (tmp_path / "clips" / "run.fbx").touch()
    done = run(bare, "reduce", "clips", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (1, f"{Path('clips', 'walk-reduced.glb')}\n")
    assert f"{Path('clips', 'run.fbx')}: {NEEDS_BLENDER}\n" in done.stderr


def test_what_a_comparison_draws_with_is_one_line_where_it_is_missing(
    bare: Path, wheel: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    missing = {"filelock": bare}
    missing["vl_convert"] = command_of(
        tmp_path_factory.mktemp("plain"), wheel, tuple({*BESIDES} - {"bpy", "vl-convert-python"})
    )
    for module, command in missing.items():
        done = run(command, "compare", "--no-video", cwd=tmp_path)
        said = f"this needs the module {module}, which `pip install 'rigid-motion[compare]'` brings"
        assert (done.returncode, done.stderr) == (2, f"rigid-motion compare: {said}\n")
