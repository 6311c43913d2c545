"""What scripts that measure do with their pages of Markdown."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from research.summaries import with_summary
from rigid_motion_batch.files import write_text


def opening(title: str, command: str, about: str, **versions: object) -> list[str]:
    """The first lines of a page: what was run, on what, and how to read it.

    Parameters
    ----------
    title, command : str
    about : str
        A script's docstring, the last paragraph of which is for the page.
    **versions
        Of what else the figures depend on beside Python and NumPy, by its name.
    """
    everything = {**versions, "Python": platform.python_version(), "NumPy": np.__version__}
    on = [f"{name} {version}" for name, version in everything.items()]
    return [
        f"# {title}",
        "",
        f"`{command}`: {', '.join((*on, platform.system()))} {platform.machine()}.",
        "",
        *about.split("\n\n")[-1].strip().splitlines(),
        "",
        "The [glossary](glossary.md) explains the words.",
        "",
    ]


def more_or_less(ratio: float, decimals: int = 1) -> str:
    """What a ratio is more or less than 1: "7.7% more"."""
    share = f"{abs(ratio - 1.0):.{decimals}%}"
    return f"{share} {'more' if ratio >= 1.0 else 'less'}"


def publish(lines: Sequence[str], output: Path | None, summary: Callable[[str], Sequence[str]]) -> None:
    """Print a page with its summary on top, and write it to a file where one is given."""
    page = "\n".join(lines)
    page = with_summary(page, summary(page))
    print(page)
    if output:
        write_text(output, page)
