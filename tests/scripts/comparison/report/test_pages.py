from __future__ import annotations

import base64
import hashlib
import html
import re
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import replace
from datetime import datetime
from functools import partial
from html.parser import HTMLParser
from itertools import groupby
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import measure_reconstruction
from rigid_motion_batch.analysis.modes import BEST_OF, label_of
from rigid_motion_batch.analysis.needed import KeysNeeded, OfRigidBody, keys_needed
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.comparison.report.charts import GRID_X, GRID_Y
from rigid_motion_batch.comparison.report.clip_section import COLUMNS
from rigid_motion_batch.comparison.report.error_charts import errors_over_time
from rigid_motion_batch.comparison.report.pages import Settings, write_clip_page, write_overview, write_report
from rigid_motion_batch.comparison.results import ClipFacts, ClipResults, Result
from rigid_motion_batch.palette import colour_of
from tests.scripts.comparison.recordings import reconstruct, swinging_clip

VOID = {"meta", "link", "br", "img", "input", "hr", "source"}
SETTINGS = Settings(
    radius=0.1,
    program="Rigid Motion 0.1.0",
    blender="5.2.3",
    command="python scripts/compare.py swing.csv",
    date=datetime(2024, 2, 29, 12, 30),
    details={"Engine": "workbench"},
)


class Page(HTMLParser):
    """A page as elements with their text. Reading it fails where tags are not balanced."""

    def __init__(self, path: Path) -> None:
        super().__init__(convert_charrefs=True)
        self.source = path.read_text(encoding="utf-8")
        self.elements: list[tuple[str, dict[str, str], list[str]]] = []
        self.open: list[tuple[str, dict[str, str], list[str]]] = []
        self.feed(self.source)
        self.close()
        assert not self.open, f"never closed: {[name for name, *_ in self.open]}"

    def handle_starttag(self, name: str, attributes: list[tuple[str, str | None]]) -> None:
        element = (name, {key: value or "" for key, value in attributes}, [])
        self.elements.append(element)
        if name not in VOID:
            self.open.append(element)

    def handle_endtag(self, name: str) -> None:
        assert self.open[-1][0] == name, f"</{name}> closes <{self.open[-1][0]}> in line {self.getpos()[0]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        for _, _, text in self.open:
            text.append(data)

    def find(self, name: str, **attributes: str) -> Iterator[tuple[dict[str, str], str]]:
        for element, own, text in self.elements:
            if element == name and all(
                own.get(key.rstrip("_").replace("_", "-")) == value for key, value in attributes.items()
            ):
                yield own, "".join(text)


def assert_links_lead_somewhere(page: Page) -> list[str]:
    ids = [own["id"] for _, own, _ in page.elements if "id" in own]
    assert len(ids) == len(set(ids))
    links = [own["href"] for own, _ in page.find("a")]
    assert {link[1:] for link in links if link.startswith("#")} <= set(ids)
    return links


def results_of(runs: list[Reconstruction], needed: Sequence[KeysNeeded] = ()) -> list[ClipResults]:
    """The results of some clips, of which those of one follow one another."""
    of_clip = {one.clip: one for one in needed}
    return [
        ClipResults(
            ClipFacts.of(clip),
            tuple(Result.of(run, partial(errors_over_time, run)) for run in some),
            of_clip.get(clip.name),
        )
        for clip, some in groupby(runs, key=lambda run: run.clip)
    ]


def report(folder: Path, runs: list[Reconstruction], films: dict[tuple[str, str], Path] | None = None) -> Page:
    write_report(folder / "report.html", results_of(runs), films=films or {}, settings=SETTINGS)
    return Page(folder / "report.html")


@pytest.fixture(scope="module")
def runs() -> list[Reconstruction]:
    clips = [swinging_clip("reach", seed=1, repairs=("dropped 3 rows",)), swinging_clip("throw", seed=2)]
    return [reconstruct(clip, rate) for clip in clips for rate in ("5", "7.5", "20")]


@pytest.fixture(scope="module")
def page(runs: list[Reconstruction], tmp_path_factory: pytest.TempPathFactory) -> Page:
    return report(tmp_path_factory.mktemp("report"), runs)


