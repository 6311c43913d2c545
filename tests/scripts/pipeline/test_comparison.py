"""A comparison as a plan: what it makes, and what is done again when something changes."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.analysis.choices import Choice, Tolerance, Uniform
from rigid_motion_batch.pipeline import values
from rigid_motion_batch.pipeline.comparison import Comparison, ComparisonPlan
from rigid_motion_batch.pipeline.comparison_steps import result_in
from rigid_motion_batch.pipeline.executors import Executor, ProcessExecutor
from rigid_motion_batch.pipeline.running import Run
from rigid_motion_batch.pipeline.steps import OWN, Task
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.report.settings import Settings
from rigid_motion_batch.scenes.settings import SceneSettings
from tests.scripts.bvh_bodies import write_body
from tests.scripts.clips.recordings import compare_clip
from tests.scripts.comparing import write_toss
from tests.scripts.pipeline.plans import Listener, Watched, half_written, run, states
from tests.thoroughness import THOROUGH

ROOT = Path(__file__).resolve().parents[3]

STAGE = SceneSettings(resolution=(64, 36), fps=10)

ABOUT = Settings(0.1, "Rigid Motion", "compare toss.csv", details={"Videos": "small"})


def planned(*sources: Path, **fields: object) -> Comparison:
    modes = ("lerp_slerp", "motor_spline")
    comparison = Comparison(tuple(map(str, sources)), (Uniform("5"), Uniform("10")), modes, blender="this")
    return replace(comparison, **fields)


def compared(
    output: Path, comparison: Comparison, executor: Executor | None = None, **options: object
) -> tuple[Run, Listener]:
    """Run a comparison in a folder."""
    listener = Listener()
    of_store = {name: options.pop(name) for name in ("alone", "overwrite") if name in options}
    with Watched(output, **of_store) as store, executor or Executor() as opened:
        plan = ComparisonPlan(comparison, store)
        outcome, notes = run(plan.reading, store, opened, progress=listener, **options), plan.look_into()
        listener.notes += notes
        later = run(plan.tasks, store, opened, progress=listener, **options)
        listener.made = store.made
    later.failures = outcome.failures | later.failures
    return later, listener


def published(folder: Path) -> dict[str, bytes]:
    """What is the same each time: a page has its date, and a .blend has addresses of memory in it."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.suffix in (".csv", ".mp4") else b""
        for path in folder.rglob("*")
        if path.is_file() and OWN not in path.relative_to(folder).parts
    }


@pytest.fixture
def toss(tmp_path: Path) -> Path:
    return write_toss(tmp_path / "clips" / "toss.csv")


def test_tables_are_published_and_their_numbers_are_those_of_the_analysis(output: Path, toss: Path) -> None:
    comparison = planned(toss, count_keys=True)
    outcome, _ = compared(output, comparison)
    assert states(outcome) == {"up to date": 1, "done": 5}
    tables = ("lerp_slerp.csv", "motor_spline.csv", "keys.csv")
    assert {*published(output)} == {
        *("metrics.csv", "keys_needed.csv"),
        *(f"toss/{choice}/{table}" for choice in ("5", "10") for table in tables),
    }
    ((clip,), _) = read_clips([str(toss)], None)
    rows = (output / "metrics.csv").read_text().splitlines()[1:]
    expected = [
        row
        for choice in comparison.choices
        for row in compare_clip(clip, choice, comparison.modes, comparison.radii).rows
    ]
    assert [row.split(",")[:2] for row in rows] == [["toss", row.mode] for row in expected]
    assert all(repr(row.rms_shell_m) in line for row, line in zip(expected, rows, strict=True))


