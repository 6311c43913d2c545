"""Tests of a comparison as a plan: its results, and which tasks run again after a change."""

from dataclasses import replace
from pathlib import Path

import pytest

from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.pipeline.comparison import ComparisonPlan
from rigid_motion_batch.pipeline.executors import Executor, ProcessExecutor
from rigid_motion_batch.pipeline.running import DONE, UP_TO_DATE, Run
from rigid_motion_batch.pipeline.steps import Task
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.pipeline.studies import Comparison
from rigid_motion_batch.report.settings import PageSettings
from rigid_motion_batch.scenes.settings import SceneSettings
from tests.scripts.bvh_bodies import TIMES, write_body
from tests.scripts.comparing import outputs, run_without_blender, write_toss
from tests.scripts.pipeline.plans import Listener, Watched, run

ROOT = Path(__file__).resolve().parents[3]

STAGE = SceneSettings(resolution=(64, 36), fps=10)

ABOUT = PageSettings(0.1, "Rigid Motion", "compare toss.csv", details={"Videos": "small"})


def planned(*sources: Path, **fields: object) -> Comparison:
    modes = ("lerp_slerp", "motor_spline")
    comparison = Comparison(tuple(map(str, sources)), (Uniform("5"), Uniform("10")), modes, blender="this")
    return replace(comparison, **fields)


def compared(output: Path, comparison: Comparison, executor: Executor | None = None) -> tuple[Run, Listener]:
    """Run a comparison in a folder."""
    listener = Listener()
    with Watched(output) as store, executor or Executor() as opened:
        plan = ComparisonPlan(comparison, store)
        outcome, notes = run(plan.reading, store, opened, progress=listener), plan.inspect_clips()
        listener.notes += notes
        between = run(plan.measuring, store, opened, progress=listener)
        plan.conclude()
        later = run(plan.tasks, store, opened, progress=listener)
        listener.made = store.made
    later.failures = outcome.failures | between.failures | later.failures
    done = between.counts[DONE]
    later.counts.update({DONE: done, UP_TO_DATE: -done})
    return later, listener


@pytest.fixture
def toss(tmp_path: Path) -> Path:
    return write_toss(tmp_path / "clips" / "toss.csv", 40)


@pytest.mark.blender
@pytest.mark.slow
def test_a_film_and_a_page_of_a_clip(output: Path, toss: Path) -> None:
    comparison = planned(toss, choices=(Uniform("5"),), stage=STAGE, about=ABOUT)
    outcome, listener = compared(output, comparison, ProcessExecutor(2))
    assert outcome.failures == {}
    assert {"toss/5/comparison.mp4", "toss/5/comparison.blend", "report.html"} <= {*outputs(output)}
    assert "toss/5/comparison.mp4" in (output / "report.html").read_text()
    assert any(doing.startswith("render toss/5 from 1") for _, doing in listener.reached)
    assert listener.reached[-1][0] == listener.total
    _, again = compared(output, comparison)
    assert again.made == []
    _, other = compared(output, replace(comparison, about=replace(ABOUT, command="compare ./toss.csv")))
    assert {*other.made} == {"report.html"}
    _, lighter = compared(output, replace(comparison, stage=replace(STAGE, theme="light")))
    assert {*lighter.made} == {"build toss/5", "render toss/5 from 1", "encode toss/5", "report.html"}


def test_films_are_of_the_keys_that_the_verdict_speaks_of(output: Path, toss: Path) -> None:
    choices = Uniform("5"), Uniform("10"), Tolerance("2cm")
    comparison = planned(toss, choices=choices, stage=STAGE)
    with Store(output) as store:
        plan = ComparisonPlan(comparison, store)
        run(plan.reading, store, Executor())
        plan.inspect_clips()
        plan.conclude()
        assert plan.found.verdict is None, "nothing is measured yet"
        run(plan.measuring, store, Executor())
        plan.inspect_clips()
        assert plan.filmed(plan.studies[0]) == [Uniform("5")]
        plan.conclude()
        assert plan.found.spoken_of == {"toss": Tolerance("2cm")}
        assert [task.name for task in plan.tasks() if task.name.startswith("encode")] == ["encode toss/tolerance-2cm"]
        every = ComparisonPlan(replace(comparison, every_film=True), store)
        every.inspect_clips()
        assert every.filmed(every.studies[0]) == [*choices]


def test_films_of_clips_with_a_page_each_are_of_what_that_page_speaks_of(output, toss, monkeypatch):
    monkeypatch.setattr("rigid_motion_batch.pipeline.comparison.ON_ONE_PAGE", 1)
    short = write_toss(toss.with_name("short.csv"), samples=12)
    with Store(output) as store:
        plan = ComparisonPlan(planned(toss, short, stage=STAGE, choices=(Uniform("2"), Uniform("10"))), store)
        for step in (plan.reading, plan.measuring):
            run(step, store, Executor())
            plan.inspect_clips()
        plan.conclude()
        assert {*plan.found.spoken_of} == {"toss", "short"}
        for study in plan.studies:
            assert plan.filmed(study) == [plan.found.spoken_of[study.name]]