def test_every_clip_rate_and_mode_has_its_place(page: Page) -> None:
    headings = [text for _, text in page.find("h2")]
    assert headings == ["Summary", "Modes and measures", "reach", "throw", "This run"]
    assert [text for _, text in page.find("h3") if "keys/s" in text] == ["5 keys/s", "7.5 keys/s", "20 keys/s"] * 2
    for mode in KEYFRAME_MODES.values():
        assert mode.description in html.unescape(page.source)
        assert sum(text == mode.label for _, text in page.find("th", scope="row")) == 7


def test_ids_are_unique_and_every_link_within_the_page_leads_somewhere(page: Page) -> None:
    links = assert_links_lead_somewhere(page)
    assert "#clip-2-rate-3" in links


def test_the_numbers_in_the_tables_are_those_of_the_metrics(page: Page, runs: list[Reconstruction]) -> None:
    shown = [float(own["data-value"]) for own, _ in page.find("td")]
    summary = 3 * len(KEYFRAME_MODES)
    rows = [row for run in runs for row in measure_reconstruction(run)]
    assert shown[summary:] == [getattr(row, column.metric) for row in rows for column in COLUMNS]


def test_the_numbers_that_are_read_are_those_that_are_sorted_by_to_three_digits(page: Page) -> None:
    cells = list(page.find("td"))[3 * len(KEYFRAME_MODES) :]
    for place, (own, text) in enumerate(cells):
        value = float(own["data-value"]) * COLUMNS[place % len(COLUMNS)].factor
        assert float(text.removesuffix(" best")) == pytest.approx(value, rel=0.006)


def test_the_best_of_each_column_is_marked_and_all_of_them_where_modes_are_identical(
    tmp_path: Path, runs: list[Reconstruction]
) -> None:
    page = report(tmp_path, runs[:1])
    cells = list(page.find("td"))[len(KEYFRAME_MODES) :]
    for column in range(len(COLUMNS)):
        values = [float(own["data-value"]) for own, _ in cells[column :: len(COLUMNS)]]
        marked = [own.get("class") == "best" for own, _ in cells[column :: len(COLUMNS)]]
        assert marked == [value <= min(values) * 1.00001 for value in values]


def test_the_relative_errors_are_geometric_means_over_the_clips(page: Page, runs: list[Reconstruction]) -> None:
    cells = [float(own["data-value"]) for own, _ in page.find("td")][: 3 * len(KEYFRAME_MODES)]
    shell = np.array([[row.rms_shell_m for row in measure_reconstruction(run)] for run in runs]).reshape(2, 3, -1)
    expected = np.exp(np.log(shell / shell[..., :1]).mean(axis=0)).T
    np.testing.assert_allclose(np.reshape(cells, (-1, 3)), expected, rtol=1e-9)


def test_identical_modes_share_a_line_and_the_line_bears_all_their_names(page: Page) -> None:
    titles = [text for _, text in page.find("title")]
    joint = " = ".join(KEYFRAME_MODES[mode].label for mode in ("dq_sclerp", "pga_slerp", "cga_slerp"))
    curves = list(page.find("path", class_="curve"))
    assert joint in titles
    assert len(curves) % 4 == 0
    assert KEYFRAME_MODES["pga_slerp"].label not in titles


def test_repairs_are_listed_and_their_absence_is_stated(page: Page) -> None:
    assert [text for _, text in page.find("div", class_="repairs")] == [
        "Repaired in the recordingdropped 3 rows",
        "Repaired in the recordingNothing.",
    ]


def test_the_settings_of_the_run_are_told(page: Page) -> None:
    facts = " ".join(text for _, text in page.find("dl", class_="facts"))
    for word in ("Rigid Motion 0.1.0", "5.2.3", "5, 7.5 and 20 keys/s", "0.1 m", "workbench", SETTINGS.command):
        assert word in facts
    assert ("2024-02-29T12:30", "29 February 2024, 12:30") in [
        (own["datetime"], text) for own, text in page.find("time")
    ]


def test_the_page_asks_for_nothing_from_anywhere(page: Page) -> None:
    for name, own, _ in page.elements:
        assert not {"src", "srcset", "poster", "action"} & own.keys()
        assert name not in {"link", "iframe", "img", "object", "embed"}
        assert own.get("href", "#").startswith("#")
    style = next(text for _, text in page.find("style"))
    assert "@import" not in style
    assert "url(" not in style


def test_the_policy_allows_the_pages_own_script_and_no_request(page: Page) -> None:
    ((policy, _),) = page.find("meta", http_equiv="Content-Security-Policy")
    ((_, script),) = ((own, text) for own, text in page.find("script") if "type" not in own)
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    assert f"script-src 'sha256-{digest}'" in policy["content"]
    assert policy["content"].startswith("default-src 'none';")
    assert "media-src blob:;" in policy["content"]
    assert "http" not in policy["content"]


