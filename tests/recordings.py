"""Other people's recordings, which are not part of the project, and beside the checkout where they are kept at all."""

from pathlib import Path

RECORDINGS = Path(__file__).resolve().parents[2] / "shared" / "data" / "recordings"
