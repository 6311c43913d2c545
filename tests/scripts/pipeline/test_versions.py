"""Tests of step versions: a task runs again if the code that its step may use changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigid_motion_batch import places
from rigid_motion_batch.pipeline.steps import Task, digest_of
from tests.scripts.pipeline.plans import task
from tests.scripts.pipeline.steps import Write


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder that stands for the program, with two rooms (folders of modules)."""
    monkeypatch.setattr(places, "place_of", lambda name: tmp_path / name)
    digest_of.cache_clear()
    (tmp_path / "measuring" / "deep").mkdir(parents=True)
    (tmp_path / "drawing").mkdir()
    return tmp_path


def in_rooms(*rooms: str) -> Task:
    digest_of.cache_clear()

    class Measure(Write, rooms=rooms):
        pass

    return task("a", Measure("1"), publish={})


def test_a_change_in_a_room_redoes_the_steps_that_use_it_and_no_others(room: Path) -> None:
    inner = room / "measuring" / "deep" / "one.py"
    inner.write_text("1")
    before, other = in_rooms("measuring").key, in_rooms("drawing").key
    inner.write_text("2")
    (room / "measuring" / "__pycache__").mkdir()
    assert in_rooms("measuring").key != before
    assert in_rooms("drawing").key == other
    (room / "measuring" / "__pycache__" / "one.pyc").write_text("")
    inner.write_text("1")
    assert in_rooms("measuring").key == before


@pytest.mark.parametrize("change", ["added", "removed", "renamed"])
def test_files_that_come_and_go_change_a_room(room: Path, change: str) -> None:
    template = room / "measuring" / "page.html"
    template.write_text("1")
    before = in_rooms("measuring").key
    if change == "added":
        (room / "measuring" / "chart.json").write_text("")
    elif change == "removed":
        template.unlink()
    else:
        template.rename(template.with_name("other.html"))
    assert in_rooms("measuring").key != before