def test_names_are_data_whatever_they_hold(tmp_path: Path) -> None:
    name = '<script>alert(1)</script>"&$style'
    page = report(tmp_path, [reconstruct(swinging_clip(name, repairs=("<img src=x onerror=alert(2)>",)))])
    assert name in [text for _, text in page.find("h2")]
    assert len(list(page.find("script"))) == 1
    assert not list(page.find("img"))


def test_a_name_that_is_no_text_does_not_stop_the_report(tmp_path: Path) -> None:
    name = b"clip\xff".decode("utf-8", "surrogateescape")
    assert "clip\ufffd" in [text for _, text in report(tmp_path, [reconstruct(swinging_clip(name))]).find("h2")]


def test_a_video_is_in_the_page_byte_for_byte_with_a_link_to_its_file(
    tmp_path: Path, runs: list[Reconstruction]
) -> None:
    film = tmp_path / "re ach#1" / "5" / "comparison.mp4"
    film.parent.mkdir(parents=True)
    film.write_bytes(np.random.default_rng(3).bytes(1_000_001))
    page = report(tmp_path, runs, {("reach", "5"): film})
    ((place, _),) = ((own, text) for own, text in page.find("div", class_="film"))
    ((_, encoded),) = page.find("script", id=place["data-film"])
    assert base64.b64decode(encoded, validate=True) == film.read_bytes()
    assert "re%20ach%231/5/comparison.mp4" in [own["href"] for own, _ in page.find("a")]


def test_a_rate_without_its_video_says_so_where_others_have_theirs(tmp_path: Path, runs: list[Reconstruction]) -> None:
    film = tmp_path / "comparison.mp4"
    film.write_bytes(b"film")
    page = report(tmp_path, runs, {("reach", "5"): film, ("reach", "20"): None})
    assert page.source.count("The video could not be made.") == 1
    assert len(list(page.find("script", type="text/plain"))) == 1


def test_a_video_that_is_being_rendered_is_looked_for_where_it_will_be(
    tmp_path: Path, runs: list[Reconstruction]
) -> None:
    page = report(tmp_path, runs, {("reach", "5"): tmp_path / "re ach#1" / "5" / "comparison.mp4"})
    ((place, text),) = page.find("div", class_="film coming")
    assert place["data-coming"] == "re%20ach%231/5/comparison.mp4"
    assert "being rendered" in text
    assert "media-src blob: 'self' file:;" in page.source
    assert not list(page.find("script", type="text/plain"))


def test_a_run_without_videos_does_not_speak_of_them(page: Page) -> None:
    assert "The video" not in page.source
    assert not list(page.find("script", type="text/plain"))
    assert not list(page.find("div", class_="film"))


def test_a_single_clip_at_a_single_rate_under_a_single_mode_is_a_report_too(tmp_path: Path) -> None:
    page = report(tmp_path, [reconstruct(swinging_clip(seconds=0.4), "5", ("pga_lerp",))])
    lead = next(text for _, text in page.find("p", class_="lead"))
    assert lead.startswith("One recorded clip was reduced to 5 keys a second. Then one mode of interpolation")
    assert "Error over rate" not in page.source


def test_a_recording_of_which_every_sample_is_a_key_is_a_report_too(tmp_path: Path) -> None:
    page = report(tmp_path, [reconstruct(swinging_clip(), "500")])
    assert "no mode was off by more than rounding" in page.source


def test_a_long_clip_does_not_make_a_large_page(tmp_path: Path) -> None:
    clip = swinging_clip(seconds=600.0)
    report(tmp_path, [reconstruct(clip, rate) for rate in ("5", "20")])
    assert (tmp_path / "report.html").stat().st_size < 400_000


def test_nothing_to_report_is_said_and_nothing_is_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no reconstruction to report"):
        report(tmp_path, [])
    assert not list(tmp_path.iterdir())


def test_charts_describe_their_axes_in_plain_numbers(page: Page) -> None:
    charts = list(page.find("svg", class_="chart"))
    assert charts
    for own, _ in charts:
        for axis in (own["data-x"], own["data-y"]):
            assert re.fullmatch(r"[-+\d.e]+ [-+\d.e]+ (log|linear) .*", axis)


