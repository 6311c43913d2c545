"""reproduce_paper.py as people run it: what it writes, what it prints, how it ends, and that it goes on."""

from __future__ import annotations

import csv
import shutil
from pathlib import Path

import pytest

from research import reproduce_paper
from research.paper import sending, steps, table, timing
from research.paper.streaming import TWISTS
from research.study import Study
from rigid_motion.motion import MODES
from rigid_motion_batch.pipeline.store import Store

ASSETS = Path(__file__).resolve().parents[3] / "assets"

QUICK = ("--no-pictures", "--rounds", "2")

TIMED = {"timing.csv", "paper.md"}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A checkout with a second and a half of one clip, and the throw that the figures need."""
    folder = tmp_path_factory.mktemp("checkout")
    (folder / "assets").mkdir()
    lines = (ASSETS / "reach.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (folder / "assets" / "reach.csv").write_text("".join(lines[:1] + lines[60:200]), encoding="utf-8")
    shutil.copy(ASSETS / "throw.csv", folder / "assets")
    return folder


@pytest.fixture(autouse=True)
def small(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make_small(root, monkeypatch)


def make_small(root: Path, patch: pytest.MonkeyPatch) -> None:
    """Few clips, few rates, few frames."""
    patch.setattr(reproduce_paper, "ASSETS", root / "assets")
    patch.setattr(table, "STEP", 1.3)
    patch.setattr(table, "TOLERANCES", (0.5, 2.0, 2))
    patch.setattr(sending, "DELAYS", (2.0,))
    patch.setattr(sending, "MODES_SENT", (TWISTS,))
    patch.setattr(sending, "TOLERANCES", (1.0, 2.5))
    patch.setattr(timing, "USERS", 2)
    patch.setattr(timing, "SINGLES", 4)


@pytest.fixture(scope="module")
def done(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The output of a run."""
    output = tmp_path_factory.mktemp("output") / "paper"
    with pytest.MonkeyPatch.context() as patch:
        make_small(root, patch)
        assert reproduce_paper.main([*QUICK, "--output", str(output)]) == 0
    return output


def copy_of(done: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(done, tmp_path / "copy"))


