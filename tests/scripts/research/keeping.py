"""Checks that a study writes the figures that pages read: with the same names and places as the stored figures."""

import json
from pathlib import Path
from typing import Any

from research.pages import FIGURES, ROOT


def names(value: Any, place: str = "") -> set[str]:
    """Return the paths of all figures; all entries of a list share one path."""
    if isinstance(value, dict):
        return {place}.union(*(names(one, f"{place}.{key}") for key, one in value.items()))
    if isinstance(value, list):
        return {place}.union(*(names(item, f"{place}[]") for item in value))
    return {place}


def written(root: Path, name: str) -> dict[str, Any]:
    """Return the figures that a study wrote into a folder, after checking their names against the stored ones."""
    new, kept = (json.loads((folder / FIGURES / f"{name}.json").read_text(encoding="utf-8")) for folder in (root, ROOT))
    assert names(new) ^ names(kept) == set()
    return new