@pytest.mark.parametrize("choice", [Uniform("10"), Tolerance("2cm")])
@pytest.mark.parametrize("body", [False, True])
def test_what_is_kept_of_a_clip_is_what_was_found(tmp_path: Path, toss: Path, choice: Choice, body: bool) -> None:
    source = tmp_path / "body.bvh" if body else toss
    if body:
        write_body(source)
    ((clip,), _) = read_clips([str(source)], None)
    result = compare_clip(clip, choice, ("lerp_slerp", "motor_spline"), planned(source).radii)
    values.write(tmp_path / "result", result)
    read = result_in(tmp_path)
    assert (read.choice, read.first, read.rows, read.joints) == (
        result.choice,
        result.first,
        result.rows,
        result.joints,
    )
    for one, other in zip(read.motions, result.motions, strict=True):
        assert one.modes == other.modes
        np.testing.assert_array_equal(one.errors, other.errors)
        np.testing.assert_array_equal(one.poses.positions, other.poses.positions)
    for mode, keys in result.keys.items():
        for one, other in zip(read.keys[mode], keys, strict=True):
            np.testing.assert_array_equal(one, other)
    values.write(tmp_path / "clip", clip)
    again = values.read(Clip, tmp_path / "clip")
    np.testing.assert_array_equal(again.poses.quaternions, clip.poses.quaternions)
    assert (again.axes, again.warnings, again.repairs) == (clip.axes, clip.warnings, clip.repairs)
    if body:
        assert again.rest_body.joints == clip.rest_body.joints
        np.testing.assert_array_equal(again.rest_body.rest.positions, clip.rest_body.rest.positions)


@pytest.mark.slow
def test_a_film_and_a_page_of_a_clip(output: Path, toss: Path) -> None:
    comparison = planned(toss, stage=STAGE, about=ABOUT)
    outcome, listener = compared(output, comparison, ProcessExecutor(2))
    assert outcome.failures == {}
    assert {"toss/5/comparison.mp4", "toss/5/comparison.blend", "report.html"} <= {*published(output)}
    assert "toss/5/comparison.mp4" in (output / "report.html").read_text()
    assert any(doing.startswith("render toss/5 from 1") for _, doing in listener.reached)
    assert listener.reached[-1][0] == listener.total
    _, again = compared(output, comparison)
    assert again.made == []
    _, other = compared(output, replace(comparison, about=replace(ABOUT, command="compare ./toss.csv")))
    assert {*other.made} == {"report.html"}
    _, lighter = compared(output, replace(comparison, stage=replace(STAGE, theme="light")))
    assert {*lighter.made} == {"build toss/5", "render toss/5 from 1", "encode toss/5", "report.html"}


def test_a_page_may_be_made_before_its_films(output: Path, toss: Path) -> None:
    comparison = planned(toss, stage=STAGE, about=ABOUT)
    with Store(output) as store, Executor() as executor:
        plan = ComparisonPlan(comparison, store)
        run(plan.reading, store, executor)
        plan.look_into()
        assert run(lambda: plan.tasks(films=False), store, executor).failures == {}
    assert not (output / "toss/5/comparison.mp4").exists()
    assert "toss/5/comparison.mp4" in (output / "report.html").read_text()


@pytest.mark.slow
def test_a_whole_body_has_joints_and_films(output: Path, tmp_path: Path) -> None:
    write_body(body := tmp_path / "body.bvh")
    outcome, _ = compared(output, planned(body, choices=(Tolerance("2cm"),), stage=STAGE, about=ABOUT, count_keys=True))
    assert outcome.failures == {}
    folder = "body/tolerance-2cm"
    assert {*published(output)} == {
        *("metrics.csv", "metrics_joints.csv", "keys_needed.csv", "report.html"),
        *(f"{folder}/{name}" for name in ("lerp_slerp.keys.csv", "motor_spline.keys.csv")),
        *(f"{folder}/{name}" for name in ("comparison.blend", "comparison.mp4")),
    }


