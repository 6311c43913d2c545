"""Fill in the pages in docs/ with the results of studies: docs/figures/NAME.json is the variable `NAME` in a page.

    python scripts/research pages
    python scripts/research pages --check

A page of figures is rendered (Jinja2) from the template of the same name in docs/templates/. Other pages quote a few
figures: the text between `<!--= EXPRESSION -->` and `<!-- end -->` is the expression's value. Tables that such a page
quotes are macros in docs/templates/quotes.md.
"""

from __future__ import annotations

import argparse
import json
import platform
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import jinja2
import numpy as np

from rigid_motion_batch.files import write_text
from rigid_motion_batch.report.numbers import digits, listed, percent

ROOT = Path(__file__).resolve().parents[2]
FIGURES, TEMPLATES = "docs/figures", "docs/templates"
QUOTE = re.compile(r"(<!--= (.+?) -->)(.*?)(<!-- end -->)", re.DOTALL)


def write_figures(name: str, figures: Any, command: str, root: Path = ROOT, **versions: object) -> Path:
    """Write the results of a study to docs/figures/NAME.json, and return the file's path.

    Parameters
    ----------
    name : str
    figures : dict
        Numbers, texts, and lists and dictionaries of them. Numbers get six significant digits; NaN becomes null.
    command : str
        The command that made them; folders are removed from its paths.
    root : Path
        The checkout.
    **versions
        Versions of programs that the figures depend on, besides Python and NumPy.
    """
    versions |= {"Python": platform.python_version(), "NumPy": np.__version__}
    machine = [*(f"{program} {version}" for program, version in versions.items()), platform.system()]
    words = (Path(word).name if word.startswith(("/", "..")) else word for word in command.split(" "))
    made_by = f"`{' '.join(words)}`: {', '.join(machine)} {platform.machine()}"
    path = root / FIGURES / f"{name}.json"
    write_text(path, json.dumps({"made_by": made_by, **as_json(figures)}, indent=1, allow_nan=False) + "\n")
    return path


def as_json(value: Any) -> Any:
    """Return a value that JSON can represent."""
    if isinstance(value, dict):
        return {str(key): as_json(item) for key, item in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [as_json(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{value:.6g}") if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


# -- filters: how pages write figures ----------------------------------------------------------------------------------


def spread(values: Iterable[float], decimals: int = 0, factor: float = 1.0) -> str:
    """Return the minimum and maximum, times a factor: "4 to 7"; a single number if both have the same text."""
    values = [factor * value for value in values]
    return " to ".join(dict.fromkeys(f"{value:.{decimals}f}" for value in (min(values), max(values))))


def rest(shares: Iterable[float | None]) -> list[float | None]:
    """Return 1 minus each fraction; None stays None."""
    return [None if share is None else 1.0 - share for share in shares]


def less(share: float, word: str = "less", decimals: int = 0) -> str:
    """Return a saved fraction as text: "3 % less"; a negative one is an increase: "3 % more"."""
    percents = round(100.0 * share, decimals)
    return f"{abs(percents):.{decimals}f}\N{NO-BREAK SPACE}% {'more' if percents < 0.0 else word}".rstrip()


def alike(shares: Iterable[float], word: str = "less") -> str:
    """Return saved fractions as one text: "33, 50 and 53 % less"."""
    texts = [less(share, word) for share in shares]
    numbers, units = zip(*(text.split("\N{NO-BREAK SPACE}") for text in texts), strict=True)
    return f"{listed(numbers)}\N{NO-BREAK SPACE}{units[0]}" if len(set(units)) == 1 else listed(texts)


def each(values: Iterable[float], form: str = "{:.2f}", factor: float = 1.0) -> list[str]:
    """Return numbers, times a factor, formatted with `form`; a dash for None."""
    return ["\N{EN DASH}" if value is None else form.format(factor * value) for value in values]


FILTERS = (alike, digits, each, less, listed, percent, rest, spread)


# -- pages -------------------------------------------------------------------------------------------------------------


def environment(root: Path = ROOT) -> jinja2.Environment:
    """Return the Jinja2 environment of the templates, with all figures as globals."""
    result = jinja2.Environment(
        loader=jinja2.FileSystemLoader(root / TEMPLATES),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    result.filters |= {function.__name__: function for function in FILTERS}
    for path in (root / FIGURES).glob("*.json"):
        result.globals[path.stem] = json.loads(path.read_text(encoding="utf-8"))
    if (root / TEMPLATES / "quotes.md").exists():
        result.globals["quotes"] = result.get_template("quotes.md").module
    return result


def pages(root: Path = ROOT) -> list[Path]:
    """Return the pages that are rendered from templates, or that may quote figures."""
    named = {path.name for path in (root / TEMPLATES).glob("*.md")} - {"quotes.md"}
    return sorted({root / "README.md", *(root / "docs").glob("*.md"), *(root / "docs" / name for name in named)})


def filled(path: Path, templates: jinja2.Environment) -> str:
    """Return the text of a page with its figures filled in."""
    if path.parent.name == "docs" and path.name in templates.list_templates():
        return templates.get_template(path.name).render()
    page = path.read_text(encoding="utf-8")
    return QUOTE.sub(
        lambda match: f"{match[1]}{templates.from_string(f'{{{{ {match[2]} }}}}').render()}{match[4]}", page
    )


def main(arguments: list[str]) -> int:
    """Fill in all pages; with --check, print those that would change, and return 1 if any."""
    parser = argparse.ArgumentParser("research pages", description=__doc__.partition("\n")[0])
    parser.add_argument("--check", action="store_true", help="change nothing, and print the pages that would change")
    check, templates, changed = parser.parse_args(arguments).check, environment(), []
    for path in pages():
        page = filled(path, templates)
        if not path.exists() or page != path.read_text(encoding="utf-8"):
            changed.append(path.name)
            if not check:
                write_text(path, page)
    print("\n".join(changed) or "All pages have the figures of their studies.")
    return int(check and bool(changed))
