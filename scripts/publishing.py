"""What scripts that measure do with their pages of Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path


def publish(lines: Sequence[str], output: Path | None) -> None:
    """Print a page, and write it to a file where one is given."""
    page = "\n".join(lines)
    print(page)
    if output:
        output.write_text(page, encoding="utf-8", newline="\n")
