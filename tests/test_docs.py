"""The pages agree with one another: what they quote is what the pages and files say that it was measured for."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from docs import measure_recordings, quote_figures
from research.paper.table import RADIUS
from research.summaries import SUMMARIES, with_summary
from rigid_motion.motion import curves, decimate
from rigid_motion_batch.analysis.needed import OfRigidBody
from tests.scripts.clips.recordings import swinging_clip

DOCS = Path(__file__).resolve().parents[1] / "docs"
PAGES = sorted(DOCS.glob("*.md"))


class Changed(quote_figures.Sources):
    """The sources, one page of which has another text."""

    def __init__(self, name: str, change: Callable[[str], str]) -> None:
        super().__init__()
        self._name, self._change = name, change

    def page(self, name: str) -> str:
        text = super().page(name)
        return self._change(text) if name == self._name else text


def quotes(page: str) -> dict[str, str]:
    return {name: text for _, name, text, _ in quote_figures.QUOTE.findall(page)}


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_every_figure_that_is_quoted_is_that_of_its_source(path: Path):
    page = path.read_text(encoding="utf-8")
    assert quote_figures.filled(page, quote_figures.Sources(), path.name) == page, "run python docs/quote_figures.py"


def test_all_that_can_be_quoted_is():
    used = {name for path in PAGES for name in quotes(path.read_text(encoding="utf-8"))}
    assert used == set(quote_figures.QUOTES)


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_every_quote_ends_and_none_begins_a_line_of_a_paragraph(path: Path):
    page = path.read_text(encoding="utf-8")
    assert page.count("<!-- quote ") == page.count("<!-- end -->") == len(quote_figures.QUOTE.findall(page))
    for line in page.splitlines():
        # Markdown takes such a line for HTML, and leaves what follows on it as it is.
        assert not re.match(r"\s*(?:[-*] )?<!-- (?:quote \S+|end) -->.", line), line


def test_a_quote_of_nothing_known_is_refused():
    with pytest.raises(LookupError, match=r"page\.md: .*'keys-lost'"):
        quote_figures.filled("<!-- quote keys-lost -->1<!-- end -->", quote_figures.Sources(), "page.md")


@pytest.mark.parametrize(
    ("source", "before", "after", "name", "words"),
    [
        (
            "paper.md",
            "| 29.0 (3%) | 18.8 (6%) | 14.3 (4%) | 11.5 (4%) |",
            "| 33.0 (10% more) |" * 4,
            "screw-needs",
            "10 % more",
        ),
        (
            "paper.md",
            "| 10.7 (64%) | 7.7 (61%) | 6.0 (60%) | 4.8 (60%) |",
            "| 9 (57%) " * 4 + "|",
            "adaptive-saves",
            "miss",
        ),
        ("figures/recordings.json", '"5": 0.82,', '"5": 0.7,', "errors-of-modes", "| 5 | 1.06 | 0.98 | 0.70 |"),
        ("figures/recordings.json", '"12": 0.423', '"12": 0.44', "own-count", "missed at 12"),
        ("subframes.md", "| 15.2 |", "| 99.9 |", "sub-frames-violent", "99.9"),
        ("benchmark_batch.md", "| 385 |", "| 386 |", "memory-long", "386"),
    ],
)
def test_a_figure_follows_its_source(source: str, before: str, after: str, name: str, words: str):
    assert before in quote_figures.Sources().page(source)
    changed = Changed(source, lambda text: text.replace(before, after.replace("||", "|")))
    assert words in quote_figures.QUOTES[name](changed)


@pytest.mark.parametrize("name", SUMMARIES)
def test_a_page_of_figures_begins_with_a_summary_that_says_where_it_hurts(name: str):
    page = (DOCS / name).read_text(encoding="utf-8")
    lines = SUMMARIES[name](page)
    points = [line for line in lines if line.startswith("- ")]
    assert points[0].startswith("- Measured: ")
    assert "Where it hurts: " in " ".join(" ".join(lines).split())
    assert 2 <= len(points) <= 6
    assert page.startswith("# ")
    assert page.partition("\n")[2].startswith("\n<!-- summary -->\n\n- Measured: ")


@pytest.mark.parametrize("name", SUMMARIES)
def test_a_summary_takes_the_place_of_the_one_before_and_changes_nothing_else(name: str):
    page = (DOCS / name).read_text(encoding="utf-8")
    assert with_summary(page, SUMMARIES[name](page)) == page
    without = with_summary(page, ["- Something else."])
    assert "- Something else." in without
    assert "- Measured: " not in without
    assert with_summary(without, SUMMARIES[name](without)) == page


def test_no_page_says_a_negative_percentage():
    for path in PAGES:
        found = re.findall(r"[^\w.\N{EN DASH}][-\N{MINUS SIGN}]\d+(?:\.\d+)? ?%", path.read_text(encoding="utf-8"))
        assert not found, f"{path.name}: {found}"


TIMES = np.array((1.0, 20.0, 1.0, 0.5)), np.array((20.0, 1.0, 1.0, 0.7))
"""Of segments before and after a key."""


def test_the_rule_in_bold_is_that_of_the_program():
    np.testing.assert_array_equal(measure_recordings.RULES[quote_figures.OWN_RULE](*TIMES), curves._shares(*TIMES))
    assert set(measure_recordings.RULES) == set(quote_figures.RULES)


def test_half_of_what_the_parabola_adds_is_the_stream_spline_of_the_program():
    clip = swinging_clip(seed=1)
    half, whole, none = (measure_recordings._errors_of_clips([clip], part) for part in (0.5, 1.0, 0.0))
    keys = decimate(clip.times, 5.0)
    stretch = OfRigidBody(clip, RADIUS).between(0, int(keys[-1]))
    error = stretch.error(keys, "motor_spline_causal") / stretch.error(keys, "lerp_slerp")
    assert half["5"] == pytest.approx(error, rel=1e-12)
    assert abs(whole["5"] - half["5"]) > 1e-3
    assert abs(none["5"] - half["5"]) > 1e-3
