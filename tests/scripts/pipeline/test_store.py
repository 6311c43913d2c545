"""Tests of the output folder: foreign files are never replaced, damage and changed code are noticed."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from filelock import SoftFileLock

from rigid_motion_batch import places
from rigid_motion_batch.pipeline import steps as pipeline_steps
from rigid_motion_batch.pipeline.executors import Executor
from rigid_motion_batch.pipeline.steps import OWN_FOLDER, RunError, Task, digest_of
from rigid_motion_batch.pipeline.store import Store
from tests.scripts.pipeline import steps
from tests.scripts.pipeline.plans import contents, joining, run, run_in, states, task, writing
from tests.scripts.pipeline.steps import FILE, Write


def whole() -> tuple[Task, Task, Task]:
    first, second = writing("a", "1"), writing("b", "2")
    return first, second, joining("c", first, second)


def copying(output: Path, source: Path, name: str = "a", **options: object) -> dict[str, int]:
    """Run a task that reads a file."""
    with Store(output, **options) as store, Executor() as executor:
        return states(run(lambda: [task(name, steps.Copy(), inputs=store.inputs(source))], store, executor))


@pytest.mark.parametrize("overwrite", [True, False])
def test_folders_where_files_go_and_files_where_folders_go_stay(output: Path, overwrite: bool) -> None:
    (output / "c.txt").mkdir(parents=True)
    with pytest.raises(RunError, match="a folder where a file goes"):
        run_in(output, *whole(), overwrite=overwrite)
    (output / "c.txt").rmdir()
    (output / "d").write_text("mine")
    with pytest.raises(RunError, match="a file where a folder goes"):
        run_in(output, writing("d", publish={FILE: "d/e.txt"}), overwrite=overwrite)
    assert contents(output) == {"d": "mine"}


@pytest.mark.parametrize("overwrite", [True, False])
@pytest.mark.parametrize("link", ["none", "hard", "symbolic"])
def test_an_input_is_never_replaced(output: Path, link: str, overwrite: bool) -> None:
    output.mkdir()
    source = output / "a.txt"
    source.write_text("recorded")
    given = source if link == "none" else output / "given.txt"
    if link != "none":
        os.link(source, given) if link == "hard" else given.symlink_to(source)
    with pytest.raises(RunError, match="this input lies where"):
        copying(output, given, overwrite=overwrite)
    assert source.read_text() == "recorded"


def test_what_this_program_wrote_is_no_input_of_the_next_run(output: Path, tmp_path: Path) -> None:
    run_in(output, *whole())
    with pytest.raises(RunError, match="this input was written by a run into this folder"):
        copying(output, output / "c.txt", "d")
    (tmp_path / "linked").symlink_to(output / "c.txt")
    with pytest.raises(RunError, match="this input was written by a run into this folder"):
        copying(output, tmp_path / "linked", "d")
    with pytest.raises(RunError, match="this input was written by a run into this folder"):
        copying(output, next((output / OWN_FOLDER).glob("results/*/out.txt")), "d")
    assert copying(tmp_path / "other", output / "c.txt", "d") == {"done": 1}


@pytest.mark.parametrize("path", ["../a", "{}/a", "a/../../b", "link/a.txt"])
def test_no_path_and_no_link_leads_out_of_the_folder(output: Path, tmp_path: Path, path: str) -> None:
    output.mkdir()
    (output / "link").symlink_to(tmp_path)
    outcome = run_in(output, writing("a", publish={FILE: path.format(tmp_path)}))
    assert "leads out of the output folder" in outcome.failures["a"]
    assert os.listdir(tmp_path) == ["out"]


def test_a_link_where_a_file_goes_is_a_strangers_and_its_target_stays(output: Path, tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine")
    output.mkdir()
    (output / "a.txt").symlink_to(tmp_path / "precious")
    with pytest.raises(RunError, match="was not written by this program"):
        run_in(output, *whole())
    run_in(output, *whole(), overwrite=True)
    assert (tmp_path / "precious").read_text() == "mine"
    assert not (output / "a.txt").is_symlink()


def test_without_links_files_are_copied(output: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def none(*_: object) -> None:
        raise OSError(1, "no links here")

    monkeypatch.setattr(os, "link", none)
    run_in(output, *whole())
    assert states(run_in(output, *whole())) == {"up to date": 3}
    (output / "c.txt").write_text("edited")
    with pytest.raises(RunError):
        run_in(output, *whole())


def replaced_by_pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def replaced_by_folder(path: Path) -> None:
    path.unlink()
    (path / "inner").mkdir(parents=True)


def cut(path: Path) -> None:
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])


def nonsense(path: Path) -> None:
    path.write_text('{"files": {"a\\u0000": [1, 2, 3]}, "name": 7, "path": [], "key": {}}\n"x"\n{"name": "a"}\n')


DAMAGES = (Path.unlink, cut, nonsense)

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no pipes and devices among its files")


@needs_pipes
@pytest.mark.parametrize(
    ("part", "damage"),
    [
        *(("results/*/out.txt", damage) for damage in (*DAMAGES, replaced_by_folder, replaced_by_pipe)),
        *(("results/*/.index.json", damage) for damage in DAMAGES),
    ],
)
def test_a_damaged_result_is_made_again(output: Path, damage: Callable[[Path], None], part: str) -> None:
    hidden = task("hidden", Write("1"), publish={})
    run_in(output, hidden)
    (path,) = (output / OWN_FOLDER).glob(part)
    damage(path)
    assert states(run_in(output, hidden, joining("c", hidden))) == {"done": 2}
    assert contents(output) == {"c.txt": "1"}
    assert states(run_in(output, hidden, joining("c", hidden))) == {"up to date": 2}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("part", ["inputs.json", "published/*.jsonl"])
def test_whatever_becomes_of_its_records_the_work_goes_on(output, tmp_path, damage, part):
    source = tmp_path / "in.csv"
    source.write_text("1")
    copying(output, source)
    (path,) = (output / OWN_FOLDER).glob(part)
    damage(path)
    assert copying(output, source) == {"up to date": 1}


def rewritten(path: Path, content: str) -> None:
    """Change a file's content, keeping its size and time."""
    status = path.stat()
    assert len(content) == status.st_size
    path.write_text(content)
    os.utime(path, ns=(status.st_atime_ns, status.st_mtime_ns))


