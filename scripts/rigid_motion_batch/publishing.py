"""What scripts that measure do with their pages of Markdown."""

from __future__ import annotations

import platform
from collections.abc import Sequence
from pathlib import Path

import numpy as np

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
    ]


def publish(lines: Sequence[str], output: Path | None) -> None:
    """Print a page, and write it to a file where one is given."""
    page = "\n".join(lines)
    print(page)
    if output:
        write_text(output, page)
