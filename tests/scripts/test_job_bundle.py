"""job_bundle.py, and what Open Job Description's own tools make of its bundles."""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.cli import compare, job_bundle
from rigid_motion_batch.workplan import Plan, Task
from tests.scripts.comparing import outputs, write_toss

ROOT = Path(__file__).resolve().parents[2]

OPTIONS = ("--rates", "5", "--modes", "lerp_slerp,motor_spline", "--resolution", "64x36", "--fps", "10")


def run(*command: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    return subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=240, cwd=cwd)


def bundle(*arguments: object, cwd: Path) -> subprocess.CompletedProcess:
    command = [
        sys.executable,
        ROOT / "scripts" / "job_bundle.py",
        "--jobs",
        "0",
        "--bundle",
        "bundle",
        "--output",
        "out",
    ]
    return run(*command, *arguments, cwd=cwd)


@pytest.fixture
def clip(tmp_path: Path) -> Path:
    return write_toss(tmp_path / "takes" / "toss.csv")


def plan_of(*names: str, after: dict[str, tuple[str, ...]] | None = None) -> Plan:
    tasks = (
        Task(
            name,
            "rigid_motion_batch.comparison.steps:read",
            outputs=(f"{number}.txt",),
            after=(after or {}).get(name, ()),
        )
        for number, name in enumerate(names)
    )
    return Plan(tasks, "1")


def steps_of(plan: Plan) -> dict[str, dict]:
    return {step["name"]: step for step in job_bundle.template(plan)["steps"]}


def dependencies(step: dict) -> list[str]:
    return [one["dependsOn"] for one in step.get("dependencies", ())]


def test_a_job_on_a_farm_makes_the_same_as_a_run_on_one_machine(clip: Path, tmp_path: Path) -> None:
    written = bundle("takes/toss.csv", *OPTIONS, cwd=tmp_path)
    assert written.returncode == 0, written.stderr
    assert not (tmp_path / "out").exists()
    template = tmp_path / "bundle" / "template.json"
    checked = run(sys.executable, "-m", "openjd", "check", template)
    assert checked.returncode == 0, checked.stdout
    command = shlex.split(written.stdout.splitlines()[-1])
    assert command[:3] == ["openjd", "run", str(template)]
    # On the farm the recordings are in another folder.
    takes, there = clip.parent, tmp_path / "mounted" / "takes"
    there.parent.mkdir()
    takes.rename(there)
    rule = {"source_path_format": "POSIX", "source_path": str(takes), "destination_path": str(there)}
    rules = json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": [rule]})
    ran = run(sys.executable, "-m", *command, "--path-mapping-rules", rules, cwd=tmp_path)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert "Tasks: 7 done, 0 not done." in ran.stdout
    assert compare.main([str(there / clip.name), *OPTIONS, "--jobs", "0", "--output", str(tmp_path / "here")]) == 0
    assert "toss/5/comparison.mp4" in outputs(tmp_path / "out")
    assert outputs(tmp_path / "out") == outputs(tmp_path / "here")
    assert not (tmp_path / "out" / ".workplan").exists()


def test_recordings_that_cannot_be_read_are_left_out(clip: Path, tmp_path: Path) -> None:
    written = bundle("takes/toss.csv", "nowhere.csv", "--rates", "5", "--no-video", cwd=tmp_path)
    assert written.returncode == 1
    assert "job_bundle.py: nowhere.csv: no such file" in written.stderr
    names = Plan.read(tmp_path / "bundle" / "plan.json").order
    assert sum(name.startswith("read ") for name in names) == 1
    written = bundle("nowhere.csv", "--no-video", cwd=tmp_path)
    assert written.returncode == 2
    assert "no clip is left to compare" in written.stderr


def test_a_bundle_asks_for_its_places(clip: Path, tmp_path: Path) -> None:
    assert bundle("takes/toss.csv", "--rates", "5", "--no-video", cwd=tmp_path).returncode == 0
    template, given, plan = (
        json.loads((tmp_path / "bundle" / f"{name}.json").read_text())
        for name in ("template", "parameter_values", "plan")
    )
    kinds = {one["name"]: one["type"] for one in template["parameterDefinitions"]}
    assert kinds == {"Program": "PATH", "Python": "STRING", "Inputs": "PATH", "Output": "PATH", "Plan": "PATH"}
    assert {one["name"]: one["value"] for one in given["parameterValues"]} == {
        "Program": str(ROOT / "scripts"),
        "Python": sys.executable,
        "Inputs": str(tmp_path / "takes"),
        "Output": str(tmp_path / "out"),
    }
    # But for the object that is shown, which comes with the program, nothing says where things are.
    assert str(tmp_path) not in json.dumps(plan["tasks"])


def test_steps_have_a_parameter_for_each_clip_and_each_range_of_frames() -> None:
    after = {"render a/5 from 1": ("build a/5",), "render a/5 from 121": ("build a/5",)}
    after["encode a/5"] = ("build a/5", *after)
    steps = steps_of(plan_of("build a/5", *list(after), after=after))
    assert list(steps) == ["Build", "Render", "Encode", "Finish"]
    assert [dependencies(step) for step in steps.values()] == [
        [],
        ["Build"],
        ["Build", "Render"],
        ["Build", "Render", "Encode"],
    ]
    assert steps["Render"]["parameterSpace"] == {
        "taskParameterDefinitions": [
            {"name": "Clip", "type": "STRING", "range": ["a/5", "a/5"]},
            {"name": "FirstFrame", "type": "INT", "range": [1, 121]},
        ],
        "combination": "(Clip, FirstFrame)",
    }
    arguments = steps["Render"]["script"]["actions"]["onRun"]["args"]
    assert "render {{Task.Param.Clip}} from {{Task.Param.FirstFrame}}" in arguments


def test_more_tasks_than_a_step_may_have_become_several_steps() -> None:
    reads, measures = [f"read {n}" for n in range(2000)], [f"measure {n}/5" for n in range(2000)]
    after = {measure: (read,) for read, measure in zip(reads, measures, strict=True)} | {"metrics.csv": tuple(measures)}
    steps = steps_of(plan_of(*reads, *measures, "metrics.csv", after=after))
    assert list(steps) == ["Read", "Read 2", "Measure", "Measure 2", "Tables", "Finish"]
    assert dependencies(steps["Measure 2"]) == ["Read 2"]
    assert dependencies(steps["Tables"]) == ["Measure", "Measure 2"]
    ranges = [steps[name]["parameterSpace"]["taskParameterDefinitions"][0]["range"] for name in ("Read", "Read 2")]
    assert list(map(len, ranges)) == [1024, 976]


def test_a_task_of_no_known_kind_is_not_forgotten() -> None:
    with pytest.raises(ValueError, match="no step is for task 'sweep'"):
        job_bundle.template(plan_of("sweep"))


def test_options_that_are_for_a_run_are_refused(clip: Path, tmp_path: Path) -> None:
    written = bundle("takes/toss.csv", "--force", cwd=tmp_path)
    assert written.returncode == 2
    assert "--scheduler, --force and --explain are for a run of compare.py itself" in written.stderr
    assert not os.path.exists(tmp_path / "bundle")