@pytest.fixture(scope="module")
def adaptive(runs: list[Reconstruction], tmp_path_factory: pytest.TempPathFactory) -> tuple[Page, list[KeysNeeded]]:
    """The report of a run with evenly spaced and adaptive keys."""
    clips = [runs[0].clip, runs[3].clip]
    choices = (Uniform("10"), Tolerance("5mm"), Tolerance("2cm"))
    made = [choose(clip, choice, KEYFRAME_MODES, 0.1) for clip in clips for choice in choices]
    needed = [keys_needed(OfRigidBody(clip, 0.1), KEYFRAME_MODES) for clip in clips]
    path = tmp_path_factory.mktemp("adaptive") / "report.html"
    write_report(path, results_of(made, needed), films={}, settings=SETTINGS)
    return Page(path), needed


def table_of(page: Page, caption: str) -> list[list[str]]:
    """The cells, row by row, of the table with this caption."""
    start = next(place for place, (name, _, text) in enumerate(page.elements) if (name, *text) == ("caption", caption))
    rows: list[list[str]] = []
    for name, own, text in page.elements[start + 1 :]:
        if name == "caption":
            break
        if name == "tr":
            rows.append([])
        if name == "td" or (name == "th" and own.get("scope") == "row"):
            rows[-1].append("".join(text).replace("\u00a0", " ").removesuffix(" best"))
    return [row for row in rows if row]