def test_more_clips_than_fit_on_a_page_have_a_page_each(
    output: Path, toss: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rigid_motion_batch.pipeline.comparison.ON_ONE_PAGE", 1)
    other = write_toss(toss.with_name("other.csv"), samples=50)
    outcome, _ = compared(output, planned(toss, other, about=ABOUT))
    assert outcome.failures == {}
    assert {"report.html", "toss/report.html", "other/report.html"} <= {*published(output)}
    assert "other/report.html" in (output / "report.html").read_text()


def test_one_bad_clip_stops_nobody(output: Path, toss: Path) -> None:
    bad, short = toss.with_name("bad.csv"), write_toss(toss.with_name("short.csv"), samples=3)
    bad.write_text("nonsense")
    outcome, listener = compared(output, planned(bad, toss, short, toss.with_name("none.csv"), about=ABOUT))
    assert sorted(outcome.failures) == [f"read {bad}", f"read {toss.with_name('none.csv')}"]
    assert all("\n" not in said for said in outcome.failures.values())
    assert "short: too short for two keys at 5 a second; left out" in listener.notes
    assert (output / "report.html").exists()
    assert (output / "toss/10/keys.csv").exists()


def test_a_source_that_is_given_twice_is_read_and_measured_under_two_names(output: Path, toss: Path) -> None:
    outcome, listener = compared(output, planned(toss, toss))
    assert outcome.failures == {}
    assert sum(name.startswith("read ") for name in listener.made) == 1
    assert {"toss/5/keys.csv", "toss-2/5/keys.csv"} <= {*published(output)}


@pytest.mark.parametrize(
    ("change", "redone"),
    [
        ({"choices": (Uniform("5"), Uniform("15"))}, {"measure toss/15", "metrics.csv"}),
        ({"modes": ("lerp_slerp",)}, {"measure toss/5", "measure toss/10", "metrics.csv"}),
        ({"axes": "unity"}, {"read toss", "measure toss/5", "measure toss/10", "metrics.csv"}),
    ],
)
def test_only_what_an_option_changes_is_done_again(
    output: Path, toss: Path, change: dict[str, object], redone: set[str]
) -> None:
    compared(output, planned(toss))
    _, listener = compared(output, planned(toss, **change))
    assert {name.replace(str(toss), "toss") for name in listener.made} == redone


def test_a_recording_that_was_edited_is_read_and_measured_again(output: Path, toss: Path) -> None:
    compared(output, planned(toss))
    write_toss(toss, samples=70)
    _, listener = compared(output, planned(toss))
    assert len(listener.made) == 4


def garbage(path: Path) -> None:
    """As many other bytes."""
    path.write_bytes(b"[" * path.stat().st_size)


def emptied(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [garbage, emptied])
@pytest.mark.parametrize("part", ["facts.json", "0.json", "0.npz", "0.times.npy", "result.json", "result.npz"])
def test_a_damaged_part_is_made_again(output: Path, toss: Path, part: str, damage: Callable[[Path], None]) -> None:
    comparison = planned(toss, choices=(Uniform("5"),), about=ABOUT)
    compared(output, comparison)
    metrics = (output / "metrics.csv").read_bytes()
    (path,) = (output / OWN / "results").glob(f"*/{part}")
    damage(path)
    for name in ("metrics.csv", "report.html"):
        (output / name).unlink()
    other = replace(comparison, about=replace(ABOUT, command="again"))
    outcome, _ = compared(output, other)
    assert outcome.failures == {}
    assert (output / "metrics.csv").read_bytes() == metrics
    assert (output / "report.html").exists()


# -- whatever is killed -----------------------------------------------------------------------------------------------

RUN = """
import sys
from pathlib import Path
from tests.scripts.pipeline.test_comparison import ABOUT, ProcessExecutor, STAGE, compared, planned

if __name__ == "__main__":
    outcome, _ = compared(
        Path(sys.argv[2]), planned(Path(sys.argv[1]), stage=STAGE, about=ABOUT, every_film=True), ProcessExecutor(2)
    )
    print(outcome.failures)
    sys.exit(bool(outcome.failures))
"""

MOMENTS = int(os.environ.get("RIGID_MOTION_KILLS", "4" if THOROUGH else "2"))
"""How many times a run is killed, half of them the program and half of them one of its workers."""


def start(folder: Path, source: Path, output: Path) -> subprocess.Popen:
    (folder / "run.py").write_text(RUN)
    return subprocess.Popen([sys.executable, folder / "run.py", source, output], stdout=subprocess.PIPE, text=True)


def workers_of(process: int) -> list[int]:
    result = [path.read_text().split() for path in Path(f"/proc/{process}/task").glob("*/children")]
    children = [int(child) for some in result for child in some]
    return [child for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes where Linux shows them")
def test_a_run_that_was_killed_again_and_again_ends_like_one_that_was_not(
    output: Path, toss: Path, tmp_path: Path
) -> None:
    started = time.monotonic()
    undisturbed = start(tmp_path, toss, tmp_path / "undisturbed")
    said, _ = undisturbed.communicate(timeout=300)
    assert undisturbed.returncode == 0, said
    seconds = time.monotonic() - started
    reference = published(tmp_path / "undisturbed")
    assert sum(path.endswith(".mp4") for path in reference) == 2
    chance = random.Random(7)
    for number in range(MOMENTS):
        process = start(tmp_path, toss, output)
        time.sleep(chance.uniform(0.2, 0.9) * seconds)
        workers = workers_of(process.pid)
        if number % 2 and workers:
            os.kill(chance.choice(workers), signal.SIGKILL)
            said, _ = process.communicate(timeout=300)
            assert process.returncode == 0, said
            assert published(output) == reference
        else:
            process.kill()
            process.communicate()
            result = published(output)
            half = [path for path, content in result.items() if content not in (reference.get(path), b"")]
            assert half == [], f"half-written after kill {number}"
    process = start(tmp_path, toss, output)
    said, _ = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert published(output) == reference
    assert half_written(output) == []


# -- many clips -------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_clip_takes_two_kilobytes_at_most_between_two_plans(output: Path, toss: Path) -> None:
    """Ten thousand clips, and Python with the program, are to stay within 200 MB."""
    import tracemalloc

    for number in range(60):
        (toss.parent / f"toss{number}.csv").write_bytes(toss.read_bytes())
    comparison = planned(*(toss.parent / f"toss{number}.csv" for number in range(60)), modes=("lerp_slerp",))
    compared(output, comparison)
    with Store(output) as store:
        plan = ComparisonPlan(comparison, store)
        plan.look_into()
        tracemalloc.start()
        before, _ = tracemalloc.get_traced_memory()
        plan.look_into()
        after, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert len(plan.studies) == 60
    assert (after - before) / 60 < 2000
    assert all(isinstance(task, Task) for task in plan.tasks())


# -- without Blender --------------------------------------------------------------------------------------------------

WITHOUT = """
import sys
from pathlib import Path

sys.modules["bpy"] = sys.modules["mathutils"] = None
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.pipeline.comparison import Comparison, ComparisonPlan
from rigid_motion_batch.report.settings import Settings
from rigid_motion_batch.pipeline.executors import Executor
from rigid_motion_batch.pipeline.running import Run
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.progress import Progress

with Store(Path(sys.argv[2])) as store, Executor() as executor:
    choices, modes = (Tolerance("2cm"),), ("lerp_slerp", "motor_spline")
    about = Settings(0.1, "x", "y")
    plan = ComparisonPlan(Comparison((sys.argv[1],), choices, modes, count_keys=True, about=about), store)
    run = Run(store, executor, Progress(quiet=True))
    run.do(plan.reading)
    plan.look_into()
    run.do(plan.tasks)
sys.exit(str(run.failures) if run.failures else 0)
"""


def test_numbers_and_pages_need_no_blender(output: Path, toss: Path) -> None:
    ended = subprocess.run([sys.executable, "-c", WITHOUT, toss, output], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
    assert {"metrics.csv", "keys_needed.csv", "report.html"} <= {*published(output)}


def test_without_blender_a_page_shows_a_drill_and_a_line_says_so(output: Path, toss: Path) -> None:
    outcome, listener = compared(output, planned(toss, about=ABOUT, subject="controller", blender=""))
    assert outcome.failures == {}
    assert "the report shows a drill, for there is no Blender here that reads controller" in listener.notes
    assert "object controller" not in listener.made
    _, again = compared(output, planned(toss, about=ABOUT, subject="controller"))
    assert {*again.made} == {"object controller", "report.html"}
