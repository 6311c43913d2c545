"""Write a comparison as an Open Job Description bundle, for render farms to run.

The recordings are read here, to find out what there is to do. The farm does everything else, in small tasks that may
run at the same time, fail, be killed and be run again. It takes the options of compare.py.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from rigid_motion_batch.cli.compare_options import ALL
from rigid_motion_batch.cli.compare_options import parse as parse_comparison
from rigid_motion_batch.command_line import as_typed, complain, parser_of, program_of
from rigid_motion_batch.comparison import steps
from rigid_motion_batch.comparison.planning import Wanted, comparison_tasks, look_into, plan_of, reading_tasks
from rigid_motion_batch.comparison.report.pages import Settings
from rigid_motion_batch.comparison.version import blender_version, program_version
from rigid_motion_batch.files import write_text
from rigid_motion_batch.places import PACKAGE, manifest, output_folder
from rigid_motion_batch.progress import Progress
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.reading import split_source
from rigid_motion_batch.scenes.settings import MODELS, SubjectError, place_of_subject
from rigid_motion_batch.system_libraries import way_out
from rigid_motion_batch.workplan import Plan, ProcessExecutor, SerialExecutor, Workspace, run

KINDS = {
    "Report": steps.REPORT,
    "Read": "read {Recording}",
    "Measure": "measure {Clip}",
    "Decimate": "decimate {Clip}",
    "Count keys": "count keys {Clip}",
    "Tables": "{Table}.csv",
    "Build": "build {Clip}",
    "Render": "render {Clip} from {FirstFrame}",
    "Encode": "encode {Clip}",
    "Pages": "page {Clip}",
}
"""The steps of a job, and the names of their tasks, from the task's parameters."""

NUMBERS = ("FirstFrame",)
"""Those of the parameters that are whole numbers."""

MOST_VALUES = 1024
"""Of a parameter, in Open Job Description; where there are more, a step becomes several."""

FINISH = "Finish"

SCRIPT = "job_bundle.py"
PROGRAM = program_of(SCRIPT)

EPILOG = """
It writes a folder with template.json (jobtemplate-2023-09), plan.json and parameter_values.json. The last line printed
is a command that runs the job on this machine. docs/farm.md says what a farm needs, and how to submit it.
Exit code: 0 written, 1 written without some recordings that could not be read, 2 not written.
"""


@dataclass
class Step:
    """A step of a job: tasks that differ in their parameters only."""

    name: str
    kind: str
    values: list[Mapping[str, str]] = field(default_factory=list)
    """The parameters of each task."""

    after: dict[str, None] = field(default_factory=dict)
    """The names of the steps before it."""


def parse(arguments: list[str]) -> tuple[argparse.Namespace, argparse.Namespace]:
    """The options of the bundle, and those of the comparison, all of whose paths count from one folder: `inputs`."""
    parser = parser_of(
        SCRIPT,
        __doc__,
        EPILOG,
        usage="%(prog)s [-h] [--bundle FOLDER] [options of compare.py] [INPUT ...]",
        allow_abbrev=False,
    )
    parser.add_argument(
        "--bundle", type=Path, default=output_folder("job_bundle"), help="folder to write (renders/job_bundle)"
    )
    own, rest = parser.parse_known_args(arguments)
    options = parse_comparison(rest)
    if options.scheduler or options.only or options.explain:
        parser.error("--scheduler, --only and --explain are for a run of compare.py itself; leave them out")
    return own, options


def main(arguments: list[str]) -> int:
    """Write a bundle, and return the exit code."""
    own, options = parse(arguments)
    command = as_typed(PROGRAM, arguments, options.inputs)
    try:
        if options.stage:
            from rigid_motion_batch.scenes.subject import load_subject

            load_subject(options.object)
        inputs = gather(options)
        own.bundle, options.output = own.bundle.absolute(), (options.output or output_folder("comparison")).absolute()
        os.chdir(inputs)
        plan, unread = make_plan(options, command)
        if plan is None:
            return 2
        write_bundle(own.bundle, plan, options.output)
    except ImportError as error:
        print(f"{PROGRAM}: {error}\n{way_out(str(error), 'job_bundle.py')}", file=sys.stderr)
        return 2
    except (SubjectError, ValueError) as error:
        complain(PROGRAM, error)
        return 2
    except OSError as error:
        complain(PROGRAM, error, own.bundle)
        return 2
    values = (f"-p {shlex.quote(f'{name}={value}')}" for name, value in parameter_values(plan, options.output).items())
    print("openjd run", shlex.quote(str(own.bundle / "template.json")), *values)
    return 1 if unread else 0