def test_a_film_knows_how_far_its_body_slips_in_the_one_that_holds_it(output: Path) -> None:
    with Store(output) as store:
        plan = ComparisonPlan(planned(Path(f"{ROOT / 'assets' / 'hold.csv'}:*"), stage=STAGE), store)
        run(plan.reading, store, Executor())
        plan.inspect_clips()
        tasks = {task.name: task for task in plan.tasks()}
    slip = tasks["slip of hold-tool in hold-hand"].key
    assert slip in tasks["build hold-tool/5"].after
    assert slip not in tasks["build hold-hand/5"].after
    assert [*tasks].index("slip of hold-tool in hold-hand") < [*tasks].index("build hold-hand/5")


@pytest.mark.blender
@pytest.mark.slow
def test_a_whole_body_has_joints_and_films(output: Path, tmp_path: Path) -> None:
    write_body(body := tmp_path / "body.bvh", TIMES[:20])
    outcome, _ = compared(output, planned(body, choices=(Tolerance("2cm"),), stage=STAGE, about=ABOUT, count_keys=True))
    assert outcome.failures == {}
    folder = "body/tolerance-2cm"
    assert {*outputs(output)} == {
        *("metrics.csv", "metrics_joints.csv", "keys_needed.csv", "report.html"),
        *(f"{folder}/{name}" for name in ("lerp_slerp.keys.csv", "motor_spline.keys.csv")),
        *(f"{folder}/{name}" for name in ("comparison.blend", "comparison.mp4")),
    }


def test_more_clips_than_fit_on_a_page_have_a_page_each(output, toss, monkeypatch):
    monkeypatch.setattr("rigid_motion_batch.pipeline.comparison.ON_ONE_PAGE", 1)
    other = write_toss(toss.with_name("other.csv"), samples=50)
    outcome, _ = compared(output, planned(toss, other, about=ABOUT))
    assert outcome.failures == {}
    assert {"report.html", "toss/report.html", "other/report.html"} <= {*outputs(output)}
    assert "other/report.html" in (output / "report.html").read_text()


def test_a_source_that_is_given_twice_is_read_and_measured_under_two_names(output: Path, toss: Path) -> None:
    outcome, listener = compared(output, planned(toss, toss))
    assert outcome.failures == {}
    assert sum(name.startswith("read ") for name in listener.made) == 1
    assert {"toss/5/keys.csv", "toss-2/5/keys.csv"} <= {*outputs(output)}


@pytest.mark.parametrize(
    ("change", "redone"),
    [
        ({"choices": (Uniform("5"), Uniform("15"))}, {"measure toss/15", "metrics.csv"}),
        ({"modes": ("lerp_slerp",)}, {"measure toss/5", "measure toss/10", "metrics.csv"}),
        ({"axes": "unity"}, {"read toss", "measure toss/5", "measure toss/10", "metrics.csv"}),
    ],
)
def test_only_what_an_option_changes_is_done_again(output, toss, change, redone):
    compared(output, planned(toss))
    _, listener = compared(output, planned(toss, **change))
    assert {name.replace(str(toss), "toss") for name in listener.made} == redone


@pytest.mark.slow
def test_a_clip_takes_two_kilobytes_at_most_between_two_plans(output: Path, toss: Path) -> None:
    """The limit for ten thousand clips, and Python with the program, is 200 MB."""
    import tracemalloc

    for number in range(60):
        (toss.parent / f"toss{number}.csv").write_bytes(toss.read_bytes())
    comparison = planned(*(toss.parent / f"toss{number}.csv" for number in range(60)), modes=("lerp_slerp",))
    compared(output, comparison)
    with Store(output) as store:
        plan = ComparisonPlan(comparison, store)
        plan.inspect_clips()
        tracemalloc.start()
        before, _ = tracemalloc.get_traced_memory()
        plan.inspect_clips()
        after, _ = tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert len(plan.studies) == 60
    assert (after - before) / 60 < 2000
    assert all(isinstance(task, Task) for task in plan.tasks())


def test_numbers_and_pages_need_no_blender(output: Path, toss: Path) -> None:
    options = ("--no-video", "--tolerance", "2cm", "--modes", "lerp_slerp", "--jobs", "0", "--output", output)
    ended = run_without_blender("compare", toss, *options)
    assert ended.returncode == 0, ended.stderr
    assert {"metrics.csv", "keys_needed.csv", "report.html"} <= {*outputs(output)}


@pytest.mark.blender
def test_without_blender_a_page_shows_a_drill_and_a_line_says_so(output: Path, toss: Path) -> None:
    outcome, listener = compared(output, planned(toss, about=ABOUT, subject="controller", blender=""))
    assert outcome.failures == {}
    assert "the report shows a drill, since no Blender here can read controller" in listener.notes
    assert "object controller" not in listener.made
    _, again = compared(output, planned(toss, about=ABOUT, subject="controller"))
    assert {*again.made} == {"object controller", "report.html"}
