"""Words that pages of studies have in common."""

from __future__ import annotations

from collections.abc import Sequence

UPDATES_IN_THE_PAPER = {"30": "20", "20": "10", "15": "7", "12": "5"}
"""The paper's table: updates a second under its state of the art, and those that it found to look the same."""


def listed(words: Sequence[str]) -> str:
    """Return words as prose lists them: "5, 10 and 15"."""
    return " and ".join(filter(None, (", ".join(words[:-1]), words[-1])))