# -- planning ---------------------------------------------------------------------------------------------------------


def gather(options: argparse.Namespace) -> Path:
    """The folder that all inputs are in; from then on the options name them from there.

    Raises
    ------
    ValueError
        Where no folder has all of them, on Windows.
    """
    sources = [_file_and_body(source) for source in options.inputs]
    own_object = options.object not in MODELS and not options.no_video
    subject = place_of_subject(options.object)[0] if own_object else None
    files = [path for path, _ in sources] + ([subject] if subject else [])
    folder = Path(os.path.commonpath([os.path.dirname(os.path.abspath(path)) for path in files]))

    def moved(path: Path, part: str | None) -> str:
        place = Path(os.path.abspath(path)).relative_to(folder).as_posix()
        return place if part is None else f"{place}:{part}"

    options.inputs = [moved(path, body) for path, body in sources]
    if subject:
        options.object = moved(subject, options.object.rpartition(":")[2])
        options.stage = replace(options.stage, subject=options.object)
    return folder


def _file_and_body(source: str) -> tuple[Path, str | None]:
    try:
        return split_source(source)
    except TrajectoryError:
        return Path(source), None  # Whoever reads it will say that there is no such file.


def make_plan(options: argparse.Namespace, command: str) -> tuple[Plan | None, int]:
    """The plan of a comparison, None where there is nothing to do, and how many recordings could not be read."""
    reading = reading_tasks(options.inputs, options.axes, options.reading)
    version = program_version()
    with (
        Progress() as progress,
        tempfile.TemporaryDirectory() as folder,
        Workspace(Path(folder)) as workspace,
        SerialExecutor() if options.jobs == 0 else ProcessExecutor(options.jobs) as executor,
    ):
        unique = {task.name: task for task in reading}.values()
        read = run(
            plan_of(unique, version),
            workspace,
            executor,
            progress=progress,
            title="Reading",
            describe=lambda problem: f"{PROGRAM}: {problem}",
        )
        if read.interrupted:
            raise KeyboardInterrupt
        there = [task for task in reading if read.states[task.name].there]
        found = look_into(workspace.output, there, options.choices, options.radius)
        for note in found.notes:
            progress.note(note)
    if not found.studies:
        print(f"{PROGRAM}: no clip is left to compare; see above", file=sys.stderr)
        return None, len(read.failures)
    tasks = comparison_tasks(found.studies, there, _wanted(options, command))
    return plan_of(tasks, version), len(read.failures)


# -- the bundle -------------------------------------------------------------------------------------------------------


def write_bundle(folder: Path, plan: Plan, output: Path) -> None:
    """Write the files of a bundle."""
    folder.mkdir(parents=True, exist_ok=True)
    plan.write(folder / "plan.json")
    values = [{"name": name, "value": value} for name, value in parameter_values(plan, output).items()]
    write_text(folder / "parameter_values.json", _json({"parameterValues": values}))
    write_text(folder / "template.json", _json(template(plan)))


def parameter_values(plan: Plan, output: Path) -> dict[str, str]:
    """The parameters of the job for a farm on which all is where it is here."""
    return {"Program": str(PACKAGE.parent), "Python": sys.executable, "Inputs": str(plan.folder), "Output": str(output)}


def template(plan: Plan) -> dict[str, Any]:
    """The job template of a plan."""
    job = _job_steps(plan)
    clips = {values["Clip"].split("/")[0] for step in job for values in step.values if "Clip" in values}
    return {
        "specificationVersion": "jobtemplate-2023-09",
        "name": f"Rigid Motion, {len(clips)} clip{'s' * (len(clips) > 1)}",
        "description": "Interpolation modes compared on recorded trajectories. docs/farm.md says what it needs.",
        "parameterDefinitions": [
            _path("Program", "The folder that has rigid_motion_batch.", "NONE"),
            {"name": "Python", "type": "STRING", "default": "python", "description": "With bpy and NumPy."},
            _path("Inputs", "The folder of the recordings.", "IN"),
            _path("Output", "The folder to write to, the same for all tasks.", "OUT"),
            {
                "name": "Plan",
                "type": "PATH",
                "objectType": "FILE",
                "dataFlow": "IN",
                "default": "plan.json",
                "description": "The tasks; beside the template.",
            },
        ],
        "jobEnvironments": [
            {
                "name": "Rigid Motion",
                "variables": {"PYTHONPATH": "{{Param.Program}}"},
                "script": {"actions": {"onEnter": _action("check", f"{steps.__name__}:{steps.identify.__name__}")}},
            }
        ],
        "steps": [*map(_step, job), _finish(job)],
    }


