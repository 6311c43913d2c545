"""The page in a browser: it draws, plays and is steered as by hand, complains of nothing and asks for nothing."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rigid_motion_batch.analysis.choices import Budget, Tolerance
from rigid_motion_batch.recordings.clips import ClipWarning
from rigid_motion_batch.report import Settings, pages, write_overview, write_report
from tests.scripts.comparison.bodies import swinging_body
from tests.scripts.comparison.recordings import swinging_clip
from tests.scripts.report.chromium import Browser, browser
from tests.scripts.report.javascript import require
from tests.scripts.report.runs import RATES, result_of

SETTINGS = Settings(0.1, "Rigid Motion 1.0", "compare a.csv b.csv")
WARNING = ClipWarning("A gap of 183 ms.", "Record again.", 101.25, 101.5)
NOISE = "GL Driver Message"
"""What Chromium says of its own drawing without a graphics card."""


@pytest.fixture(scope="module")
def chromium() -> Iterator[Browser]:
    require()
    with browser() as found:
        yield found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Pages of all kinds."""
    folder = tmp_path_factory.mktemp("pages")
    two = [
        result_of(swinging_clip("a"), warnings=[WARNING]),
        result_of(swinging_clip("b & <b>", seed=2), (*RATES, Budget("5"), Tolerance("20mm"))),
    ]
    write_report(folder / "two.html", two, SETTINGS)
    write_report(folder / "body.html", [result_of(swinging_body(), RATES[1:2])], SETTINGS)
    write_report(folder / "adaptive.html", [result_of(swinging_clip(), (Tolerance("20mm"),))], SETTINGS)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(pages, "IN_THE_PAGE", 1)
        write_report(folder / "large.html", two, SETTINGS)
    write_overview(folder / "overview.html", two, SETTINGS, {"a": "two.html", "b & <b>": None})
    return folder


@pytest.fixture
def page(chromium: Browser, folder: Path) -> Iterator[Browser]:
    """A browser in which nothing went wrong once the test is over, and that no request has left."""
    chromium.problems.clear()
    chromium.requests.clear()
    yield chromium
    assert [problem for problem in chromium.problems if NOISE not in problem] == []
    assert [one for one in chromium.requests if not one.startswith((folder.as_uri(), "data:"))] == []


def opened(page: Browser, path: Path, fragment: str = "", **how: Any) -> Browser:
    page.open(f"{path.as_uri()}{fragment}", **how)
    page.settle()
    return page


def now(page: Browser) -> float:
    return float(page.run("document.getElementById('now').textContent"))


def colours_in_view(page: Browser) -> int:
    """How many colours the view has."""
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


@pytest.mark.parametrize("name", ["two", "body", "adaptive", "large"])
@pytest.mark.parametrize("dark", [False, True], ids=["light", "dark"])
@pytest.mark.parametrize("width", [1440, 390])
def test_every_page_draws_its_view_and_chart_and_fits(
    page: Browser, folder: Path, name: str, dark: bool, width: int
) -> None:
    opened(page, folder / f"{name}.html", width=width, height=900, dark=dark)
    assert colours_in_view(page) > 20
    curves = page.run("[...document.querySelectorAll('#plot .line')].map((one) => one.getAttribute('d').length)")
    assert len(curves) >= 2
    assert min(curves) > 100
    assert page.run("document.documentElement.scrollWidth") <= width
    # All that matters is on the first screen.
    assert box(page, "#view")["y"] + box(page, "#view")["height"] < 900


