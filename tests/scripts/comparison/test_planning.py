from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import (
    Budget,
    Choice,
    Tolerance,
    Uniform,
    choice_from,
    choice_parts,
    fewest_keys,
)
from rigid_motion_batch.analysis.radii import Radii
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.comparison import steps
from rigid_motion_batch.comparison.planning import (
    MOST_POSES,
    PIECE,
    Study,
    Wanted,
    comparison_tasks,
    look_into,
    reading_tasks,
    without_films,
)
from rigid_motion_batch.comparison.report.pages import ON_ONE_PAGE, Settings
from rigid_motion_batch.comparison.storage import ClipReference, file_names, write_recording
from rigid_motion_batch.recordings import ReadingOptions
from rigid_motion_batch.recordings.clip_reading import folder_names
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.scenes.settings import StageSettings
from rigid_motion_batch.workplan import Plan, Task
from tests.scripts.comparison.recordings import swinging_clip
from tests.thoroughness import tried

WANTED = Wanted(
    choices=(Uniform("5"), Tolerance("5mm")),
    modes=("lerp_slerp", "dq_sclerp"),
    radii=Radii(),
    settings=Settings(radius=0.1, program="Rigid Motion", blender="5", command="compare.py"),
    stage=StageSettings(),
    every_film=True,
    count_keys=True,
)


def study(name: str, task: Task, seconds: float = 3.0) -> Study:
    clip = ClipReference(name, task.arguments["recording"], 0)
    return Study(clip, round(seconds * 90), dict.fromkeys(WANTED.choices, (0.0, seconds)))


def tasks_of(
    names: Sequence[str], wanted: Wanted = WANTED, seconds: float = 3.0, *, numbers: bool = False
) -> dict[str, Task]:
    read = reading_tasks([f"{name}.csv" for name in names], "blender")
    studies = [study(name, task, seconds) for name, task in zip(names, read, strict=True)]
    tasks = comparison_tasks(studies, read, wanted)
    return {task.name: task for task in (without_films(tasks) if numbers else tasks)}


def test_the_tasks_make_a_plan_with_all_numbers_before_the_first_film() -> None:
    order = Plan(tasks_of(["reach", "throw"]).values(), "1").order
    first_film = min(order.index(name) for name in order if name.startswith("build"))
    numbers = [name for name in order if name.startswith(("read", "measure", "count")) or name.endswith(".csv")]
    assert max(map(order.index, numbers)) < first_film
    assert order[-1] == "report.html"


@pytest.mark.parametrize("seconds", [0.2, 3.9, 4.0, 4.1, 61.7])
def test_the_pieces_of_a_film_are_all_its_frames_once(seconds: float) -> None:
    tasks = tasks_of(["reach"], seconds=seconds)
    pieces = [task.arguments for name, task in tasks.items() if name.startswith("render reach/5 ")]
    frames = [frame for piece in pieces for frame in range(piece["first"], piece["last"] + 1)]
    assert frames == list(range(1, int(seconds * 30 + 1e-6) + 2))
    assert max(piece["last"] - piece["first"] + 1 for piece in pieces) <= PIECE
    joined = tasks[steps.filming("reach", Uniform("5"))]
    assert joined.arguments["firsts"] == [piece["first"] for piece in pieces]
    assert len(joined.after) == 1 + len(pieces)


def test_a_run_without_videos_makes_none() -> None:
    tasks = tasks_of(["reach"], replace(WANTED, stage=None, count_keys=False))
    assert {name.split()[0] for name in tasks} == {"read", "measure", "metrics.csv", "report.html"}


def test_a_film_of_the_fewest_keys_of_each_kind_is_enough_unless_all_are_asked_for() -> None:
    choices = (Uniform("15"), Uniform("7.5"), Tolerance("5mm"), Tolerance("1cm"))
    assert fewest_keys(choices) == [Uniform("7.5"), Tolerance("1cm")]
    tasks = tasks_of(["reach"], replace(WANTED, every_film=False))
    assert sum(name.startswith("encode") for name in tasks) == 2
    assert tasks[steps.REPORT].arguments["filmed"] == [["reach", ["uniform", "5"]], ["reach", ["tolerance", "5mm"]]]


