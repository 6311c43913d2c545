"""Tests that pages contain the figures of their studies."""

import re
from pathlib import Path

import pytest

from research.pages import QUOTE, ROOT, environment, filled, pages, write_figures

TEMPLATES = environment()


@pytest.mark.parametrize("path", pages(), ids=lambda path: path.name)
def test_every_page_has_the_figures_of_the_studies(path: Path):
    assert path.read_text(encoding="utf-8") == filled(path, TEMPLATES), "run python scripts/research pages"


@pytest.mark.parametrize("path", pages(), ids=lambda path: path.name)
def test_every_quote_ends_and_none_begins_a_line_of_a_paragraph(path: Path):
    page = path.read_text(encoding="utf-8")
    assert not re.findall(r"[^\w.\N{EN DASH}][-\N{MINUS SIGN}]\d+(?:\.\d+)? ?%", page), "a negative percentage"
    assert page.count("<!--= ") == page.count("<!-- end -->") == len(QUOTE.findall(page))
    for line in page.splitlines():
        # Markdown treats such a line as HTML, and does not format the rest of it.
        assert not re.match(r"\s*(?:[-*] )?<!-- ?(?:= .+?|end) -->.", line), line


def test_every_template_and_every_file_of_figures_is_used():
    used = "".join(path.read_text(encoding="utf-8") for path in [*pages(), *(ROOT / "docs/templates").glob("*.md")])
    for path in (ROOT / "docs/figures").glob("*.json"):
        assert re.search(rf"\b{path.stem}\b[.[]", used), path.name


def test_a_page_is_its_template_with_figures(tmp_path: Path):
    for folder in ("docs/figures", "docs/templates"):
        (tmp_path / folder).mkdir(parents=True)
    write_figures("found", {"error": 0.01234, "saved": {"a": 0.031, "b": -0.2}}, "x", tmp_path)
    (tmp_path / "docs/templates/page.md").write_text(
        "{% for name, share in found.saved.items() %}\n{{ name }}: {{ share | less }}\n{% endfor %}\n", encoding="utf-8"
    )
    (tmp_path / "docs/templates/quotes.md").write_text(
        "{% macro rows() %}{{ [found.error, 1.0] | each('{:.1f}', 100) | join(' | ') }}{% endmacro %}", encoding="utf-8"
    )
    (tmp_path / "README.md").write_text(
        "It is <!--= found.error | digits(2) -->9<!-- end -->, <!--= quotes.rows() --><!-- end -->", encoding="utf-8"
    )
    templates = environment(tmp_path)
    assert (
        filled(tmp_path / "docs/page.md", templates) == "a: 3\N{NO-BREAK SPACE}% less\nb: 20\N{NO-BREAK SPACE}% more\n"
    )
    assert filled(tmp_path / "README.md", templates) == (
        "It is <!--= found.error | digits(2) -->0.012<!-- end -->, <!--= quotes.rows() -->1.2 | 100.0<!-- end -->"
    )
