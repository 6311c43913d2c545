"""Tests of the documentation site: it builds without a warning, its links lead somewhere, and it works offline."""

import json
import re
from collections import defaultdict
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from rigid_motion import motion
from rigid_motion_batch.cli.commands import COMMANDS
from scripts import build_site

pytestmark = pytest.mark.once

LOADING = ("src", "data", "poster")
"""Attributes of files that a browser loads with a page, besides stylesheets and icons."""


@dataclass(repr=False)
class Page(HTMLParser):
    """The links of a page, the files that it loads, and its anchors."""

    path: Path
    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)
    anchors: set[str] = field(default_factory=set)
    films: list[dict[str, str | None]] = field(default_factory=list)
    formulas: int = 0

    def __post_init__(self) -> None:
        super().__init__()
        self.text = self.path.read_text(encoding="utf-8")
        self.feed(self.text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.anchors |= {given[name] for name in ("id", "name") if given.get(name)}
        self.loaded += [given[name] for name in LOADING if given.get(name)]
        if tag == "link" and given["rel"] not in ("index", "search", "next", "prev", "canonical"):
            self.loaded.append(given["href"])
        if tag == "a" and given.get("href"):
            self.links.append(given["href"])
        if tag == "video":
            self.films.append(given)
        self.formulas += tag == "math"


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the site, built from this checkout."""
    pytest.importorskip("sphinx", reason="the packages of the extra `docs` are not installed")
    return build_site.build(tmp_path_factory.mktemp("site") / "pages").parent


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Page]:
    """Every page by its path."""
    return {path: Page(path) for path in site.rglob("*.html")}


def target_of(page: Page, link: str) -> tuple[Path, str]:
    """Return the file, and the anchor in it, that a link of a page leads to."""
    parts = urlsplit(link)
    path = page.path if not parts.path else (page.path.parent / unquote(parts.path)).resolve()
    return path, unquote(parts.fragment)


def test_every_link_leads_somewhere(pages):
    astray = defaultdict(set)
    for page in pages.values():
        for link in page.links:
            if urlsplit(link).scheme in ("http", "https", "mailto"):
                continue
            path, place = target_of(page, link)
            if not path.is_file() or (place and path in pages and place not in pages[path].anchors):
                astray[page.path.name].add(link)
    assert not astray


def test_a_page_loads_nothing_but_files_of_the_site(site, pages):
    for page in pages.values():
        for link in page.loaded:
            path, _ = target_of(page, link)
            assert not urlsplit(link).scheme, f"{page.path.name} loads {link}"
            assert not urlsplit(link).netloc, f"{page.path.name} loads {link}"
            assert path.is_file(), f"{page.path.name} loads {link}, which is missing"
            assert path.is_relative_to(site), f"{page.path.name} loads {link} from outside"


def test_stylesheets_and_scripts_name_no_file_of_another_server(site):
    for path in [*site.rglob("*.css"), *site.rglob("*.html"), *site.rglob("*.svg")]:
        text = path.read_text(encoding="utf-8")
        assert not re.search(r"url\(\s*['\"]?(?:https?:)?//|@import", text), path
    for path in site.rglob("*.js"):
        loading = r"(?:fetch|importScripts|import)\(\s*['\"](?:https?:)?//|\.src\s*=\s*['\"](?:https?:)?//"
        assert not re.search(loading, path.read_text(encoding="utf-8")), path


@pytest.mark.parametrize("name", motion.__all__)
def test_every_public_name_of_the_core_has_an_entry(name, site, pages):
    qualified = f"{motion.__name__}.{name}"
    path = site / "reference" / "generated" / f"{qualified}.html"
    assert path in pages
    assert qualified in pages[path].anchors
    assert re.search(rf'id="{re.escape(qualified)}".*?<dd>\s*<p>\w', pages[path].text, re.S), "nothing is said of it"


@pytest.mark.parametrize("mode", motion.MODES)
def test_every_mode_has_its_film_its_picture_its_formula_and_what_the_table_says_of_it(mode, site, pages):
    loops, details, conventions = (pages[site / f"{name}.html"] for name in ("modes", "reference/modes", "conventions"))
    place = f"mode-{mode.replace('_', '-')}"
    told = (loops, details)
    if motion.MODES[mode].is_reference:
        # All films show the reference in grey.
        told = (details,)
    else:
        assert f"loop-{place}" in loops.anchors
        assert any(film["src"].endswith(f"{mode}.mp4") and film["poster"] for film in loops.films)
    assert place in details.anchors
    assert any(link.endswith(f"{mode}.svg") for link in details.loaded)
    assert place in conventions.anchors
    for page in told:
        assert motion.MODES[mode].label in page.text.replace("\N{RIGHT SINGLE QUOTATION MARK}", "'")
        assert motion.MODES[mode].description in page.text.replace("\N{RIGHT SINGLE QUOTATION MARK}", "'")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_says_its_options(command, site, pages):
    page = pages[site / "commands.html"]
    module = COMMANDS[command][0].removesuffix(".__main__").lstrip(".")
    assert f"{module}-help" in page.anchors


def test_the_search_has_the_text_of_every_page_for_its_excerpts(site):
    script = (site / "_static" / "texts.js").read_text(encoding="utf-8")
    texts = json.loads(script.removeprefix("const PAGE_TEXTS = ").rstrip(";\n"))
    assert set(texts) == {f"{path.relative_to(site).with_suffix('')}.html" for path in site.rglob("*.html")} - {
        "genindex.html",
        "search.html",
        "py-modindex.html",
    }
    assert all('role="main"' in text for text in texts.values())
    assert "along a screw, at" in texts["glossary.html"]


@pytest.mark.usefixtures("site")
def test_what_sphinx_warns_of_is_an_error_and_the_site_before_stays(tmp_path, monkeypatch, capfd):
    def with_a_broken_link(folder):
        folder.mkdir()
        (folder / "index.md").write_text("# Home\n\n[Nowhere](missing.md)\n")
        return folder

    before = tmp_path / "site"
    before.mkdir()
    for name in ("index.html", ".buildinfo"):
        (before / name).write_text("before")
    monkeypatch.setattr(build_site, "stage", with_a_broken_link)
    assert build_site.main(["--output", str(before)]) == 1
    assert "missing.md" in capfd.readouterr().err
    assert {path.name: path.read_text() for path in before.iterdir()} == {
        "index.html": "before",
        ".buildinfo": "before",
    }
    assert list(tmp_path.iterdir()) == [before]


@pytest.mark.usefixtures("site")
def test_a_folder_that_is_no_site_is_left_alone(tmp_path, capsys):
    (tmp_path / "thesis.md").write_text("years of work")
    assert build_site.main(["--output", str(tmp_path)]) == 2
    assert str(tmp_path) in capsys.readouterr().err
    assert (tmp_path / "thesis.md").read_text() == "years of work"
