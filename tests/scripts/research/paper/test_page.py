"""The page says what is in the files, and chooses its words by it."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from research.paper import claims, table, triangle, wording
from research.paper.bandwidths import Bandwidth
from research.paper.bows import Bow
from research.paper.catching import View
from research.paper.motions import ASSETS, RECORDINGS, Motion
from research.paper.page import write_page
from research.paper.results import Results
from research.paper.strips import Instant
from research.paper.table import ADAPTIVE, UNIFORM, LookAhead, Needed
from research.paper.timing import ALGEBRA, AS_GOOD, EQUAL, FAST, PAPER, SINGLE, Timing
from rigid_motion_batch.rows import write_rows

MODES = ("lerp_slerp", "dq_sclerp", "pga_lerp", "motor_spline")


def needed(clips: str, mode: str, share: float, decimation: str = UNIFORM) -> list[Needed]:
    return [
        Needed(
            clips, row.state_of_the_art, mode, decimation, yardstick, share * row.state_of_the_art, 1.0 - share, 1, 1
        )
        for row in claims.TABLE
        for yardstick in table.YARDSTICKS
    ]


SHARES = {"lerp_slerp": 1.0, "dq_sclerp": 0.8765, "pga_lerp": 0.8765, "motor_spline": 0.4}

FILES = {
    "clips.csv": (
        Motion,
        [
            Motion("hand", "hand.csv", RECORDINGS, 901, 10.0, 90.0, 0.3),
            Motion("pivot", "pivot.csv", ASSETS, 424, 4.8, 90.0, 0.1),
            Motion("rest", "rest.csv", RECORDINGS, 200, 3.0, 60.0, 0.003, "at rest: it stays within 3.1 mm"),
        ],
    ),
    "table.csv": (
        Needed,
        [
            *(cell for mode, share in SHARES.items() for cell in needed(RECORDINGS, mode, share)),
            *needed(RECORDINGS, "motor_spline", 0.3, ADAPTIVE),
            *(cell for mode, share in SHARES.items() for cell in needed("hand", mode, share)),
        ],
    ),
    "look_ahead.csv": (LookAhead, [LookAhead(RECORDINGS, 30, "motor_spline", 1, 1, 0.1234)]),
    "bows.csv": (Bow, [Bow("hand", 5, 0.321, 1.0, 1.456), Bow("pivot", 5, 0.987, 0.3, 0.654)]),
    "timing.csv": (
        Timing,
        [
            Timing(reading, pace, mode, updates, rate, relative, relative - 0.05, relative + 0.05, 6e-8, 6.1e-8)
            for rate in (30.0, 20.0, 15.0, 12.0)
            for reading, pace in ((FAST, EQUAL), (FAST, AS_GOOD), (FAST, PAPER), (ALGEBRA, EQUAL), (SINGLE, EQUAL))
            for mode, updates, relative in (("lerp_slerp", 30.0, 1.0), ("pga_lerp", 23.0, 0.777))
        ],
    ),
    "bandwidth.csv": (
        Bandwidth,
        [
            Bandwidth("double", "7 doubles", 56, 0.0, 0.0, rate, count, count * 1.2)
            for rate, count in ((20, 1120.0), (30, 1680.0))
        ],
    ),
    "catching.csv": (
        View,
        [
            View(mode, rate, 0.1, 0.0123 / rate, 0.1, 0.0456 if mode == "lerp_slerp" else 0.0, 0.01, 0.0789)
            for mode in MODES
            for rate in (5, 10)
        ],
    ),
    "triangle.csv": (
        triangle.Step,
        [triangle.Step(0.5, 70.5, 75.5, 0.1987, 4.321), triangle.Step(0.9, 140.0, 135.0, 0.1, 3.0)],
    ),
    "strips.csv": (Instant, [Instant(mode, 0.5, 55.0, 0.0678) for mode in ("lerp_slerp", "dq_sclerp", "pga_lerp")]),
}

PICTURES = (
    *("paper/triangle.png", "paper/strips.png", "paper/engines.svg", "paper/shell_error.svg"),
    *("paper/catching.png", "paper/catching.mp4"),
)


def written(folder: Path, **changed: list) -> str:
    """The page of a folder with these files, some of them with other rows."""
    for name, (kind, rows) in FILES.items():
        write_rows(folder / name, kind, changed.get(name.partition(".")[0], rows))
    (folder / "run.json").write_text(json.dumps({"Blender": "9.9.9"}), encoding="utf-8")
    return write_page(Results.read(folder.joinpath, [*FILES, "run.json", *PICTURES]))


def test_numbers_of_the_files_are_on_the_page(tmp_path: Path):
    text = written(tmp_path)
    for number in (
        "26.3 (12%)",
        "12.0 (60%)",
        "123",
        "0.32; 1.46",
        "0.99; 0.65",
        "0.777, 0.727 to 0.827",
        "22.3% less",
    ):
        assert number in text
    for number in ("1120 n", "1680 n", "2.5; 45.6; 78.9", "199 mm", "4.3°", "68 mm", "9.9.9", "901 samples, 10 s"):
        assert number in text
    assert "`rest`, at rest: it stays within 3.1 mm" in text


def test_every_number_changes_with_its_file_and_with_no_other(tmp_path: Path):
    before = re.findall(r"\d+(?:\.\d+)?", written(tmp_path))
    for name, (_, rows) in FILES.items():
        stem = name.partition(".")[0]
        if stem == "clips":
            continue
        after = re.findall(r"\d+(?:\.\d+)?", written(tmp_path, **{stem: [half(row) for row in rows]}))
        assert after != before, name


def half(row):
    """The row with all its measured numbers halved."""
    return replace(row, **{name: value / 2.0 for name, value in vars(row).items() if isinstance(value, float)})


@pytest.mark.parametrize(
    ("share", "verdict"),
    [(0.3, "This reaches the paper's saving at every rate."), (0.95, "This reaches the paper's saving at no rate.")],
)
def test_the_verdict_is_that_of_the_numbers(tmp_path: Path, share: float, verdict: str):
    rows = [cell for mode in MODES for cell in needed(RECORDINGS, mode, share if mode == "dq_sclerp" else 1.0)]
    line = next(line for line in written(tmp_path, table=rows).splitlines() if line.startswith("- A screw"))
    assert verdict in line


def test_a_mode_that_needs_more_is_said_to_take_more(tmp_path: Path):
    rows = [cell for mode in MODES for cell in needed(RECORDINGS, mode, 1.1 if mode == "dq_sclerp" else 1.0)]
    text = written(tmp_path, table=rows)
    assert "33.0 (10% more)" in text
    assert "- A screw (`dq_sclerp`): 10, 10, 10 and 10 % more." in text
    assert not re.search(r"[-\N{MINUS SIGN}]\d+(\.\d+)? ?%", text)


def test_modes_with_the_same_cells_share_a_row(tmp_path: Path):
    assert "| `dq_sclerp` = `pga_lerp` |" in written(tmp_path)


def test_a_time_whose_interval_holds_one_may_be_chance(tmp_path: Path):
    _, rows = FILES["timing.csv"]
    assert "may be chance" not in written(tmp_path)
    assert "may be chance" in written(tmp_path, timing=[replace(row, high=1.2) for row in rows])


def test_the_gain_of_screws_in_a_hand_is_told_only_where_it_is_measured(tmp_path: Path):
    assert "(by up to 45.6 mm) it slips" in written(tmp_path)
    _, rows = FILES["catching.csv"]
    assert "it slips" not in written(tmp_path, catching=[replace(row, slip_m=0.0) for row in rows])


def test_bytes_that_are_not_those_of_the_paper_are_called_so(tmp_path: Path):
    assert "the same. A receiver also" in written(tmp_path)
    _, rows = FILES["bandwidth.csv"]
    assert "not the same. A receiver also" in written(
        tmp_path, bandwidth=[replace(row, bytes_per_s=1000.0) for row in rows]
    )


def test_energy_is_not_claimed(tmp_path: Path):
    assert "cannot be measured here" in written(tmp_path)


def test_a_page_of_a_run_in_which_nothing_could_be_measured_still_is_one():
    empty = Results({}, [], [], [], [], [], [], [], [], [], frozenset())
    assert write_page(empty).startswith("# The paper, reproduced")


def test_pictures_that_are_not_there_are_not_shown(tmp_path: Path):
    written(tmp_path)
    text = write_page(Results.read(tmp_path.joinpath, FILES))
    assert "![" not in text
    assert "catching.mp4" not in text
    assert "2.5; 45.6; 78.9" in text


def test_shares_in_a_sentence():
    assert wording.percents([0.333, 0.021, float("nan"), 0.0]) == "33, 2, - and 0 %"


@pytest.mark.parametrize(
    ("saved", "words"),
    [
        ([0.33, 0.0], "33 and 0 % less"),
        ([-0.267, 0.001], "27 and 0 % more"),
        ([0.02, -0.23, float("nan")], "2 % less, 23 % more and -"),
        ([-0.004], "0 % less"),
    ],
)
def test_what_is_not_saved_is_more(saved: list[float], words: str):
    assert wording.less(saved) == words