def test_the_table_of_keys_has_a_number_and_a_share_for_every_motion(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, needed = adaptive
    for clip in needed:
        rows = table_of(page, f"{clip.clip}: keys needed to be as good as Vector + Quaternion")
        assert [(row[0], row[1]) for row in rows] == [
            (" = ".join(KEYFRAME_MODES[mode].label for mode in group), keys)
            for group in clip.groups
            for keys in ("evenly spaced", "adaptive")
        ]
        for place, row in enumerate(rows):
            shares = clip.shares[place // 2, place % 2, :4] * 100.0
            counts = clip.keys[place // 2, place % 2, :4]
            assert row[2:] == [f"{count:.0f}{share:.0f} %" for count, share in zip(counts, shares, strict=True)]


def test_over_all_clips_the_table_of_keys_has_geometric_means(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, needed = adaptive
    rows = table_of(page, "Keys a second needed to be as good as Vector + Quaternion")
    for place, row in enumerate(rows):
        shares = np.sqrt(np.prod([clip.shares[place // 2, place % 2, :4] for clip in needed], axis=0))
        rates = np.sqrt(np.prod([clip.keys_per_s[place // 2, place % 2, :4] for clip in needed], axis=0))
        for cell, share, rate in zip(row[2:], shares, rates, strict=True):
            number, percent = cell.split("/s")
            assert float(number) == pytest.approx(rate, rel=0.006)
            assert percent == f"{share * 100.0:.0f} %"


def test_the_mode_that_did_with_the_fewest_keys_is_named(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, needed = adaptive
    shares = np.sqrt(np.prod([clip.shares[:, :, :4] for clip in needed], axis=0))
    sentences = [text.replace("\u00a0", " ") for _, text in page.find("li") if "was as good as" in text]
    assert len(sentences) == 2
    for sentence, decimation, keys in zip(sentences, (1, 0), ("adaptive", "evenly spaced"), strict=True):
        best = needed[0].groups[int(np.prod(shares[:, decimation], axis=-1).argmin())]
        first, second, third, last = (
            f"{share * 100.0:.0f} %" for share in shares[needed[0].groups.index(best), decimation]
        )
        assert sentence == (
            f"{KEYFRAME_MODES[best[0]].label} with {keys} keys was as good as Vector + Quaternion at 30, 20, 15 and 12 "
            f"keys/s with {first}, {second}, {third} and {last} of the keys."
        )


def test_a_cell_says_where_an_error_is_not_reached_or_there_is_none(tmp_path: Path, runs: list[Reconstruction]) -> None:
    whole = keys_needed(OfRigidBody(runs[0].clip, 0.1), ("lerp_slerp", "motor_spline"))
    keys = whole.keys.copy()
    keys[1, 0, 0], keys[:, :, 1] = np.inf, np.nan
    one = results_of(runs[:1], [replace(whole, keys=keys)])
    write_report(tmp_path / "one.html", one, films={}, settings=SETTINGS)
    rows = table_of(Page(tmp_path / "one.html"), "reach: keys needed to be as good as Vector + Quaternion")
    assert rows[2][2:4] == ["not reached", "n/a"]
    two = results_of(runs, [replace(whole, keys=keys), replace(whole, clip="throw")])
    write_report(tmp_path / "two.html", two, films={}, settings=SETTINGS)
    rows = table_of(Page(tmp_path / "two.html"), "Keys a second needed to be as good as Vector + Quaternion")
    assert rows[2][2].endswith("% on 1 of 2 clips")
    assert "clips" not in rows[2][3]
    assert "20/s (1 of 2 clips)" in [text for _, text in Page(tmp_path / "two.html").find("th", scope="col")]


def test_the_curve_of_error_over_keys_runs_through_what_was_found(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, needed = adaptive
    for clip, name in zip(needed, ("clip-1", "clip-2"), strict=True):
        (chart,) = (
            place
            for place, (kind, own, _) in enumerate(page.elements)
            if kind == "svg" and own.get("aria-labelledby", "").startswith(f"{name}-needed-title")
        )
        own = page.elements[chart][1]
        low_x, high_x, low_y, high_y = (float(word) for axis in ("data-x", "data-y") for word in own[axis].split()[:2])
        curves = [element for element in page.elements[chart:] if element[1].get("class", "").startswith("curve")]
        for row, group in enumerate(clip.groups):
            (_, dashed, title), (_, solid, _) = curves[2 * row : 2 * row + 2]
            assert "".join(title) == " = ".join(KEYFRAME_MODES[mode].label for mode in group) + ", evenly spaced"
            assert (dashed["class"], solid["class"]) == ("curve dashed", "curve")
            for drawn, x, y in (
                (dashed, clip.reference_keys_per_s, clip.uniform_errors[row]),
                (solid, clip.keys_per_s[row, 1], clip.reached[row, 1]),
            ):
                steps = np.array(re.findall(r"-?\d+", drawn["d"]), dtype=int).reshape(-1, 2)
                along, down = (np.cumsum(steps, axis=0) / (GRID_X, GRID_Y)).T
                order = np.argsort(x)
                np.testing.assert_allclose(low_x * (high_x / low_x) ** along, x[order], rtol=0.005)
                np.testing.assert_allclose(low_y * (high_y / low_y) ** (1.0 - down), y[order] * 1e3, rtol=0.005)


def test_modes_with_keys_of_their_own_have_their_numbers_and_marks(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, needed = adaptive
    headings = [text for _, text in page.find("h3")]
    assert headings.count("within 5 mm") == 2
    made = choose(swinging_clip("reach", seed=1), Tolerance("5mm"), KEYFRAME_MODES, 0.1)
    rows = table_of(page, "reach within 5 mm")
    assert [row[1] for row in rows] == [str(len(keys)) for keys in made.keys.values()]
    coloured = [own for _, own, _ in page.elements if own.get("class") == "marks coloured"]
    assert {own["style"].removeprefix("--colour:") for own in coloured} == {
        colour_of(group[0]) for group in needed[0].groups
    }


def test_the_lead_and_the_settings_tell_the_choices_apart(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, _ = adaptive
    lead = next(text for _, text in page.find("p", class_="lead"))
    assert "reduced to 10 keys a second, and to the fewest keys with which a mode stays within 5 mm and 2 cm" in lead
    facts = " ".join(text for _, text in page.find("dl", class_="facts"))
    assert "Rates10 keys/s" in facts
    assert "Tolerances5 mm and 2 cm" in facts


def test_an_adaptive_report_is_sound(adaptive: tuple[Page, list[KeysNeeded]]) -> None:
    page, _ = adaptive
    assert "#needed" in assert_links_lead_somewhere(page)
    test_charts_describe_their_axes_in_plain_numbers(page)


def test_a_run_without_adaptive_keys_does_not_speak_of_the_keys_needed(page: Page) -> None:
    assert "Keys needed" not in page.source
    assert "#needed" not in page.source


def test_the_best_of_each_segment_is_a_row_and_tells_which_modes_it_took(tmp_path: Path) -> None:
    modes = ("lerp_slerp", "motor_spline", BEST_OF)
    made = [choose(swinging_clip("reach", seed=19), choice, modes, 0.1) for choice in (Uniform("5"), Tolerance("5mm"))]
    write_report(tmp_path / "report.html", results_of(made), films={}, settings=SETTINGS)
    page = Page(tmp_path / "report.html")
    names = [attributes["data-value"] for name, attributes, _ in page.elements if "data-value" in attributes]
    assert names.count("Best per Segment") == 2 + len(made)
    notes = ["".join(text) for name, attributes, text in page.elements if attributes.get("class") == "note"]
    told = [note for note in notes if note.startswith("Best per Segment")]
    assert len(told) == len(made)
    for note, one in zip(told, made, strict=True):
        counts = dict(re.findall(r"(Vector \+ Quaternion|Smooth Screw \(PGA\)) in (\d+)", note))
        assert int(counts["Smooth Screw (PGA)"]) == one.segment_modes.count("motor_spline")
        assert int(counts["Vector + Quaternion"]) == one.segment_modes.count("lerp_slerp")
        changes = sum(a != b for a, b in zip(one.segment_modes[:-1], one.segment_modes[1:], strict=True))
        assert f"the mode changes at {changes} key" in note
        assert "Compared with Smooth Screw (PGA), the best single mode, its RMS shell error is " in note
        assert "higher" not in note


def test_many_clips_are_a_table_that_leads_to_their_pages(tmp_path: Path, runs: list[Reconstruction]) -> None:
    clips = results_of(runs)
    pages = {"reach": "re ach/report.html", "throw": None}
    write_overview(tmp_path / "report.html", clips, pages=pages, settings=SETTINGS)
    page = Page(tmp_path / "report.html")
    links = assert_links_lead_somewhere(page)
    assert [link for link in links if not link.startswith("#")] == ["re%20ach/report.html"]
    assert [text for _, text in page.find("h2")] == ["Summary", "Modes and measures", "Clips", "This run"]
    rows = table_of(page, "All 2 clips")
    assert [row[0] for row in rows] == ["reach", "throw"]
    for row, clip in zip(rows, clips, strict=True):
        assert row[1:4] == ["3.00", "271", str(len(clip.facts.repairs))]
        for cell, result in zip(row[4:], clip.results, strict=True):
            errors = {metrics.mode: metrics.rms_shell_m for metrics in result.rows}
            best = min(errors, key=errors.__getitem__)
            number, share = cell.split(label_of(best))
            assert float(number) == pytest.approx(errors["lerp_slerp"] * 1e3, rel=0.006)
            assert float(share) == pytest.approx(errors[best] / errors["lerp_slerp"], abs=0.006)


def test_a_clip_that_has_not_every_choice_has_gaps_in_the_table(tmp_path: Path, runs: list[Reconstruction]) -> None:
    write_overview(tmp_path / "report.html", results_of(runs[:4]), pages={}, settings=SETTINGS)
    assert table_of(Page(tmp_path / "report.html"), "All 2 clips")[1][5:] == ["too short", "too short"]


def test_the_page_of_a_clip_leads_back_and_shows_its_film(tmp_path: Path, runs: list[Reconstruction]) -> None:
    film = tmp_path / "reach" / "5" / "comparison.mp4"
    film.parent.mkdir(parents=True)
    film.write_bytes(b"film")
    films = {("reach", "5"): film, ("reach", "7.5"): None, ("reach", "20"): None}
    clip = results_of(runs[:3])[0]
    scratch = tmp_path / "elsewhere" / "report.html"
    write_clip_page(scratch, clip, films=films, settings=SETTINGS, folder=tmp_path / "reach", overview="../report.html")
    page = Page(scratch)
    links = assert_links_lead_somewhere(page)
    assert [link for link in links if not link.startswith("#")] == ["../report.html", "5/comparison.mp4"]
    assert [text for _, text in page.find("h2")] == ["reach"]
    assert page.source.count("The video could not be made.") == 2
    assert len(list(page.find("script", type="text/plain"))) == 1


def test_a_report_reads_its_clips_one_at_a_time(tmp_path: Path, runs: list[Reconstruction]) -> None:
    class Clips:
        """Clips that are made when they are asked for, and counted while they are held."""

        alive = most = 0

        def __iter__(self) -> Iterator[ClipResults]:
            for clip in results_of(runs * 3):
                held = replace(clip, facts=replace(clip.facts))
                weakref.finalize(held, self.gone)
                self.alive += 1
                self.most = max(self.most, self.alive)
                yield held
                del held

        def gone(self) -> None:
            self.alive -= 1

    clips = Clips()
    write_report(tmp_path / "report.html", clips, films={}, settings=SETTINGS)
    assert clips.most <= 2
