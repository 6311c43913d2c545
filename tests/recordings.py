"""Recordings of others, which are not part of the project; they may exist next to the checkout."""

from pathlib import Path

RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "data" / "recordings"
