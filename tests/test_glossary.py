"""Tests of the glossary's list of entries, and of links between the pages of the checkout."""

import re
from pathlib import Path

import pytest

pytestmark = pytest.mark.once

ROOT = Path(__file__).resolve().parents[1]
GLOSSARY = ROOT / "docs" / "glossary.md"
PAGES = sorted(page for folder in (".", "docs", "assets", "examples/*") for page in ROOT.glob(f"{folder}/*.md"))


def anchors(page: str) -> list[str]:
    """Return the anchors of the headings of a page, as GitHub and MyST make them."""
    headings = re.findall(r"^#+ (.+)$", page, re.MULTILINE)
    return [re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings]


def links(page: str) -> list[str]:
    """Return the links of a page to other pages of the checkout, or to places on it."""
    result = re.findall(r"\]\(([^)\s]+)\)", page)
    return [link for link in result if not re.match(r"[a-z]+:", link)]


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_links_lead_to_files_and_headings_that_exist(path: Path):
    page = path.read_text(encoding="utf-8")
    for link in links(page):
        name, _, place = link.partition("#")
        target = path.parent / name if name else path
        assert target.exists(), link
        if place:
            assert place in anchors(target.read_text(encoding="utf-8")), link


def test_the_glossary_lists_all_of_its_entries_in_order():
    page = GLOSSARY.read_text(encoding="utf-8")
    listed, *groups = re.split(r"^## .+$", page, flags=re.MULTILINE)
    rows = re.findall(r"^- \*\*(.+?)\*\*: ((?:.|\n(?!-))+)", listed, re.MULTILINE)
    assert [name for name, _ in rows] == re.findall(r"^## (.+)$", page, re.MULTILINE)
    for (name, row), group in zip(rows, groups, strict=True):
        entries = anchors(group)
        assert [link.removeprefix("#") for link in links(row)] == entries, name
        assert entries == sorted(entries), name
