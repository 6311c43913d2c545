"""Tests that the drawings in docs/ are up to date with their scripts."""

import runpy
import sys
from pathlib import Path

import pytest

from rigid_motion_batch import files

pytestmark = pytest.mark.once

DOCS = Path(__file__).resolve().parents[1] / "docs"


@pytest.mark.parametrize("script", sorted(DOCS.glob("draw_*.py")), ids=lambda script: script.stem)
def test_a_drawing_is_what_its_script_draws(script, monkeypatch):
    drawn = {}
    monkeypatch.setattr(files, "write_text", drawn.__setitem__)
    monkeypatch.setattr(sys, "path", [str(DOCS), *sys.path])
    runpy.run_path(str(script), run_name="__main__")
    assert drawn
    assert {path: path.read_text(encoding="utf-8") for path in drawn} == drawn