@pytest.mark.parametrize("seconds", [1e6, 1e12, 1e25])
def test_a_film_that_nobody_can_watch_is_left_out_and_the_user_told(seconds: float) -> None:
    tasks = tasks_of(["reach"], seconds=seconds)
    assert not [name for name in tasks if name.startswith(("build", "render", "encode"))]
    assert tasks[steps.REPORT].arguments["filmed"] == []
    (reading,) = reading_tasks(["reach.csv"], "blender")
    told = Study(ClipReference("reach", "", 0), 90, {Uniform("5"): (0.0, seconds)}).left_out(WANTED.stage)
    assert told.startswith("reach: no video: its 1e+")
    assert "times are in seconds" in told
    assert not study("reach", reading).left_out(WANTED.stage)


@pytest.mark.parametrize(("seconds", "filmed"), [(199.9, True), (200.1, False)])
def test_a_body_of_many_joints_has_a_shorter_film_at_most(seconds: float, filmed: bool) -> None:
    body = Study(ClipReference("dance", "", 0), 90, dict.fromkeys(WANTED.choices, (0.0, seconds)), joints=100)
    stage = WANTED.stage
    assert bool(body.filmed(WANTED)) == filmed
    assert bool(body.left_out(stage)) != filmed
    assert stage.fps * 200 * 100 == MOST_POSES


def test_the_numbers_can_be_had_before_the_films() -> None:
    everything, numbers = tasks_of(["reach"]), tasks_of(["reach"], numbers=True)
    assert {name for name in everything if name not in numbers} == {
        name for name in everything if name.split()[0] in ("build", "render", "encode")
    }
    assert {name for name, task in numbers.items() if everything[name] != task} == {steps.REPORT}
    assert numbers[steps.REPORT].arguments["coming"]
    assert not everything[steps.REPORT].arguments["coming"]


def test_many_clips_have_a_page_each() -> None:
    few, many = (tasks_of([f"c{number}" for number in range(count)]) for count in (ON_ONE_PAGE, ON_ONE_PAGE + 1))
    assert not [name for name in few if name.startswith("page")]
    assert sum(name.startswith("page") for name in many) == ON_ONE_PAGE + 1
    assert many["page c3"].outputs == ("c3/report.html",)
    assert set(many["page c3"].after) < set(many["report.html"].after)


def test_another_option_changes_only_what_depends_on_it() -> None:
    before = tasks_of(["reach"])

    def changed(wanted: Wanted) -> set[str]:
        return {name.split()[0] for name, task in tasks_of(["reach"], wanted).items() if task != before.get(name)}

    assert changed(WANTED) == set()
    assert changed(replace(WANTED, stage=StageSettings(resolution=(640, 360)))) == {"build", "render", "encode"}
    assert changed(replace(WANTED, settings=replace(WANTED.settings, command="other"))) == {"report.html"}
    assert changed(replace(WANTED, radii=Radii(0.2))) == {"measure", "count", "build"}


def test_a_source_that_is_named_twice_is_read_once_and_gives_two_clips(tmp_path: Path) -> None:
    read = reading_tasks(["hand.csv", "hand.csv"], "blender")
    assert read[0] == read[1]
    assert reading_tasks(["hand.csv"], "unity") != read[:1]
    in_centimetres = reading_tasks(["hand.csv"], "blender", ReadingOptions(scale=0.01))[0]
    assert in_centimetres.arguments["recording"] != read[0].arguments["recording"]
    assert ReadingOptions(**in_centimetres.arguments["options"]) == ReadingOptions(scale=0.01)
    store(tmp_path, read[0], [swinging_clip("hand", repairs=("dropped 1 row",))])
    found = look_into(tmp_path, read, [Uniform("5")])
    assert [study.clip.name for study in found.studies] == ["hand", "hand-2"]
    assert found.notes == ("hand: dropped 1 row", "hand-2: dropped 1 row")
    assert len([task for task in comparison_tasks(found.studies, read, WANTED) if task.name.startswith("read")]) == 1