def test_old_results_that_nobody_asks_for_go(output: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run_in(output, *whole())
    run_in(output, writing("a", "other"))
    assert len(os.listdir(output / OWN_FOLDER / "results")) == 4
    week = time.time() + 8 * 86400
    monkeypatch.setattr(time, "time", lambda: week)
    run_in(output, writing("a", "third"), *whole()[1:2])
    assert len(os.listdir(output / OWN_FOLDER / "results")) == 2


def test_two_runs_in_one_folder_are_refused_but_for_workers_with_a_part(output: Path) -> None:
    with Store(output):
        with pytest.raises(RunError, match="another run is at work in this folder"):
            run_in(output, writing("a"))
        assert states(run_in(output, writing("a"), alone=False)) == {"done": 1}
    assert states(run_in(output, writing("b"))) == {"done": 1}


@needs_pipes
def test_an_input_that_is_no_file_has_no_digest_and_is_not_waited_for(output: Path, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "device").symlink_to("/dev/zero")
    (tmp_path / "folder").mkdir()
    sources = [str(tmp_path / name) for name in ("pipe", "device", "folder", "NUL\0")]
    assert Store(output).inputs(*sources) == dict.fromkeys(sources, "")


def test_the_digest_of_an_input_is_kept_until_it_changes(output, tmp_path, monkeypatch):
    source = tmp_path / "in.csv"
    source.write_text("1")
    os.utime(source, (1e9, 1e9))
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + 10.0)
    copying(output, source)
    hashed: list[str] = []
    monkeypatch.setattr(
        "rigid_motion_batch.pipeline.store.sha256_in",
        lambda path: hashed.append(str(path)) or pipeline_steps.sha256_in(path),
    )
    assert copying(output, source) == {"up to date": 1}
    assert hashed == []
    source.touch()
    assert copying(output, source) == {"up to date": 1}
    rewritten(source, "2")
    assert copying(output, source) == {"done": 1}
    assert str(source) in hashed


def test_a_file_without_a_task_that_publishes_it_any_more_can_be_withdrawn(output: Path) -> None:
    run_in(output, *whole(), writing("d", publish={FILE: "d/e.txt"}))
    (output / "b.txt").write_text("edited")
    with Store(output) as store:
        store.withdraw(["a.txt", "b.txt", "d/e.txt", "none.txt"])
    assert sorted(os.listdir(output)) == [OWN_FOLDER, "b.txt", "c.txt"]


def test_a_folder_for_nothing_is_gone_where_a_lock_that_is_held_cannot_be_deleted(output, monkeypatch) -> None:
    """As on Windows, where the lock is deleted on release."""
    plain = os.unlink

    def unlink(path: str, **options: object) -> None:
        if Path(path).name == "lock" and store._lock.is_locked:
            raise PermissionError(path)
        plain(path, **options)

    monkeypatch.setattr("rigid_motion_batch.pipeline.store.FileLock", SoftFileLock)
    monkeypatch.setattr(os, "unlink", unlink)
    with Store(output) as store:
        pass
    assert not output.exists()


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
