"""Whether a study writes what the pages read: figures of the same names, in the same places, as those that are kept."""

import json
from pathlib import Path
from typing import Any

from research.pages import FIGURES, ROOT


def names(value: Any, place: str = "") -> set[str]:
    """Return the places of all figures, of lists as if all their entries were one."""
    if isinstance(value, dict):
        return {place}.union(*(names(one, f"{place}.{key}") for key, one in value.items()))
    if isinstance(value, list):
        return {place}.union(*(names(item, f"{place}[]") for item in value))
    return {place}


def written(root: Path, name: str) -> dict[str, Any]:
    """Return the figures that a study wrote into a folder, which have the names of those that are kept."""
    new, kept = (json.loads((folder / FIGURES / f"{name}.json").read_text(encoding="utf-8")) for folder in (root, ROOT))
    assert names(new) ^ names(kept) == set()
    return new