def _job_steps(plan: Plan) -> list[Step]:
    """Every task of a plan in a step with its like."""
    latest: dict[str, Step] = {}
    found: list[Step] = []
    step_of: dict[str, Step] = {}
    for name in plan.order:
        kind, values = _kind_of(name)
        step = latest.get(kind)
        if step is None or len(step.values) == MOST_VALUES:
            parts = sum(known.kind == kind for known in found)
            step = latest[kind] = Step(f"{kind} {parts + 1}" if parts else kind, kind)
            found.append(step)
        step.values.append(values)
        step_of[name] = step
    for name in plan.order:
        before = (step_of[one].name for one in plan.tasks[name].after)
        step_of[name].after |= dict.fromkeys(before)
    return found


def _kind_of(name: str) -> tuple[str, dict[str, str]]:
    """The kind of a task, and its parameters."""
    for kind, pattern in KINDS.items():
        parts = re.split(r"\{(\w+)\}", pattern)
        fixed, names = map(re.escape, parts[::2]), parts[1::2]
        groups = [*(f"(?P<{one}>{r'[0-9]+' if one in NUMBERS else '.+'})" for one in names), ""]
        match = re.fullmatch("".join(text + group for text, group in zip(fixed, groups, strict=True)), name)
        if match:
            return kind, match.groupdict()
    raise ValueError(f"no step is for task {name!r}")


def _step(step: Step) -> dict[str, Any]:
    names = list(step.values[0])
    content: dict[str, Any] = {"name": step.name}
    if step.after:
        content["dependencies"] = [{"dependsOn": name} for name in step.after]
    if names:
        content["parameterSpace"] = {
            "taskParameterDefinitions": [_range(name, [values[name] for values in step.values]) for name in names],
            "combination": f"({', '.join(names)})" if len(names) > 1 else names[0],
        }
    task = KINDS[step.kind]
    for name in names:
        task = task.replace(f"{{{name}}}", f"{{{{Task.Param.{name}}}}}")
    return content | {"script": {"actions": {"onRun": _action("run", task, "--openjd")}}}


def _range(name: str, values: Sequence[str]) -> dict[str, Any]:
    if name in NUMBERS:
        return {"name": name, "type": "INT", "range": [int(value) for value in values]}
    return {"name": name, "type": "STRING", "range": list(values)}


def _finish(before: Iterable[Step]) -> dict[str, Any]:
    return {
        "name": FINISH,
        "dependencies": [{"dependsOn": step.name} for step in before],
        "script": {"actions": {"onRun": _action("finish")}},
    }


def _action(command: str, *arguments: str) -> dict[str, Any]:
    """A call of the work plan."""
    places = ["--plan", "{{Param.Plan}}", "--inputs", "{{Param.Inputs}}"]
    arguments = ("-m", "rigid_motion_batch.workplan", command, *places, "{{Param.Output}}", *arguments)
    return {"command": "{{Param.Python}}", "args": list(arguments)}


def _path(name: str, description: str, flow: str) -> dict[str, Any]:
    return {
        "name": name,
        "type": "PATH",
        "objectType": "DIRECTORY",
        "dataFlow": flow,
        "description": description,
    }


def _json(content: Any) -> str:
    return json.dumps(content, indent=2, ensure_ascii=False) + "\n"


def _wanted(options: argparse.Namespace, command: str) -> Wanted:
    """What is wanted of every clip, by these options of that command."""
    stage = options.stage
    settings = Settings(
        radius=options.radius.rigid,
        joint_radius=options.radius.joint,
        program=f"{manifest()['name']} {manifest()['version']}",
        blender=blender_version(),
        command=command,
        details={}
        if options.no_video
        else {
            "Videos": f"{stage.engine}, {stage.resolution[0]} x {stage.resolution[1]}, {stage.fps} frames/s",
            "Speed of the videos": "real time" if stage.slow_motion == 1 else f"{stage.slow_motion:g} times slower",
        },
    )
    return Wanted(
        choices=tuple(options.choices),
        modes=options.modes.names,
        radii=options.radius,
        settings=settings,
        stage=None if options.no_video else stage,
        every_film=options.films == ALL,
        count_keys=options.decimate == "adaptive",
        fit=options.fit,
        shared=options.shared,
    )
