"""Fixtures for tests of the pipeline: the output folder."""

from pathlib import Path

import pytest


@pytest.fixture
def output(tmp_path: Path) -> Path:
    return tmp_path / "out"
