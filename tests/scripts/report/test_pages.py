"""Tests of report pages: one file without requests, with all numbers even without scripts, safe with any name."""

import csv
import io
import json
import re
from base64 import b64decode
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.results import ClipResult
from rigid_motion_batch.recordings.clips import ClipWarning
from rigid_motion_batch.report import pages
from rigid_motion_batch.report.numbers import ERROR_AT, KEYS_AT, Gathering
from rigid_motion_batch.report.pages import write_overview, write_report
from rigid_motion_batch.report.settings import PageSettings
from rigid_motion_batch.report.tables import grids
from rigid_motion_batch.report.verdict import verdict
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.report.runs import MODES, result_of

SETTINGS = PageSettings(0.1, "Rigid Motion 1.0", "compare reach.csv")
TEN = (Uniform("10"),)


class Page(HTMLParser):
    """The content of a page: texts by the element around them, and the attributes of all elements."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.words = ""
        """All visible text, in order."""
        self._open = [""]
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        self.texts.setdefault(self._open[-1], []).append(data)
        if self._open[-1] not in ("script", "style"):
            self.words += f" {data}"

    def attributes(self, tag: str, name: str) -> list[str]:
        return [result[name] or "" for kind, result in self.elements if kind == tag and name in result]


def all_text(page: Page) -> str:
    return re.sub(r"\s+", " ", page.words)


def written(path: Path, *clips: ClipResult, **more: object) -> Page:
    write_report(path, clips, replace(SETTINGS, **more))
    return Page(path)


HOSTILE = "</script><script>alert(1)</script><!-- \"'& {{ 7 * 7 }}\u2028"


def test_no_name_gets_into_the_page_but_as_text(tmp_path: Path) -> None:
    clip = result_of(swinging_clip(), TEN, warnings=[ClipWarning(HOSTILE, HOSTILE, 101.0)])
    facts = replace(clip.facts, name=HOSTILE, source=HOSTILE, axes=HOSTILE, repairs=(HOSTILE,))
    body = result_of(swinging_body(), TEN)
    body = replace(body, facts=replace(body.facts, joint_names=(HOSTILE, *body.facts.joint_names[1:])))
    path = tmp_path / "report.html"
    page = written(path, replace(clip, facts=facts), body, program=HOSTILE, command=HOSTILE, details={HOSTILE: HOSTILE})
    assert all_text(page).count("alert(1)") >= 8
    assert "7 * 7" in all_text(page)
    assert not [text for text in page.texts["script"] if "alert(1)</script>" in text]
    types = [result.get("type") for tag, result in page.elements if tag == "script"]
    assert types == ["application/json"] * 3 + ["module"]
    (data, *_) = [json.loads(text) for text in page.texts["script"] if text.startswith('{"name"')]
    assert data["name"] == HOSTILE


def test_every_number_is_there_without_a_script(tmp_path: Path) -> None:
    clips = [result_of(swinging_clip("one")), result_of(swinging_clip("two", seed=2))]
    page = written(tmp_path / "report.html", *clips)
    cells = page.texts["td"] + page.texts["u"]
    for clip in clips:
        for result in clip.choices:
            for motion in result.motions:
                row = motion.metrics[0]
                for value in (1e3 * row.rms_shell_m, 1e3 * row.max_shell_m, row.rms_rotation_deg):
                    assert any(_has_value(text, value) for text in cells), value


def test_it_opens_with_what_the_verdict_speaks_of_and_says_what_the_errors_are(tmp_path: Path) -> None:
    clip, body = result_of(swinging_clip()), result_of(swinging_body(), TEN)
    page = written(tmp_path / "report.html", clip)
    gathering = Gathering()
    gathering.add("swing", [result.numbers for result in clip.choices])
    said = verdict(gathering.numbers())
    assert said.choice is not None
    (start,) = [json.loads(text)["start"] for text in page.texts["script"] if text.startswith('{"clips"')]
    assert start == {"clip": "swing", "choice": said.choice.name}
    assert "how far any point within 10 cm of the body's origin is out of place. RMS is" in all_text(page)
    assert "Straight is what most game engines do." in all_text(page)
    both = all_text(written(tmp_path / "both.html", clip, body))
    assert "10 cm of the body's origin or 3 cm of a joint is out of place" in both


def _has_value(text: str, value: float) -> bool:
    try:
        return abs(float(text) - value) <= 5e-3 * value
    except ValueError:
        return False


def test_the_table_to_take_along_is_that_of_all_modes(tmp_path: Path) -> None:
    clip = result_of(swinging_clip())
    page = written(tmp_path / "report.html", clip)
    (address,) = [attribute for attribute in page.attributes("a", "href") if attribute.startswith("data:text/csv")]
    rows = list(csv.DictReader(io.StringIO(b64decode(address.partition(",")[2]).decode())))
    assert {row["mode"] for row in rows} == set(MODES)
    assert len(rows) == len(MODES) * len(clip.choices)
    assert float(rows[0]["rms_shell_m"]) == clip.choices[0].motions[0].metrics[0].rms_shell_m


def test_a_warning_is_above_the_verdict_and_leads_to_its_moment(tmp_path: Path) -> None:
    warning = ClipWarning("A gap of 183 ms.", "Record again.", 101.25, 101.5)
    page = written(tmp_path / "report.html", result_of(swinging_clip(), TEN, warnings=[warning]))
    # The recording starts at 100 s, and so does the page's time.
    assert "#swing,10,1.250" in page.attributes("a", "href")
    text = all_text(page)
    assert (
        text.index("One thing to check before you trust this")
        < text.index("Record again.")
        < text.index("keys a second")
    )


def test_data_that_would_make_the_page_too_large_are_all_files_beside_it(tmp_path, monkeypatch):
    monkeypatch.setattr(pages, "IN_THE_PAGE", 150_000)
    written(tmp_path / "report.html", *(result_of(swinging_clip(name)) for name in "abc"))
    assert sorted(path.name for path in (tmp_path / "report_data").iterdir()) == ["1.js", "2.js", "3.js"]


def test_the_lowest_number_is_underlined_with_all_its_ties_but_not_where_all_are_the_same(tmp_path: Path) -> None:
    clip = result_of(swinging_clip(), TEN, ("bezier", "dq_sclerp", "pga_lerp"))
    (result,) = clip.choices
    errors = {"bezier": 0.0020001, "dq_sclerp": 0.0020002, "pga_lerp": 0.003}
    motions = tuple(
        replace(motion, metrics=tuple(replace(row, rms_shell_m=errors[row.mode]) for row in motion.metrics))
        for motion in result.motions
    )
    numbers = Gathering()
    numbers.add("clip", [replace(result, motions=motions).numbers])
    by_measure = {grid.column: [row.cells[0] for row in grid.rows] for grid in grids(numbers.numbers(), 0)}
    assert [cell.text for cell in by_measure[ERROR_AT]] == ["2.00", "2.00", "3.00"]
    assert [cell.best for cell in by_measure[ERROR_AT]] == [True, True, False]
    assert [cell.small for cell in by_measure[ERROR_AT]] == ["reference", "same", "+50\u00a0%"]
    assert not any(cell.best for cell in by_measure[KEYS_AT])


def test_a_picture_of_joints_has_a_row_for_each_and_the_worst_is_red() -> None:
    from rigid_motion_batch.report.tables import heat_map, png

    errors = np.zeros((3, 1000))
    errors[1, 500] = 7.0
    content = b64decode(heat_map(errors, 7.0).partition(",")[2])
    assert content.startswith(b"\x89PNG")
    assert int.from_bytes(content[16:20], "big") == 240
    assert int.from_bytes(content[20:24], "big") == 3
    assert content == png(np.pad(np.array([[0], [23], [0]], dtype=np.uint8), ((0, 0), (120, 119))), content[41:113])


@pytest.mark.parametrize("size", [1e30, 1e-30, 0.0])
def test_a_page_is_made_of_motions_of_any_size(tmp_path: Path, size: float) -> None:
    swing = swinging_clip()
    poses = Poses(size * swing.poses.positions, swing.poses.quaternions if size else np.eye(4)[[0] * len(swing.times)])
    page = written(tmp_path / "report.html", result_of(replace(swing, poses=poses)))
    assert "nan" not in all_text(page).lower().split()


def test_nothing_to_report_is_refused(tmp_path: Path) -> None:
    clip = replace(result_of(swinging_clip(), TEN), choices=())
    with pytest.raises(ValueError, match="every clip is too short for two keys"):
        write_report(tmp_path / "report.html", [clip], SETTINGS)
    assert not list(tmp_path.iterdir())


def test_the_overview_has_what_matters_first_and_leads_to_every_page(tmp_path: Path) -> None:
    quiet, loud = result_of(swinging_clip("quiet"), TEN), result_of(swinging_clip("loud"), TEN)
    rows = loud.choices[0].motions
    louder = tuple(replace(item, metrics=tuple(replace(row, max_shell_m=9.0) for row in item.metrics)) for item in rows)
    loud = replace(loud, choices=(replace(loud.choices[0], motions=louder),))
    doubtful = result_of(swinging_clip("doubtful", seed=3), TEN, warnings=[ClipWarning("Centimetres?", "Say so.")])
    addresses = {"quiet": "quiet/page 1.html", "loud": None, "doubtful": "doubtful/report.html"}
    write_overview(tmp_path / "report.html", [quiet, doubtful, loud], SETTINGS, addresses)
    page = Page(tmp_path / "report.html")
    text = all_text(page)
    table = text[text.index("Sorted by what matters") :]
    assert table.index("doubtful") < table.index("loud") < table.index("quiet")
    assert "1 of 3 clips have something to check" in text
    assert {"quiet/page%201.html", "doubtful/report.html"} <= set(page.attributes("a", "href"))
