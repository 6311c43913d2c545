"""A comparison as a job bundle of Open Job Description, for render farms: no list of tasks, but shares of each stage.

A task of the job runs the command of the comparison with `--only STAGE --part K/N`: it plans anew, and does its share.
What was done is kept, so a task may fail, be killed, be run twice, or have less to do than others.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rigid_motion_batch.files import write_text
from rigid_motion_batch.places import PACKAGE
from rigid_motion_batch.progress import FARM

from .steps import version_here

STAGES = ("read", "measure", "build", "render", "encode", "report")
"""Stages of a comparison; each begins when all before it have ended."""

MOST_PARTS = 1024
"""Values of a parameter, in Open Job Description."""


def write_bundle(
    folder: Path, arguments: Sequence[str], output: Path, parts: Mapping[str, int], name: str
) -> dict[str, str]:
    """Write the files of a bundle, and return the parameters of the job for a farm on which all is where it is here.

    Parameters
    ----------
    folder : Path
    arguments : sequence of str
        Of the comparison, but for `--output`. The files that they name are looked for in the job's folder of inputs.
    output : Path
    parts : mapping
        Stage to how many tasks it is split into.
    name : str
        What farms call the job.

    Raises
    ------
    ValueError
        Where an argument would be taken for an expression of the template, or no folder has all inputs, on Windows.
    OSError
    """
    if braced := next((argument for argument in arguments if "{{" in argument), None):
        raise ValueError(f"{braced!r}: a job cannot have this name, for its braces; rename it")
    arguments, inputs = below_inputs(arguments)
    places = {"Program": PACKAGE.parent, "Python": sys.executable, "Inputs": inputs, "Output": output.absolute()}
    values = {parameter: str(place) for parameter, place in places.items()}
    given = [{"name": parameter, "value": value} for parameter, value in values.items()]
    _write(folder / "parameter_values.json", {"parameterValues": given})
    _write(folder / "template.json", _template(arguments, parts, name))
    return values


def below_inputs(arguments: Sequence[str]) -> tuple[list[str], Path]:
    """Return arguments with their files, FILE, FILE:BODY or --option=FILE, as the job finds them, and where.

    The program of `--blender` is none of the inputs.
    """
    parts = [_file_in(one, before) for before, one in zip(["", *arguments], arguments, strict=False)]
    places = [os.path.abspath(file) for _, file, _ in parts if file]
    inputs = Path(os.path.commonpath([os.path.dirname(place) for place in places])) if places else Path.cwd()

    def moved(option: str, file: str, rest: str) -> str:
        below = f"{{{{Param.Inputs}}}}/{Path(os.path.abspath(file)).relative_to(inputs).as_posix()}" if file else ""
        return option + below + rest

    return [moved(*each) for each in parts], inputs


def _file_in(argument: str, before: str) -> tuple[str, str, str]:
    """Return what stands before the file in an argument, the file or folder, and what is behind it; "" for none."""
    option, equals, value = argument.partition("=") if argument.startswith("-") else ("", "", argument)
    # A number is no file, whatever lies in the current folder.
    if "--blender" in (option, before) or "\0" in value or value.replace(".", "").isdigit():
        return argument, "", ""
    ends = [len(value), *(place for place in range(len(value) - 1, 0, -1) if value[place] == ":")]
    end = next((end for end in ends if os.path.exists(value[:end])), 0)
    return option + equals, value[:end], value[end:]


def _template(arguments: Sequence[str], parts: Mapping[str, int], name: str) -> dict[str, Any]:
    stages = [stage for stage in STAGES if stage in parts]
    check = f"from rigid_motion_batch.pipeline.bundle import check; check({version_here()!r})"
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "name": name,
        "description": "Interpolation modes compared on recorded trajectories. docs/farm.md says what it needs.",
        "parameterDefinitions": [
            _path("Program", "The folder that has rigid_motion_batch.", "NONE"),
            {"name": "Python", "type": "STRING", "default": "python", "description": "With what the program needs."},
            _path("Inputs", "The folder of the recordings.", "IN"),
            _path("Output", "The folder to write to, the same for all tasks.", "OUT"),
        ],
        "jobEnvironments": [
            {
                "name": "Rigid Motion",
                "variables": {"PYTHONPATH": "{{Param.Program}}", FARM: "openjd"},
                "script": {"actions": {"onEnter": _python("-c", check)}},
            }
        ],
        "steps": [
            _step(stage, before, min(max(parts[stage], 1), MOST_PARTS), arguments)
            for stage, before in zip(stages, ["", *stages], strict=False)
        ],
    }


def _step(stage: str, before: str, parts: int, arguments: Sequence[str]) -> dict[str, Any]:
    share = ("--output", "{{Param.Output}}", "--only", stage, "--part", f"{{{{Task.Param.Part}}}}/{parts}")
    return {
        "name": stage.capitalize(),
        **({"dependencies": [{"dependsOn": before.capitalize()}]} if before else {}),
        "parameterSpace": {"taskParameterDefinitions": [{"name": "Part", "type": "INT", "range": f"1-{parts}"}]},
        "script": {"actions": {"onRun": _python("-m", "rigid_motion_batch", "compare", *arguments, *share)}},
    }


def _python(*arguments: str) -> dict[str, Any]:
    return {"command": "{{Param.Python}}", "args": [*arguments]}


def _path(name: str, description: str, flow: str) -> dict[str, Any]:
    return {"name": name, "type": "PATH", "objectType": "DIRECTORY", "dataFlow": flow, "description": description}


def _write(path: Path, content: Mapping[str, Any]) -> None:
    write_text(path, json.dumps(content, indent=2, ensure_ascii=False) + "\n")


def check(requested: str) -> None:
    """End a session of a farm where this is not the version of the program that wrote its bundle."""
    if (result := version_here()) != requested:
        print(f"openjd_fail: this machine has {result}, and the bundle is of {requested}", flush=True)
        sys.exit(1)
