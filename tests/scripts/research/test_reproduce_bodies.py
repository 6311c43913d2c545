"""reproduce_paper.py --bodies as people run it: what it studies, what it writes, and that a page around it stays."""

from __future__ import annotations

import csv
import json
import shutil
from pathlib import Path

import pytest

from research import reproduce_paper
from research.paper import bodies
from research.paper.bodies import FILES
from research.paper.bodies_section import HEADING
from research.paper.motions import recordings_in
from research.paper.steps import plan, plan_bodies
from research.study import Study
from rigid_motion_batch.pipeline.store import Store
from tests.recordings import RECORDINGS
from tests.scripts.bvh_bodies import write_body

PAGE = "# Paper\n\nWords.\n\n## Running time\n\nns\n"


@pytest.fixture(autouse=True)
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bodies, "SEARCHED", 1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("rigs")
    write_body(folder / "walk.bvh")
    write_body(folder / "statue.bvh", moves=False)
    (folder / "torn | `page`.bvh").write_text("HIERARCHY\n", encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def done(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    output = tmp_path_factory.mktemp("output") / "paper"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bodies, "SEARCHED", 1.0)
        assert reproduce_paper.main(["--bodies", str(folder), "--only-bodies", "--output", str(output)]) == 0
    return output


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def test_the_section_alone_is_written_with_its_files_and_nothing_else(done: Path) -> None:
    assert {path.name for path in done.iterdir() if path.is_file()} == {"bodies.md", *FILES}
    text = (done / "bodies.md").read_text(encoding="utf-8")
    assert text.startswith(f"{HEADING}\n")
    assert "- Bodies: `walk` (3 joints, 2.0 s of 30 samples a second)." in text
    assert "Taken for hands, feet and heads by their names: `LeftHand` and `Head` (`walk`)." in text
    assert "of the first 1 s of `walk`" in text
    assert str(done) not in text


def test_a_body_that_does_not_count_is_named_with_the_reason_and_without_its_folder(done: Path, folder: Path) -> None:
    text = (done / "bodies.md").read_text(encoding="utf-8")
    left_out = [line for line in text.splitlines() if line.startswith("- Left out:")]
    assert "- Left out: `statue`, at rest: none of its joints moves." in left_out
    assert len(left_out) == 2
    assert str(folder) not in text


def test_every_mode_and_rate_of_the_body_is_in_the_table(done: Path) -> None:
    found = {(row["of"], row["mode"], row["rate"]) for row in rows(done / "bodies_needed.csv")}
    wanted = {
        (of, mode, rate)
        for of in ("body", "hands", "heads")
        for mode in bodies.MODES
        for rate in ("15", "12", "8", "5")
    }
    assert found == wanted


def test_a_second_run_leaves_everything_as_it_is(done: Path, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    before = {path: path.stat().st_mtime_ns for path in [*done.rglob("*.csv"), done / "bodies.md"]}
    assert reproduce_paper.main(["--bodies", str(folder), "--only-bodies", "--output", str(done)]) == 0
    captured = capfd.readouterr()
    assert captured.out.splitlines()[-1] == str((done / "bodies.md").resolve())
    assert {path: path.stat().st_mtime_ns for path in before} == before


def test_in_a_page_the_section_is_put_and_the_rest_stays(done: Path, folder: Path, tmp_path: Path) -> None:
    (tmp_path / "paper.md").write_text(PAGE, encoding="utf-8")
    call = ["--bodies", str(folder), "--only-bodies", "--output", str(done), "--docs", str(tmp_path)]
    for _ in range(2):
        assert reproduce_paper.main(call) == 0
        text = (tmp_path / "paper.md").read_text(encoding="utf-8")
        section = (done / "bodies.md").read_text(encoding="utf-8")
        assert text == PAGE.replace("## Running", f"{section}\n## Running")
    assert [path.name for path in tmp_path.iterdir()] == ["paper.md"]


def test_without_a_page_there_is_nowhere_to_put_it(
    folder: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    call = ["--bodies", str(folder), "--only-bodies", "--output", str(tmp_path / "out"), "--docs", str(tmp_path)]
    assert reproduce_paper.main(call) == 2
    assert "there is no page to put the section into" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--only-bodies"], "there is no whole body to study"),
        (["--only-bodies", "--bodies", "nowhere"], "nowhere: no such file or folder"),
    ],
)
def test_missing_bodies_are_told_in_one_line(
    arguments: list[str], said: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    assert reproduce_paper.main([*arguments, "--output", str(tmp_path / "out")]) == 2
    error = capfd.readouterr().err
    assert said in error
    assert len(error.strip().splitlines()) == 1


def test_recordings_that_may_hold_a_body_are_studied_as_such_and_others_are_not_spoken_of(
    folder: Path, tmp_path: Path
) -> None:
    recordings = tmp_path / "recordings"
    recordings.mkdir()
    shutil.copy(folder / "walk.bvh", recordings)
    shutil.copy(folder / "statue.bvh", recordings)
    (recordings / "hand.csv").write_text("t,x,y,z,qx,qy,qz,qw\n", encoding="utf-8")
    output = tmp_path / "out"
    assert reproduce_paper.main(["--recordings", str(recordings), "--only-bodies", "--output", str(output)]) == 0
    text = (output / "bodies.md").read_text(encoding="utf-8")
    assert "- Bodies: `walk`" in text
    assert "Left out" not in text
    assert not (output / "bodies" / "hand").exists()


def test_the_whole_plan_has_the_study_before_the_page(folder: Path, tmp_path: Path) -> None:
    assets = sorted((Path(__file__).resolve().parents[3] / "assets").glob("*.csv"))
    with Store(tmp_path / "out") as store:
        study, without = Study(store), Study(store)
        plan(study, assets, [], [folder / "walk.bvh"], rendered=False, film=False, rounds=2)
        plan(without, assets, [], rendered=False, film=False, rounds=2)
    assert {"errors of walk", "key poses of walk", "bodies"} <= set(study.tasks)
    page = study.tasks["page"]
    assert page.step.partial
    assert "bodies" in page.parameters.after
    assert json.loads(page.parameters.arguments)["files"]["bodies"] == [*FILES]
    assert "bodies" not in without.tasks


def test_a_body_that_is_given_twice_is_studied_once(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    with Store(tmp_path / "out") as store:
        study = Study(store)
        plan_bodies(study, [folder / "walk.bvh"], [Path("walk.bvh")])
    assert [*study.tasks] == ["errors of walk", "key poses of walk", "bodies", "section"]
    assert json.loads(study.tasks["bodies"].parameters.arguments)["asked"] == ["walk"]


@pytest.mark.recordings
def test_of_other_peoples_bodies_hands_feet_and_heads_are_found() -> None:
    rigs = RECORDINGS.parent / "rigs"
    if not rigs.is_dir():
        pytest.skip("the rigs are not beside the checkout")
    files = [*recordings_in(RECORDINGS), *bodies.body_files([rigs])]
    found = {}
    for path in files:
        if bodies.may_hold_a_body(path):
            _, clip = bodies.read_body(str(path), path.stem)
            found[path.stem] = [limb.limb for limb in bodies.limbs_of(clip)]
    assert found == dict.fromkeys(
        ("beat_saber_body", "cmu_01_01", "freebvh", "pab_run", "pab_walk"), ["hands"] * 2 + ["feet"] * 2 + ["heads"]
    )
