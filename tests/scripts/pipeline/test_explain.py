"""Why a task would be done."""

from __future__ import annotations

from pathlib import Path

import pytest

from rigid_motion_batch import places
from rigid_motion_batch.pipeline.executors import Executor
from rigid_motion_batch.pipeline.running import explain
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, Task, digest_of
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline import steps
from tests.scripts.pipeline.plans import joining, run, run_in, task, writing
from tests.scripts.pipeline.steps import Write


def explained(output: Path, *tasks: Task) -> dict[str, str]:
    store = Store(output)
    return {task.name: reason for task, reason in explain(lambda: tasks, store)}


def two(text: str = "1") -> tuple[Task, Task]:
    first = writing("a", text)
    return first, joining("b", first)


def test_what_was_never_done_is_said_to_be_and_nothing_is_written(output: Path) -> None:
    assert explained(output, *two()) == {"a": "never done", "b": "never done"}
    assert not output.exists()
    run_in(output, *two())
    assert explained(output, *two()) == {}


def test_what_changed_is_named(output: Path) -> None:
    run_in(output, *two())
    assert explained(output, *two("2")) == {"a": "parameters changed", "b": "earlier tasks changed"}
    first = writing("a", "2")
    assert explained(output, first, task("b", Write("3"), first))["b"] == "parameters, earlier tasks changed"


def test_what_was_made_without_a_task_that_had_failed_is_said_to_be(output: Path) -> None:
    good, failing = writing("a"), task("b", steps.Fail())
    tasks = good, failing, task("c", steps.Report(), good, failing)
    run_in(output, *tasks)
    assert explained(output, *tasks) == {"b": "never done", "c": "an earlier task failed the last time"}


def test_a_changed_file_is_named(output: Path, tmp_path: Path) -> None:
    source = tmp_path / "in.csv"
    source.write_text("1")

    def copying(store: Store) -> Task:
        return task("a", steps.Copy(), inputs=store.inputs(source))

    with Store(output) as store:
        run(lambda: [copying(store)], store, Executor())
    source.write_text("2")
    store = Store(output)
    assert [reason for _, reason in explain(lambda: [copying(store)], store)] == ["inputs changed"]


def test_files_that_are_missing_or_edited_are_named(output: Path) -> None:
    run_in(output, *two())
    (output / "a.txt").unlink()
    (output / "b.txt").unlink()
    (output / "b.txt").write_text("mine")
    reason = "missing, edited or of something else"
    assert explained(output, *two()) == {"a": f"a.txt {reason}", "b": f"b.txt {reason}"}


def test_a_damaged_result_is_named(output: Path) -> None:
    hidden = task("a", Write("1"), publish={})
    run_in(output, hidden)
    (path,) = (output / OWN_FOLDER).glob("results/*/out.txt")
    path.unlink()
    assert explained(output, hidden) == {"a": "its result is damaged"}


@pytest.fixture
def room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A room of the program."""
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


def test_a_change_in_a_room_redoes_the_steps_that_use_it_and_no_others(room: Path, output: Path) -> None:
    inner = room / "measuring" / "deep" / "one.py"
    inner.write_text("1")
    before, other = in_rooms("measuring"), in_rooms("drawing")
    run_in(output, before)
    inner.write_text("2")
    (room / "measuring" / "__pycache__").mkdir()
    assert in_rooms("measuring").key != before.key
    assert in_rooms("drawing").key == other.key
    assert explained(output, in_rooms("measuring")) == {"a": "program changed"}
    (room / "measuring" / "__pycache__" / "one.pyc").write_text("")
    inner.write_text("1")
    assert in_rooms("measuring").key == before.key


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


def test_a_room_that_does_not_exist_is_an_error() -> None:
    with pytest.raises(FileNotFoundError):
        digest_of(places.place_of("kitchen"))
