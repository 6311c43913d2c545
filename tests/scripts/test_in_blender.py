"""compare.py in a Blender whose Python lacks its libraries: it runs in a Python that has them, or says how."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.cli import in_blender
from rigid_motion_batch.cli.in_blender import NoEnvironment, elsewhere

pytestmark = pytest.mark.blender

BLENDER = os.environ.get("BLENDER") or shutil.which("blender")

HERE = Path(sys.executable).parents[1]
"""An environment that has everything."""


@pytest.fixture
def lacking(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have this process be a Blender without libraries."""
    monkeypatch.setattr(in_blender, "find_spec", lambda name: None)
    monkeypatch.setattr(in_blender, "blender_program", lambda: "/opt/blender")


def test_a_python_that_has_the_libraries_does_the_work_itself() -> None:
    assert elsewhere("compare.py", ["hand.csv"]) is None


@pytest.mark.parametrize("given", [["--environment", str(HERE)], [f"--environment={HERE}"]])
def test_it_runs_in_the_environment_that_is_named_and_films_with_this_blender(lacking: None, given: list[str]) -> None:
    python = str(HERE / "bin" / "python")
    expected = [python, "compare.py", "hand.csv", "--no-video", "--blender", "/opt/blender"]
    assert elsewhere("compare.py", ["hand.csv", *given, "--no-video"]) == expected


def test_an_environment_of_the_checkout_is_found(lacking, tmp_path, monkeypatch):
    monkeypatch.setattr(in_blender, "CHECKOUT", tmp_path)
    (tmp_path / ".venv").mkdir()
    (tmp_path / ".venv" / "python-3.13").symlink_to(HERE)
    (tmp_path / ".venv" / "python-3.99" / "bin").mkdir(parents=True)
    command = elsewhere("compare.py", [])
    assert command[0] == str(tmp_path / ".venv" / "python-3.13" / "bin" / "python")


def test_an_environment_that_lacks_something_is_refused_with_the_way_out(lacking: None, tmp_path: Path) -> None:
    with pytest.raises(NoEnvironment, match=r"bootstrap.py environment .*empty"):
        elsewhere("compare.py", ["--environment", str(tmp_path / "empty")])
    with pytest.raises(NoEnvironment, match="needs a folder"):
        elsewhere("compare.py", ["--environment"])


def test_where_none_can_be_made_it_says_how(lacking: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(in_blender, "CHECKOUT", tmp_path)
    with pytest.raises(NoEnvironment, match="--environment DIR") as raised:
        elsewhere("compare.py", ["hand.csv"])
    assert "rich" in str(raised.value)


@pytest.mark.slow
@pytest.mark.skipif(not BLENDER, reason="starts a Blender: that of the variable BLENDER, or on the path")
def test_a_real_blender_compares(tmp_path: Path) -> None:
    """It writes numbers and a film, in the environment of these tests."""
    root = Path(__file__).resolve().parents[2]
    started = [BLENDER, "--background", "--python", root / "scripts" / "compare.py", "--"]
    asked = [
        root / "assets" / "throw.csv",
        "--rates",
        "5",
        "--resolution",
        "64x36",
        "--fps",
        "5",
        "-o",
        tmp_path / "out",
    ]
    done = subprocess.run([*started, *asked, "--environment", HERE], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert Path(done.stdout.splitlines()[-1]) == tmp_path / "out" / "report.html"
    assert list((tmp_path / "out").rglob("*.mp4"))