def test_clips_of_bodies_that_were_named_in_one_file_have_their_names(tmp_path: Path) -> None:
    read = reading_tasks(["log.csv:left", "log.csv:right"], "blender")
    for task, body in zip(read, ("left", "right"), strict=True):
        store(tmp_path, task, [replace(swinging_clip("log"), body=body)])
    assert [study.clip.name for study in look_into(tmp_path, read, [Uniform("5")]).studies] == ["log-left", "log-right"]
    assert [study.clip.name for study in look_into(tmp_path, read[1:], [Uniform("5")]).studies] == ["log"]


def store(output: Path, task: Task, clips: list[Clip]) -> None:
    arrays, facts = file_names(task.arguments["recording"])
    write_recording(output / arrays, output / facts, clips, "")


def test_a_choice_that_a_clip_is_too_short_for_is_left_out_and_said(tmp_path: Path) -> None:
    read = reading_tasks(["hand.csv"], "blender")
    store(tmp_path, read[0], [swinging_clip("hand", seconds=1.0)])
    found = look_into(tmp_path, read, [Uniform("0.5"), Uniform("10")])
    assert list(found.studies[0].choices) == [Uniform("10")]
    assert found.notes == ("hand: too short for two keys at 0.5 a second; left out",)
    assert look_into(tmp_path, read, [Uniform("0.5")]).studies == ()


def test_rates_above_that_of_a_recording_are_said(tmp_path: Path) -> None:
    read = reading_tasks(["hand.csv"], "blender")
    clip = swinging_clip("hand", seconds=1.0)
    store(tmp_path, read[0], [clip])
    rate = 1.0 / np.median(np.diff(clip.times))
    asked = [Uniform(f"{rate:.0f}"), Uniform(f"{2.0 * rate:.0f}"), Budget(f"{3.0 * rate:.0f}"), Tolerance("5mm")]
    (note,) = look_into(tmp_path, read, asked).notes
    above = f"{2.0 * rate:.0f}, {3.0 * rate:.0f}"
    assert note == f"hand: it has {rate:.3g} samples a second: {above} keys a second cannot be had of it"


CHOICES = (Uniform("0.3"), Uniform("2"), Uniform("7.5"), Uniform("400"), Budget("2"), Budget("0.4"), Tolerance("1cm"))


@settings(max_examples=tried(40))
@given(
    gaps=st.lists(st.sampled_from((0.001, 0.01, 0.011, 0.3, 2.0)), min_size=1, max_size=40),
    choice=st.sampled_from(CHOICES),
)
def test_the_first_and_the_last_key_are_known_before_they_are_chosen(gaps: list[float], choice: Choice) -> None:
    whole = swinging_clip(seconds=1.0)
    count = len(gaps) + 1
    clip = replace(whole, times=np.cumsum([5.0, *gaps]), poses=whole.poses[:count])
    made = reconstruct(clip, choice, ("lerp_slerp",), 0.1)
    kept = None if made is None else tuple(int(made.keys["lerp_slerp"][end]) for end in (0, -1))
    assert choice.ends(clip.times) == kept


@pytest.mark.parametrize("choice", [Uniform("7.5"), Budget("10"), Tolerance("5mm")])
def test_a_choice_is_plain_data_and_back(choice: Choice) -> None:
    assert choice_from(*choice_parts(choice)) == choice


def test_a_thousand_clips_of_one_name_get_names_of_their_own() -> None:
    names = folder_names(["data", "Data", *["data"] * 998, "data-3"])
    assert names[:4] == ["data", "Data-2", "data-3", "data-4"]
    assert names[-1] == "data-3-2"
    assert len({name.casefold() for name in names}) == 1001


def test_the_modes_of_a_run_are_those_of_its_tables() -> None:
    wanted = replace(WANTED, modes=(*MODES, "best_of"))
    evenly = tasks_of(["reach"], wanted)[steps.measuring("reach", Uniform("5"))].outputs
    assert {"reach/5/keys.csv", "reach/5/best_of.keys.csv", "reach/5/best_of.csv"} <= set(evenly)
    adaptive = tasks_of(["reach"], wanted)[steps.measuring("reach", Tolerance("5mm"))].outputs
    assert "reach/tolerance-5mm/lerp_slerp.keys.csv" in adaptive
