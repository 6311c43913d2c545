"""Tests of job_bundle.py: a comparison as a job for a render farm."""

import json
import shlex
from pathlib import Path

import pytest

from rigid_motion_batch.cli import compare, job_bundle
from rigid_motion_batch.cli.job_bundle import below_inputs, write_bundle
from rigid_motion_batch.pipeline.steps import VERSION_VARIABLE, version_here
from tests.scripts.comparing import outputs, write_toss
from tests.scripts.processes import run_python

OPTIONS = ("--rates", "5", "--modes", "lerp_slerp,motor_spline", "--no-video")


@pytest.fixture
def clip(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_toss(tmp_path / "takes" / "toss.csv")


def test_one_bad_clip_is_named_and_the_others_get_their_report(clip, tmp_path, capfd):
    clip.with_name("bad.csv").write_text("junk\n", encoding="utf-8")
    given = ["takes/toss.csv", "takes/bad.csv", *OPTIONS, "--jobs", "0", "--parts", "1"]
    assert job_bundle.main([*given, "--bundle", "bundle", "--output", "out"]) == 0
    command = shlex.split(capfd.readouterr().out.splitlines()[-1])
    ran = run_python("-m", *command)
    said = ran.stdout + ran.stderr
    assert ran.returncode != 0, said
    assert "bad.csv:1: no column has a known name" in said
    assert "bad.csv: not done" in said
    assert {"metrics.csv", "report.html", "toss/5/keys.csv"} <= set(outputs(tmp_path / "out"))


def test_stages_of_films_are_in_the_job_where_there_are_films(clip: Path, tmp_path: Path) -> None:
    def steps(*options: str) -> dict[str, str]:
        assert job_bundle.main(["takes/toss.csv", "--bundle", "bundle", *options]) == 0
        template = json.loads((tmp_path / "bundle" / "template.json").read_text(encoding="utf-8"))
        return {
            step["name"]: step["parameterSpace"]["taskParameterDefinitions"][0]["range"] for step in template["steps"]
        }

    assert steps("--no-video", "--parts", "3") == {"Read": "1-3", "Measure": "1-3", "Slip": "1-1", "Report": "1-1"}
    assert [*steps()] == ["Read", "Measure", "Slip", "Build", "Render", "Encode", "Report"]


def test_a_part_of_a_run_is_no_job(clip, tmp_path, capfd):
    assert job_bundle.main(["takes/toss.csv", "--only=read", "--bundle", "bundle"]) == 2
    assert "--only is for a run of compare.py itself" in capfd.readouterr().err
    assert not (tmp_path / "bundle").exists()


def test_files_are_named_from_the_folder_that_has_all_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for path in ("takes/day/a.csv", "takes/b.csv", "takes/mine.csv", "takes/5", "blender"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).touch()
    blender = "--blender blender --blender=blender"
    given = f"takes/day/a.csv:left takes/b.csv --rates 5 --against=takes/mine.csv {blender} takes/day"
    arguments, inputs = below_inputs(given.split())
    assert inputs == tmp_path / "takes"
    assert " ".join(arguments) == given.replace("takes", "{{Param.Inputs}}")


def test_a_name_that_is_an_expression_of_templates_is_refused() -> None:
    with pytest.raises(ValueError, match="for its braces; rename it"):
        below_inputs(["{{a}}.csv"])


def test_a_machine_with_another_version_is_told_so(tmp_path, monkeypatch, capsys):
    share = [str(write_toss(tmp_path / "toss.csv")), "--only", "read", "--no-video", "--output", str(tmp_path / "out")]
    write_bundle(tmp_path, share, tmp_path, tmp_path / "out", {"read": 1})
    variables = json.loads((tmp_path / "template.json").read_text())["jobEnvironments"][0]["variables"]
    monkeypatch.setenv(VERSION_VARIABLE, variables[VERSION_VARIABLE])
    assert compare.main(share) == 0
    monkeypatch.setenv(VERSION_VARIABLE, "program 0")
    assert compare.main(share) == 2
    assert f"this machine has {version_here()}, and the bundle is of program 0" in capsys.readouterr().err
