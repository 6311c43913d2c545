"""Runs of compare.py in tests: a recording that is done in no time, and what two output folders must have in common."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def write_toss(path: Path, samples: int = 60) -> Path:
    """Write a piece of a generated motion, 90 samples a second."""
    lines = (ROOT / "assets" / "throw.csv").read_text().splitlines()
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines[:1] + lines[90 : 91 + samples]))
    return path


def outputs(folder: Path) -> dict[str, bytes]:
    """All that is the same each time: a report has its date, and a .blend has addresses of memory in it."""
    return {
        str(path.relative_to(folder)): path.read_bytes() if path.suffix in (".csv", ".mp4") else b""
        for path in folder.rglob("*")
        if path.is_file()
        and path.relative_to(folder).parts[0] not in (".parts", ".workplan", ".rigid-motion", "manifest.json")
    }
