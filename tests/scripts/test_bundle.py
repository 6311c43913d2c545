"""Job bundles, and what Open Job Description's own tools make of them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion_batch.cli import compare
from rigid_motion_batch.cli.job_bundle import below_inputs, write_bundle
from rigid_motion_batch.pipeline.steps import VERSION, version_here
from rigid_motion_batch.progress import FARM
from tests.scripts.comparing import outputs, write_toss

PARTS = {"read": 2, "measure": 2, "build": 1, "render": 3, "encode": 1, "report": 1}


def openjd(*command: object, cwd: Path) -> subprocess.CompletedProcess:
    line = [sys.executable, "-m", "openjd", *map(str, command)]
    return subprocess.run(line, capture_output=True, text=True, timeout=300, cwd=cwd)


@pytest.mark.slow
def test_a_job_on_a_farm_makes_the_same_as_a_run_on_one_machine(tmp_path: Path) -> None:
    takes = tmp_path / "takes"
    sources = [write_toss(takes / "toss.csv"), write_toss(takes / "other.csv", samples=70)]
    asked = [*map(str, sources), "--rates", "5", "--modes", "lerp_slerp", "--resolution", "64x36", "--fps", "10"]
    given = write_bundle(tmp_path / "bundle", *below_inputs(asked), tmp_path / "out", PARTS)
    template = tmp_path / "bundle" / "template.json"
    checked = openjd("check", template, cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout
    # On the farm the recordings are in another folder.
    there = tmp_path / "mounted" / "takes"
    there.parent.mkdir()
    takes.rename(there)
    rule = {"source_path_format": "POSIX", "source_path": str(takes), "destination_path": str(there)}
    rules = json.dumps({"version": "pathmapping-1.0", "path_mapping_rules": [rule]})
    values = [part for name, value in given.items() for part in ("-p", f"{name}={value}")]
    ran = openjd("run", template, *values, "--path-mapping-rules", rules, cwd=tmp_path)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert compare.main([*(str(there / source.name) for source in sources), *asked[2:], "-o", f"{tmp_path}/here"]) == 0
    assert outputs(tmp_path / "out") == outputs(tmp_path / "here")


def test_stages_follow_one_another_and_their_parts_are_a_parameter(tmp_path: Path) -> None:
    write_bundle(tmp_path, ["a.csv"], tmp_path, tmp_path / "out", {"read": 4, "measure": 1024, "report": 1})
    template = json.loads((tmp_path / "template.json").read_text())
    assert template["name"] == "out"
    assert template["jobEnvironments"][0]["variables"][FARM] == "openjd"
    steps = template["steps"]
    assert [step["name"] for step in steps] == ["Read", "Measure", "Report"]
    assert [step.get("dependencies") for step in steps] == [None, [{"dependsOn": "Read"}], [{"dependsOn": "Measure"}]]
    ranges = [step["parameterSpace"]["taskParameterDefinitions"][0]["range"] for step in steps]
    assert ranges == ["1-4", "1-1024", "1-1"]
    arguments = steps[0]["script"]["actions"]["onRun"]["args"]
    assert arguments == [
        *("-m", "rigid_motion_batch", "compare", "a.csv", "--output", "{{Param.Output}}"),
        *("--only", "read", "--part", "{{Task.Param.Part}}/4"),
    ]


def test_files_are_named_from_the_folder_that_has_all_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for path in ("takes/day/a.csv", "takes/b.csv", "takes/radii.csv", "takes/5", "blender"):
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).touch()
    given = [
        "takes/day/a.csv:left",
        "takes/b.csv",
        "--rates",
        "5",
        "--radius=takes/radii.csv",
        *("--blender", "blender", "--blender=blender"),
        "takes/day",
    ]
    arguments, inputs = below_inputs(given)
    assert inputs == tmp_path / "takes"
    assert arguments == [
        *("{{Param.Inputs}}/day/a.csv:left", "{{Param.Inputs}}/b.csv", "--rates", "5"),
        *("--radius={{Param.Inputs}}/radii.csv", *given[5:8], "{{Param.Inputs}}/day"),
    ]


def test_a_name_that_is_an_expression_of_templates_is_refused() -> None:
    with pytest.raises(ValueError, match="for its braces; rename it"):
        below_inputs(["{{a}}.csv"])


def test_a_machine_with_another_version_is_told_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    share = [str(write_toss(tmp_path / "toss.csv")), "--only", "read", "--no-video", "--output", str(tmp_path / "out")]
    write_bundle(tmp_path, share, tmp_path, tmp_path / "out", {"read": 1})
    variables = json.loads((tmp_path / "template.json").read_text())["jobEnvironments"][0]["variables"]
    monkeypatch.setenv(VERSION, variables[VERSION])
    assert compare.main(share) == 0
    monkeypatch.setenv(VERSION, "program 0")
    assert compare.main(share) == 2
    assert f"this machine has {version_here()}, and the bundle is of program 0" in capsys.readouterr().err
