"""Tests of compare.py on held bodies: the table, the terminal, the page, and pairs that the user names."""

from pathlib import Path

import pytest

from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.held import ChoiceSlips, PairSlips, slips
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.report.pages import write_overview
from rigid_motion_batch.report.settings import PageSettings
from tests.scripts.bvh_bodies import write_body
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.comparing import ROOT, rows_of, run, write_toss
from tests.scripts.report.runs import MODES, result_of
from tests.scripts.report.test_pages import Page, all_text

HOLD = ROOT / "assets" / "hold.csv"
FAST = ("--no-video", "--modes", "bezier,lerp_slerp,dq_sclerp", "--rates", "5,10")
COLUMNS = "clip_a,clip_b,mode,rate_hz,rms_slip_m,max_slip_m,recorded_slip_m,decimation,tolerance_m"


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("output")


@pytest.fixture(scope="module")
def rows(output: Path) -> list[dict[str, str]]:
    assert run(f"{HOLD}:*", *FAST, "--quiet", "--output", output) == 0
    return rows_of(output / "slip.csv")


def test_what_a_hand_holds_is_found_and_slips_by_curves_and_lines(rows: list[dict[str, str]]) -> None:
    assert ",".join(rows[0]) == COLUMNS
    assert [(row["clip_a"], row["clip_b"]) for row in rows] == [("hold-hand", "hold-tool")] * 6
    slip = {(row["rate_hz"], row["mode"]): float(row["max_slip_m"]) for row in rows}
    noise = {float(row["recorded_slip_m"]) for row in rows}
    assert max(noise) < 3e-3
    for rate in ("5", "10"):
        assert slip[rate, "dq_sclerp"] < max(noise)
        assert min(slip[rate, "bezier"], slip[rate, "lerp_slerp"]) > 10e-3
    assert slip["10", "bezier"] < slip["5", "bezier"]


def test_the_terminal_and_the_page_say_it(rows, output, capsys):
    assert run(f"{HOLD}:*", *FAST, "--output", output) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "holds" in line]
    assert line.startswith("hold-hand holds hold-tool, which slips up to ")
    for row in rows[:3]:
        assert f"{1e3 * float(row['max_slip_m']):.3g} mm by " in line
    assert "at 5 keys/s, and" in line
    page = all_text(Page(output / "report.html"))
    for row in rows:
        assert f"{1e3 * float(row['max_slip_m']):.3g} " in page
    assert "".join(line.split()) in "".join(page.split())
    assert "hold-tool in hold-hand: largest slip, mm" in page


def test_bodies_that_are_named_one_by_one_are_a_pair_in_that_order(tmp_path: Path) -> None:
    assert run(f"{HOLD}:tool", f"{HOLD}:hand", *FAST, "--quiet", "--output", tmp_path) == 0
    assert {(row["clip_a"], row["clip_b"]) for row in rows_of(tmp_path / "slip.csv")} == {("hold-tool", "hold-hand")}
    assert run(f"{HOLD}:tool", *FAST, "--quiet", "--output", tmp_path) == 0
    assert not (tmp_path / "slip.csv").exists()


def test_a_pair_that_is_named_is_measured_and_not_found_twice(tmp_path: Path) -> None:
    toss = write_toss(tmp_path / "toss.csv", 300)
    held = ["--held", "hold-hand", "hold-tool", "--held", "toss", "hold-hand"]
    assert run(f"{HOLD}:*", toss, *held, *FAST, "--quiet", "--output", tmp_path / "output") == 0
    found = rows_of(tmp_path / "output" / "slip.csv")
    assert [(row["clip_a"], row["clip_b"]) for row in found[::6]] == [("hold-tool", "hold-hand"), ("hold-hand", "toss")]
    assert float(found[6]["recorded_slip_m"]) > 0.1


@pytest.mark.parametrize(
    ("named", "said"),
    [
        (("hold-hand", "hold-tol"), "there is no clip 'hold-tol': did you mean hold-tool?"),
        (("hold-hand", "hold-hand"), "name two clips, the one that is held and the one that holds it"),
        (("hold-hand", "body"), "body is a whole body; name two rigid bodies"),
        (("hold-hand", "later"), "they share no times, later lasts from 50 to 5"),
    ],
)
def test_a_pair_that_is_none_is_refused(tmp_path, capsys, named, said):
    later, body = tmp_path / "later.csv", write_body(tmp_path / "body.bvh")
    later.write_text("t,x,y,z,qx,qy,qz,qw\n" + "".join(f"{50.0 + x},{x},0,0,0,0,0,1\n" for x in range(5)))
    assert run(f"{HOLD}:*", later, body, "--held", *named, *FAST, "--output", tmp_path / "output") == 2
    error = capsys.readouterr().err
    assert f"--held {' '.join(named)}: {said}" in " ".join(error.split())


def test_the_page_of_many_clips_has_the_pairs_and_says_nothing_where_there_are_none(tmp_path: Path) -> None:
    ten, clips = Uniform("10"), [swinging_clip(name) for name in ("one", "two")]
    found = slips(*(reconstruct(clip, ten, MODES, 0.1) for clip in clips))
    pairs = [PairSlips("one", "two", (ChoiceSlips(ten, found),))]
    for slipped in ([], pairs, 7 * pairs):
        page, results = tmp_path / "report.html", [result_of(clip, (ten,)) for clip in clips]
        write_overview(page, results, PageSettings(0.1, "Rigid Motion", "compare"), {}, slips=slipped)
        assert ("Held together" in all_text(Page(page))) == bool(slipped)
        assert all_text(Page(page)).count("two in one: largest slip, mm; in the recording itself 0") == len(slipped)
        assert all_text(Page(page)).count("one holds two") == min(len(slipped), 5) + bool(slipped)
        assert ("more pairs are in slip.csv." in all_text(Page(page))) == (len(slipped) == 7)
