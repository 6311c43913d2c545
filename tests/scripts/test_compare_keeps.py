"""Tests that compare.py replaces only its own files: no inputs, no files of other programs, no other comparison."""

import contextlib
import shutil
from pathlib import Path

import pytest

from rigid_motion_batch import places
from rigid_motion_batch.cli import compare
from rigid_motion_batch.pipeline.steps import OWN_FOLDER
from tests.scripts.comparing import write_toss

OPTIONS = ("--no-video", "--rates", "5", "--modes", "lerp_slerp", "--jobs", "0")


def run(*arguments: object) -> int:
    return compare.main([*map(str, arguments), *OPTIONS])


def files(folder: Path) -> dict[str, bytes]:
    """Return all files except the program's own folder."""
    result = (path for path in folder.rglob("*") if path.is_file() and OWN_FOLDER not in path.parts)
    return {str(path.relative_to(folder)): path.read_bytes() for path in result}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a recording, and a comparison of it in `out`."""
    folder = tmp_path_factory.mktemp("made")
    write_toss(folder / "toss.csv")
    with contextlib.chdir(folder):
        assert run("toss.csv", "--output", "out") == 0
    return folder


@pytest.fixture
def folder(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the folder `made`."""
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def refused(capsys: pytest.CaptureFixture, *arguments: object) -> str:
    """Return the message of a run that writes nothing."""
    before = files(Path.cwd())
    capsys.readouterr()
    assert run(*arguments) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("compare.py: ")]
    assert len(said) == 1
    assert files(Path.cwd()) == before
    return said[0]


def test_without_its_own_folders_it_knows_no_file_for_its_own(folder: Path, capsys: pytest.CaptureFixture) -> None:
    shutil.rmtree(folder / "out" / OWN_FOLDER)
    said = refused(capsys, "toss.csv", "--output", "out")
    assert "lerp_slerp.csv" in said
    assert "were not written by this program" in said


def test_another_comparison_in_the_folder_is_named_with_the_ways_out(folder, capsys):
    write_toss(folder / "hand.csv", samples=70)
    said = refused(capsys, "hand.csv", "--output", "out")
    assert "out holds another comparison, of toss.csv; choose another folder, such as --output " in said
    assert run("hand.csv", "--output", "out", "--overwrite") == 0
    assert "hand" in (folder / "out" / "metrics.csv").read_text()
    assert "of hand.csv; choose another folder" in refused(capsys, "toss.csv", "--output", "out")


@pytest.mark.parametrize(
    "arguments",
    [
        ("toss.csv", "--rates", "10"),
        ("toss.csv", "--axes", "unity"),
        ("toss.csv", "hand.csv"),
        ("hand.csv", "toss.csv"),
        ("moved.csv",),
        ("./toss.csv",),
    ],
)
def test_the_same_recordings_and_more_of_them_go_on(folder: Path, arguments: tuple[str, ...]) -> None:
    write_toss(folder / "hand.csv", samples=70)
    shutil.copy(folder / "toss.csv", folder / "moved.csv")
    assert run(*arguments, "--output", "out") == 0


def printed(capsys: pytest.CaptureFixture, *arguments: object) -> str:
    """Return the name of the report's folder that a quiet run prints."""
    capsys.readouterr()
    assert run(*arguments, "--quiet") == 0
    (line,) = capsys.readouterr().out.splitlines()
    return Path(line).parent.name


def test_without_a_folder_every_comparison_has_one_of_its_own(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(places, "CHECKOUT", None)
    write_toss(tmp_path / "toss.csv")
    write_toss(tmp_path / "hand.csv", samples=70)
    write_toss(tmp_path / "other" / "toss.csv", samples=80)
    assert printed(capsys, "toss.csv") == "toss"
    assert printed(capsys, "hand.csv", "toss.csv") == "hand"
    assert printed(capsys, "other/toss.csv") == "toss-2"
    assert printed(capsys, "toss.csv") == "toss"
    (tmp_path / "renders" / "toss-3").mkdir()
    (tmp_path / "renders" / "toss-3" / "mine.txt").touch()
    write_toss(tmp_path / "third" / "toss.csv", samples=90)
    assert printed(capsys, "third/toss.csv") == "toss-4"