def test_the_page_opens_at_the_worst_moment_of_its_clip(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html")
    worst = page.run("Math.max(...[...document.querySelectorAll('#modes .worst')].map((one) => +one.textContent))")
    live = page.run("Math.max(...[...document.querySelectorAll('#modes .live')].map((one) => +one.textContent))")
    assert live == worst > 0.0
    assert page.run("document.getElementById('badge').textContent").startswith("Deviation ")


def test_it_plays_and_stops(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,0.5")
    assert now(page) == pytest.approx(0.5, abs=0.01)
    page.press(" ")
    page.settle()
    moment = now(page)
    assert moment > 0.51
    page.settle()
    assert now(page) > moment
    page.run("document.getElementById('play').click()")
    stopped = now(page)
    page.settle()
    assert now(page) == pytest.approx(stopped, abs=0.02)


def test_dragging_in_the_chart_is_scrubbing(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,0.5")
    plot = box(page, "#plot")
    y = plot["y"] + plot["height"] / 2
    places = [plot["x"] + plot["width"] * share for share in (0.2, 0.4, 0.6)]
    page.mouse(("pressed", places[0], y), ("moved", places[1], y), ("moved", places[2], y))
    page.settle()
    end = float(page.run("document.getElementById('end').textContent.match(/[0-9.]+/)[0]"))
    share = (plot["width"] * 0.6 - 44) / (plot["width"] - 54)
    assert now(page) == pytest.approx(share * end, abs=0.02)
    page.mouse(("released", places[2], y))


def test_a_click_near_a_peak_goes_to_it(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,0.5")
    plot = box(page, "#plot")
    x, y = page.run("[...document.querySelectorAll('#plot circle')].map((one) => [+one.getAttribute('cx'), "
                    "+one.getAttribute('cy')]).sort((a, b) => a[1] - b[1])[0]")  # fmt: skip
    page.mouse(("pressed", plot["x"] + x + 3, plot["y"] + y + 30), ("released", plot["x"] + x + 3, plot["y"] + y + 30))
    page.settle()
    worst = page.run("Math.max(...[...document.querySelectorAll('#modes .worst')].map((one) => +one.textContent))")
    live = page.run("Math.max(...[...document.querySelectorAll('#modes .live')].map((one) => +one.textContent))")
    assert live == worst


def test_the_wheel_scrolls_the_page_until_the_view_has_the_focus(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html")
    view = box(page, "#view")
    at = {"x": view["x"] + 50, "y": view["y"] + 50}
    page.call("Input.dispatchMouseEvent", type="mouseWheel", deltaX=0, deltaY=200, **at)
    page.settle()
    assert page.run("scrollY") > 0
    page.run("scrollTo(0, 0)")
    page.mouse(
        ("pressed", at["x"], at["y"]), ("moved", at["x"] + 60, at["y"] + 5), ("released", at["x"] + 60, at["y"] + 5)
    )
    page.settle()
    before = page.run("document.getElementById('view').toDataURL()")
    page.call("Input.dispatchMouseEvent", type="mouseWheel", deltaX=0, deltaY=200, **at)
    page.settle()
    assert page.run("scrollY") == 0
    assert page.run("document.getElementById('view').toDataURL()") != before


def test_a_chip_hides_its_mode_everywhere(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html")
    count = page.run("document.querySelectorAll('#plot .line').length")
    assert page.run("document.querySelectorAll('#lanes div').length") == count
    page.run("document.querySelector('#modes .chip').click()")
    page.settle()
    assert page.run("document.querySelectorAll('#plot .line').length") == count - 1
    assert page.run("document.querySelectorAll('#lanes div').length") == count - 1
    page.press("1")
    page.settle()
    assert page.run("document.querySelectorAll('#plot .line').length") == count


@pytest.mark.parametrize("name", ["two", "large"])
def test_clips_and_choices_are_changed_and_kept_in_the_address(page: Browser, folder: Path, name: str) -> None:
    opened(page, folder / f"{name}.html", "#a,5,1")
    page.run("document.querySelector('[name=clip][value=\"1\"]').click()")
    page.settle()
    assert page.run("decodeURIComponent(location.hash)").startswith("#b & <b>,5,")
    page.run("document.querySelector('[name=choice][value=\"tolerance-20mm\"]').click()")
    page.settle()
    address = page.run("location.href")
    assert "tolerance-20mm" in address
    assert "where each mode needs them" in page.run("document.getElementById('about').textContent")
    moment = now(page)
    opened(page, folder / f"{name}.html", f"#{address.partition('#')[2]}")
    assert page.run("document.querySelector('[name=clip]:checked').value") == "1"
    assert page.run("document.querySelector('[name=choice]:checked').value") == "tolerance-20mm"
    assert now(page) == pytest.approx(moment, abs=0.01)


def test_a_warning_leads_to_its_moment(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#b%20%26%20%3Cb%3E,10,0.2")
    assert page.run("document.querySelectorAll('#plot .doubt').length") == 0
    page.run("document.querySelector('.warn a').click()")
    page.settle()
    assert now(page) == pytest.approx(1.25, abs=0.01)
    assert page.run("document.querySelectorAll('#plot .doubt').length") == 1


def test_keys_that_differ_have_a_row_of_ticks_for_each_mode(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,1")
    assert page.run("document.querySelectorAll('#plot .key').length") == 1
    opened(page, folder / "adaptive.html")
    rows = page.run("document.querySelectorAll('#plot .key').length")
    assert rows == page.run("document.querySelectorAll('#plot .line').length") > 1


def test_the_keyboard_moves_in_time(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html", "#a,10,1.005")
    moments = []
    for key, shift in (("ArrowRight", False), ("ArrowLeft", False), ("ArrowRight", True), ("ArrowRight", True)):
        page.press(key, shift=shift)
        page.settle()
        moments.append(now(page))
    after, before, key, following = moments
    assert after == pytest.approx(1.01, abs=0.011)
    assert before < after
    assert (key, following) == (pytest.approx(1.1, abs=0.01), pytest.approx(1.2, abs=0.01))
    page.press("w")
    page.settle()
    assert page.run(
        "Math.max(...[...document.querySelectorAll('#modes .live')].map((one) => +one.textContent))"
    ) == page.run("Math.max(...[...document.querySelectorAll('#modes .worst')].map((one) => +one.textContent))")


def test_the_table_shows_the_clip_and_the_measure_that_are_chosen(page: Browser, folder: Path) -> None:
    opened(page, folder / "two.html")
    page.run("""for (const [id, value] of [["scope", "1"], ["column", "2"]]) {
        const one = document.getElementById(id); one.value = value;
        one.dispatchEvent(new Event("change", { bubbles: true })); }""")
    shown = page.run("[...document.querySelectorAll('#numbers .grid')].filter((one) => one.offsetParent)"
                     ".map((one) => one.caption.textContent)")  # fmt: skip
    assert [text.partition(".")[0] for text in shown] == ["Shell error, largest, mm: b & <b>"]


def test_without_a_script_the_numbers_are_there(page: Browser, folder: Path) -> None:
    page.open((folder / "two.html").as_uri(), script=False)
    # What runs here is the test's, not the page's.
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