def contents(folder: Path) -> dict[str, bytes]:
    """Name to content of all that does not depend on the clock."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name not in TIMED and ".rigid-motion" not in path.parts
    }


def test_the_table_has_every_mode_row_and_yardstick_of_every_clip(done: Path):
    with (done / "table.csv").open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    cells = {(row["clips"], row["updates"], row["mode"], row["yardstick"]) for row in rows}
    wanted = {
        (clips, updates, mode, yardstick)
        for clips in ("assets", "reach", "throw")
        for updates in ("30", "20", "15", "12")
        for mode in MODES
        for yardstick in table.YARDSTICKS
    }
    assert wanted <= cells


def test_the_page_is_written_and_its_path_is_the_last_line(done: Path, capfd: pytest.CaptureFixture[str]):
    assert reproduce_paper.main([*QUICK, "--output", str(done)]) == 0
    output = capfd.readouterr()
    assert output.out.splitlines()[-1] == str((done / "paper.md").resolve())
    assert "up to date" in output.err
    assert "1 failed" not in output.err


def test_a_second_run_leaves_everything_as_it_is(done: Path):
    before = {path: path.stat().st_mtime_ns for path in done.rglob("*.csv")}
    assert reproduce_paper.main([*QUICK, "--output", str(done)]) == 0
    assert {path: path.stat().st_mtime_ns for path in done.rglob("*.csv")} == before


def test_a_run_from_the_beginning_gives_the_same_numbers_timings_aside(done: Path, tmp_path: Path):
    assert reproduce_paper.main([*QUICK, "--output", str(tmp_path / "again")]) == 0
    again, before = contents(tmp_path / "again"), contents(done)
    assert again.keys() == before.keys()
    assert [name for name in before if again[name] != before[name]] == []


def test_what_is_missing_is_done_again_and_nothing_else(done: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    copy = copy_of(done, tmp_path)
    measured = (copy / "clips" / "reach" / "errors.csv").stat().st_mtime_ns
    (copy / "table.csv").unlink()
    (copy / "paper.md").write_text("torn", encoding="utf-8")
    assert reproduce_paper.main([*QUICK, "--output", str(copy)]) == 0
    assert "2 done" in capfd.readouterr().err
    assert contents(copy) == contents(done)
    assert (copy / "paper.md").read_text(encoding="utf-8") == (done / "paper.md").read_text(encoding="utf-8")
    assert (copy / "clips" / "reach" / "errors.csv").stat().st_mtime_ns == measured


def test_after_ctrl_c_the_same_call_goes_on(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    output = tmp_path / "stopped"

    def stop(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(steps.timing, "races", stop)
        assert reproduce_paper.main([*QUICK, "--output", str(output)]) == 130
    assert "goes on from here" in capfd.readouterr().err
    assert (output / "table.csv").is_file()
    assert not (output / "timing.csv").exists()
    assert reproduce_paper.main([*QUICK, "--output", str(output)]) == 0
    assert "up to date" in capfd.readouterr().err
    assert contents(output) == contents(done)


def test_a_step_that_fails_leaves_a_page_of_the_others_and_code_1(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    copy = tmp_path / "out"

    def fail(*_: object) -> None:
        raise RuntimeError("the drill is missing")

    monkeypatch.setattr(steps.catching, "views", fail)
    assert reproduce_paper.main([*QUICK, "--output", str(copy)]) == 1
    assert "the drill is missing" in capfd.readouterr().err
    text = (copy / "paper.md").read_text(encoding="utf-8")
    assert "## Catching a tool" not in text
    assert "## Table 1" in text


def test_the_page_can_be_copied_to_the_docs(done: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    docs = tmp_path / "docs"
    assert reproduce_paper.main([*QUICK, "--output", str(done), "--docs", str(docs)]) == 0
    assert (docs / "paper.md").read_bytes() == (done / "paper.md").read_bytes()
    assert (docs / "paper" / "engines.svg").is_file()
    assert sorted(path.name for path in docs.iterdir()) == ["paper", "paper.md"]
    assert capfd.readouterr().out.splitlines()[-1] == str((docs / "paper.md").resolve())


def test_pictures_and_film_are_in_the_plan_unless_they_are_not_wanted(root: Path, tmp_path: Path):
    def outputs(**options: bool) -> set[str]:
        assets = sorted((root / "assets").glob("*.csv"))
        with Store(tmp_path / "out") as store:
            study = Study(store)
            steps.plan(study, assets, [], rounds=2, **options)
        return {output for task in study.tasks.values() for output in task.publish if output.startswith("paper/")}

    drawings = {"paper/engines.svg", "paper/shell_error.svg"}
    assert outputs(rendered=False, film=True) == drawings
    stills = drawings | {"paper/triangle.png", "paper/strips.png", "paper/catching.png"}
    assert outputs(rendered=True, film=False) == stills
    assert outputs(rendered=True, film=True) == stills | {"paper/catching.mp4"}


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--recordings", "nowhere"], "no such folder"),
        (["--rounds", "1"], "give 2 to 10000"),
        (["--rounds", "many"], "give 2 to 10000"),
        (["--unknown"], "unrecognized arguments"),
    ],
)
def test_a_wrong_option_is_named_and_ends_with_code_2(
    arguments: list[str], said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    try:
        code = reproduce_paper.main([*arguments, "--no-pictures", "--output", str(tmp_path / "out")])
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    assert said in capfd.readouterr().err


def test_a_recording_that_cannot_be_read_does_not_stop_the_others(
    tmp_path: Path, root: Path, capfd: pytest.CaptureFixture[str]
):
    folder = tmp_path / "recordings"
    folder.mkdir()
    shutil.copy(root / "assets" / "reach.csv", folder / "reach.csv")
    (folder / "broken.csv").write_text("not a recording\n", encoding="utf-8")
    output = tmp_path / "out"
    assert reproduce_paper.main([*QUICK, "--recordings", str(folder), "--output", str(output)]) == 0
    assert "broken does not count" in capfd.readouterr().err
    text = (output / "paper.md").read_text(encoding="utf-8")
    assert "- Left out: `broken`" in text
    assert "- Recordings: `reach-2`" in text
    assert str(tmp_path) not in text


def test_the_section_on_streams_alone_is_written_and_put_into_a_page(tmp_path: Path, capfd: pytest.CaptureFixture[str]):
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "paper.md").write_text("# Paper\n\nWords.\n\n## Bytes\n\nb\n", encoding="utf-8")
    arguments = ["--only-sending", "--output", str(tmp_path / "out"), "--docs", str(tmp_path / "docs")]
    assert reproduce_paper.main(arguments) == 0
    page = (tmp_path / "docs" / "paper.md").read_text(encoding="utf-8")
    assert page.startswith("# Paper\n\nWords.\n\n## Sending when needed\n")
    assert page.endswith("\n\n## Bytes\n\nb\n")
    assert "**RMS shell error, assets**" in page
    assert capfd.readouterr().out.splitlines()[-1] == str((tmp_path / "docs" / "paper.md").resolve())
    written = {path.name for path in (tmp_path / "out").iterdir() if path.is_file()}
    assert written == {"sending.md", "sending.csv", "sent.csv"}
    assert reproduce_paper.main(arguments) == 0
    assert "up to date" in capfd.readouterr().err


def test_one_section_alone_is_enough(capsys: pytest.CaptureFixture[str]):
    with pytest.raises(SystemExit):
        reproduce_paper.main(["--only-sending", "--only-bodies"])
    assert "not allowed with argument" in capsys.readouterr().err
