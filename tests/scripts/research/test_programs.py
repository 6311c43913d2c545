"""Tests that every study and benchmark of `python scripts/research` exists."""

from importlib import import_module

import pytest

from rigid_motion_batch.cli.commands import RESEARCH


@pytest.mark.blender
@pytest.mark.parametrize("module", RESEARCH.values())
def test_it_can_be_started(module: str) -> None:
    assert callable(import_module(f"research.{module}").main)
