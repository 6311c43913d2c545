"""Tests of pages in a browser: they draw, play and can be operated, without console problems or requests."""

import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from rigid_motion_batch.analysis.choices import Budget, Tolerance
from rigid_motion_batch.recordings.clips import ClipWarning
from rigid_motion_batch.report import pages
from rigid_motion_batch.report.pages import write_overview, write_report
from rigid_motion_batch.report.settings import PageSettings
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.report.chromium import Browser, browser
from tests.scripts.report.javascript import require
from tests.scripts.report.runs import RATES, result_of

pytestmark = pytest.mark.once

SETTINGS = PageSettings(0.1, "Rigid Motion 1.0", "compare a.csv b.csv")
WARNING = ClipWarning("A gap of 183 ms.", "Record again.", 101.25, 101.5)
PATIENCE = 30.0
"""Seconds."""

HOSTILE = "</script><img src=x onerror='broken = 1'><script>broken = 1</script>{{ 7 * 7 }}"


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    require()
    with browser() as result:
        yield result


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with pages of all kinds."""
    folder = tmp_path_factory.mktemp("pages")
    two = [
        result_of(swinging_clip("a"), warnings=[WARNING]),
        result_of(swinging_clip("b & <b>", seed=2), (*RATES, Budget("5"), Tolerance("20mm"))),
    ]
    write_report(folder / "two.html", two, SETTINGS)
    write_report(folder / "body.html", [result_of(swinging_body(), RATES[1:2])], SETTINGS)
    write_report(folder / "adaptive.html", [result_of(swinging_clip(), (Tolerance("20mm"),))], SETTINGS)
    named = result_of(swinging_clip(), RATES[1:2], warnings=[ClipWarning(HOSTILE, HOSTILE, 101.0)])
    named = replace(named, facts=replace(named.facts, name=HOSTILE))
    write_report(folder / "hostile.html", [named, result_of(swinging_clip("a"), RATES[1:2])], SETTINGS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pages, "IN_THE_PAGE", 1)
        write_report(folder / "large.html", two, SETTINGS)
    write_overview(folder / "overview.html", two, SETTINGS, {"a": "two.html", "b & <b>": None})
    return folder


@pytest.fixture
def page(chromium: Browser, folder: Path) -> Iterator[Browser]:
    """Yield a browser, and check after the test that it had no problems and sent no request."""
    chromium.problems.clear()
    chromium.requests.clear()
    yield chromium
    assert chromium.problems == []
    assert [request for request in chromium.requests if not request.startswith((folder.as_uri(), "data:"))] == []


NOW = "+document.getElementById('now').textContent"
LIVE, WORST = (
    f"Math.max(...[...document.querySelectorAll('#modes .{kind}')].map((one) => +one.textContent))"
    for kind in ("live", "worst")
)
ADDRESS = "decodeURIComponent(location.hash)"
LINES, TICKS, LANES = ("#plot .line", "#plot .key", "#lanes div")


def shows(page: Browser, expression: str, expected: object = True) -> None:
    """Wait until an expression of the page has this value: a busy machine draws late."""
    end = time.monotonic() + PATIENCE
    while (result := page.run(expression)) != expected and time.monotonic() < end:
        time.sleep(0.05)
    assert result == expected, expression


def count(selector: str) -> str:
    return f"document.querySelectorAll({selector!r}).length"


def near(moment: float) -> str:
    return f"Math.abs({NOW} - {moment!r}) < 0.015"


def opened(page: Browser, path: Path, fragment: str = "", **how: Any) -> Browser:
    """Open a page, and wait until it shows its clip, or an explanation why it cannot."""
    page.open(f"{path.as_uri()}{fragment}", **how)
    shows(page, "document.querySelector('#overview, #cursor line') !== null || "
                "document.getElementById('about').textContent.endsWith('page')")  # fmt: skip
    page.settle()
    return page


def now(page: Browser) -> float:
    return float(page.run(NOW))


def colours_in_view(page: Browser) -> int:
    """Return the number of colours in the view."""
    return page.run(
        """(() => { const canvas = document.createElement("canvas"), view = document.getElementById("view");
        Object.assign(canvas, { width: view.width, height: view.height });
        const pen = canvas.getContext("2d"); pen.drawImage(view, 0, 0);
        const { data } = pen.getImageData(0, 0, canvas.width, canvas.height), found = new Set();
        for (let i = 0; i < data.length; i += 4)
            if (data[i + 3] > 200) found.add(data[i] << 16 | data[i + 1] << 8 | data[i + 2]);
        return found.size; })()"""
    )


def box(page: Browser, selector: str) -> dict[str, float]:
    return page.run(f"(() => {{ const {{ x, y, width, height }} = document.querySelector({selector!r})"
                    ".getBoundingClientRect(); return { x, y, width, height }; })()")  # fmt: skip


@pytest.mark.parametrize(
    ("name", "dark", "width"),
    [("two", False, 390), ("body", True, 1440), ("adaptive", False, 1440), ("large", True, 390)],
)
def test_every_page_draws_its_view_and_chart_and_fits(page, folder, name, dark, width):
    opened(page, folder / f"{name}.html", width=width, height=900, dark=dark)
    assert colours_in_view(page) > 20
    curves = page.run("[...document.querySelectorAll('#plot .line')].map((one) => one.getAttribute('d').length)")
    assert len(curves) >= 2
    assert min(curves) > 100
    assert page.run("document.documentElement.scrollWidth") <= width
    # Everything important is on the first screen.
    assert box(page, "#view")["y"] + box(page, "#view")["height"] < 900


def test_the_page_opens_at_the_worst_moment_of_its_clip(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html")
    shows(page, f"{LIVE} === {WORST} && {WORST} > 0")
    assert page.run("document.getElementById('badge').textContent").startswith("Deviation ")


def test_it_plays_and_stops(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,0.5")
    shows(page, near(0.5))
    page.press(" ")
    shows(page, f"{NOW} > 0.53 && {NOW} < 3")
    shows(page, f"{NOW} > 0.6 && {NOW} < 3")
    page.run("document.getElementById('play').click()")
    page.settle()
    stopped = now(page)
    page.settle()
    assert now(page) == stopped


def test_dragging_in_the_chart_is_scrubbing(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,0.5")
    plot = box(page, "#plot")
    y = plot["y"] + plot["height"] / 2
    places = [plot["x"] + plot["width"] * share for share in (0.2, 0.4, 0.6)]
    page.mouse(("pressed", places[0], y), ("moved", places[1], y), ("moved", places[2], y))
    end = float(page.run("document.getElementById('end').textContent.match(/[0-9.]+/)[0]"))
    share = (plot["width"] * 0.6 - 44) / (plot["width"] - 54)
    shows(page, near(share * end))
    page.mouse(("released", places[2], y))


def test_a_chip_hides_its_mode_everywhere(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html")
    modes = page.run(count(LINES))
    shows(page, count(LANES), modes)
    page.run("document.querySelector('#modes .chip').click()")
    shows(page, count(LINES), modes - 1)
    shows(page, count(LANES), modes - 1)
    page.press("1")
    shows(page, count(LINES), modes)


def test_clips_and_choices_are_changed_and_kept_in_the_address(page: Browser, folder: Path) -> None:
    opened(page, folder / "large.html", "#a,5,1")
    page.run("document.querySelector('[name=clip][value=\"1\"]').click()")
    shows(page, f"{ADDRESS}.startsWith('#b & <b>,5,')")
    page.run("document.querySelector('[name=choice][value=\"tolerance-20mm\"]').click()")
    shows(page, f"{ADDRESS}.startsWith('#b & <b>,tolerance-20mm,')")
    assert "where each mode needs them" in page.run("document.getElementById('about').textContent")
    moment, address = now(page), page.run("location.hash")
    opened(page, folder / "large.html", address)
    assert page.run("document.querySelector('[name=clip]:checked').value") == "1"
    assert page.run("document.querySelector('[name=choice]:checked').value") == "tolerance-20mm"
    shows(page, near(moment))


def test_a_warning_leads_to_its_moment(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#b%20%26%20%3Cb%3E,10,0.2")
    assert page.run(count("#plot .doubt")) == 0
    page.run("document.querySelector('.warn a').click()")
    shows(page, near(1.25))
    shows(page, count("#plot .doubt"), 1)


def test_the_keyboard_moves_in_time(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,1.005")
    page.press("ArrowRight", shift=True)
    shows(page, near(1.1))
    page.press("ArrowRight", shift=True)
    shows(page, near(1.2))
    page.press("ArrowLeft")
    shows(page, f"{NOW} > 1.18 && {NOW} < 1.195")
    page.press("ArrowRight")
    shows(page, near(1.2))
    page.press("w")
    shows(page, f"{LIVE} === {WORST}")


def test_names_are_nothing_but_text(page: Browser, folder: Path) -> None:
    opened(page, folder / "hostile.html")
    for place in (".warn a", "[name=clip]:checked + span"):
        texts = page.run(f"[...document.querySelectorAll({place!r})].map((one) => one.textContent)")
        assert any(HOSTILE in text for text in texts), place
    assert page.run("typeof window.broken") == "undefined"


def test_without_a_script_the_numbers_are_there(page: Browser, folder: Path) -> None:
    page.open((folder / "two.html").as_uri(), script=False)
    # The script run here is the test's, not the page's.
    page.call("Emulation.setScriptExecutionDisabled", value=False)
    assert page.run("getComputedStyle(document.querySelector('.stage')).display") == "none"
    assert page.run("document.querySelector('.grid').offsetHeight") > 100


def test_the_overview_finds_and_sorts(page: Browser, folder: Path) -> None:
    opened(page, folder / "overview.html")
    names = "[...document.querySelectorAll('#overview tbody tr')].filter((one) => one.offsetParent).map((one) => " \
            "one.cells[0].textContent)"  # fmt: skip
    assert page.run(names)[0] == "a"
    page.run("document.querySelectorAll('#overview th button')[0].click()")
    page.run("document.querySelectorAll('#overview th button')[0].click()")
    assert page.run(names) == ["b & <b>", "a"]
    page.run("""(() => { const one = document.querySelector("[type=search]"); one.value = "<B>";
        one.dispatchEvent(new Event("input", { bubbles: true })); })()""")
    assert page.run(names) == ["b & <b>"]
    assert page.run("document.getElementById('found').textContent") == "1 of 2"


def test_the_data_beside_a_page_that_are_missing_are_said_to_be(chromium: Browser, folder: Path) -> None:
    text = (folder / "large.html").read_text(encoding="utf-8").replace("large_data", "gone_data")
    (folder / "gone.html").write_text(text, encoding="utf-8")
    opened(chromium, folder / "gone.html")
    said = chromium.run("document.getElementById('about').textContent")
    assert said.startswith("gone_data/")
    assert said.endswith(".js is not beside this page")
