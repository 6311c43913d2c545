"""A comparison as a job bundle of Open Job Description, for render farms: no list of tasks, but shares of each stage.

A task of the job runs the command of the comparison with `--only STAGE --part K/N`: it plans anew, and does its share.
What was done is kept, so a task may fail, be killed, be run twice, or have less to do than others.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from rigid_motion_batch.files import write_text
from rigid_motion_batch.places import PACKAGE

from .steps import version_here

STAGES = ("read", "measure", "build", "render", "encode", "report")
"""Stages of a comparison; each begins when all before it have ended."""

MOST_PARTS = 1024
"""Values of a parameter, in Open Job Description."""


INPUTS = "{{Param.Inputs}}"
"""The job's folder of inputs, in arguments."""


def write_bundle(
    folder: Path, arguments: Sequence[str], inputs: Path, output: Path, parts: Mapping[str, int]
) -> dict[str, str]:
    """Write the files of a bundle, and return the parameters of the job for a farm on which all is where it is here.

    `arguments` are those of the comparison but for `--output`, with files as in `INPUTS`; `parts` has for each stage
    how many tasks it is split into. The job is called as the output folder.
    """
    template = json.loads(Path(__file__).with_name("job_template.json").read_text(encoding="utf-8"))
    template["name"] = output.name
    template["jobEnvironments"][0]["script"]["actions"]["onEnter"]["args"].append(version_here())
    for before, stage in pairwise(["", *(stage for stage in STAGES if stage in parts)]):
        count = min(max(parts[stage], 1), MOST_PARTS)
        share = "--output", "{{Param.Output}}", "--only", stage, "--part", f"{{{{Task.Param.Part}}}}/{count}"
        command = ["-m", "rigid_motion_batch", "compare", *arguments, *share]
        step = {
            "name": stage.capitalize(),
            "parameterSpace": {"taskParameterDefinitions": [{"name": "Part", "type": "INT", "range": f"1-{count}"}]},
            "script": {"actions": {"onRun": {"command": "{{Param.Python}}", "args": command}}},
        }
        template["steps"].append(step | ({"dependencies": [{"dependsOn": before.capitalize()}]} if before else {}))
    places = {"Program": PACKAGE.parent, "Python": sys.executable, "Inputs": inputs, "Output": output.absolute()}
    values = {parameter: str(place) for parameter, place in places.items()}
    given = {"parameterValues": [{"name": parameter, "value": value} for parameter, value in values.items()]}
    for file, content in (("parameter_values.json", given), ("template.json", template)):
        write_text(folder / file, json.dumps(content, indent=2, ensure_ascii=False) + "\n")
    return values


def check(requested: str) -> None:
    """End a session of a farm where this is not the version of the program that wrote its bundle."""
    if (result := version_here()) != requested:
        print(f"openjd_fail: this machine has {result}, and the bundle is of {requested}", flush=True)
        sys.exit(1)


if __name__ == "__main__":
    check(sys.argv[1])
