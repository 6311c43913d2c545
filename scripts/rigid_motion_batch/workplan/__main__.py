"""One task of a plan that another program has written: for render farms, and for looking closer at one that failed.

    rigid-motion tasks list OUTPUT          what there is to do, and what is done
    rigid-motion tasks run OUTPUT TASK      do one task, if it is not done
    rigid-motion tasks finish OUTPUT        when all have run: clear up, and say how many are done
    rigid-motion tasks check OUTPUT STEP    whether this is the version of the program that planned

Any number of tasks may run at the same time, on any machines that share the folder. What they did is in the manifest
when the program that made the plan runs again, or `list` or `finish` does. In a checkout it is called
`python scripts/bootstrap.py tasks`. Exit code: 0 the outputs are there, 1 the task failed, or not all are done, 2 it
cannot be begun.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path

from rigid_motion_batch.command_line import parser_of

from .lock import FolderInUse
from .manifest import ManifestError
from .performing import Failed, Message, Noted, Order, Told, perform
from .plan import Plan, PlanError
from .running import order_for
from .status import Status, explain
from .workspace import Workspace


def main(arguments: list[str]) -> int:
    """Run a command, and return the exit code."""
    parser = parser_of("tasks", __doc__)
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    listing = commands.add_parser("list", help="the tasks of a plan, and which are done")
    running = commands.add_parser("run", help="do one task")
    finishing = commands.add_parser("finish", help="clear up when all tasks have run")
    checking = commands.add_parser("check", help="whether this is the version that planned")
    for command in (listing, running, finishing, checking):
        command.add_argument("output", type=Path, metavar="OUTPUT", help="the output folder")
        command.add_argument("--plan", type=Path, metavar="FILE", help="the plan (that in the output folder)")
        command.add_argument("--inputs", type=Path, metavar="FOLDER", help="where its relative inputs are (as planned)")
    listing.add_argument("--explain", action="store_true", help="say instead what is to do, and why")
    running.add_argument("task", metavar="TASK", help="its name, as list prints it")
    running.add_argument(
        "--openjd",
        action="store_true",
        help="talk as Open Job Description has it, and end with code 0 also where the input is at fault: a farm would "
        "not go on with what does not need it; finish counts it",
    )
    checking.add_argument("step", metavar="STEP", help="package.module:function, which writes the version")
    options = parser.parse_args(arguments)
    output = options.output.absolute()
    plan_path = options.plan or output / ".workplan" / "plan.json"
    try:
        plan = Plan.read(plan_path, options.inputs and options.inputs.absolute())
        if options.command == "check":
            return _check(plan, options.step)
        os.chdir(plan.folder)
        if options.command == "run":
            if options.task not in plan.tasks:
                return _cannot(f"{plan_path}: there is no task {options.task!r}; see list")
            with Workspace(output, shared=True, only=_concerned(plan, options.task)) as workspace:
                return _run(plan, workspace, options.task, openjd=options.openjd)
        with Workspace(output, shared=options.command == "list") as workspace:
            return (
                _list(plan, workspace, why=options.explain) if options.command == "list" else _finish(plan, workspace)
            )
    except (PlanError, ManifestError, FolderInUse) as error:
        return _cannot(error)
    except OSError as error:
        return _cannot(f"{error.filename or output}: {error.strerror or error}")
    except ValueError as error:  # A path that no file can have.
        return _cannot(f"{plan_path}: {error}; run the program that plans once more")


def _run(plan: Plan, workspace: Workspace, name: str, *, openjd: bool) -> int:
    """Do one task, in this process."""
    task, status = plan.tasks[name], Status(plan, workspace.manifest, workspace.output)
    standing = status.survey(_concerned(plan, name))
    if standing[name].there:
        print(f"{task.title}: up to date", flush=True)
        return 0
    finished = [before for before in task.after if standing[before].there]
    missing = [before for before in task.after if before not in finished]
    if missing and not (task.partial and finished):
        code = _cannot(f"{name}: first do {', '.join(map(repr, missing))}")
        return 0 if openjd else code
    record, key = workspace.manifest.get(name), status.key(name)
    order = order_for(task, status.seen(name), finished, workspace)
    done = perform(order, _tell_openjd if openjd else _tell)
    if isinstance(done, Failed):
        print(f"{task.title}: {done.message}\n{done.details}".rstrip(), file=sys.stderr, flush=True)
        if openjd:
            print(f"openjd_status: {_line(done.message)}", flush=True)
        if record is None or record.key != key:
            # What is there under its name was made of something else.
            workspace.discard(task.outputs)
        return 0 if openjd and not (done.details or done.hopeless) else 1
    workspace.put_in_place(order, key, done, status.made_of(name))
    print(f"{task.title}: done in {done.seconds:.1f} s", flush=True)
    return 0


def _list(plan: Plan, workspace: Workspace, *, why: bool) -> int:
    survey = Status(plan, workspace.manifest, workspace.output).survey()
    for line in explain(survey, plan) if why else ():
        print(line)
    for name, standing in survey.items() if not why else ():
        print(f"{'done' if standing.there else 'to do':6}{name}")
    return 0


def _finish(plan: Plan, workspace: Workspace) -> int:
    """Delete what was only made for other tasks, and name the tasks that are not done."""
    survey = Status(plan, workspace.manifest, workspace.output).survey()
    for name, task in plan.tasks.items():
        if task.temporary and all(survey[reader].there for reader in plan.readers[name]):
            workspace.discard(task.outputs)
    missing = [name for name, standing in survey.items() if not standing.there]
    for name in missing:
        print(f"not done: {name}", file=sys.stderr)
    print(f"Tasks: {len(survey) - len(missing)} done, {len(missing)} not done.", flush=True)
    return 1 if missing else 0


def _check(plan: Plan, function: str) -> int:
    with tempfile.TemporaryDirectory() as folder:
        order = Order("check", function, {"path": "version"}, {}, ("version",), folder, os.path.join(folder, "scratch"))
        done = perform(order, _tell)
        if isinstance(done, Failed):
            return _cannot(done.message)
        version = Path(order.scratch, "version").read_text(encoding="utf-8")
    if version != plan.version:
        return _cannot(f"this is {version}, and the plan was made by {plan.version}; bring both to the same version")
    return 0


def _concerned(plan: Plan, name: str) -> set[str]:
    """The tasks that have a say in whether, and from what, one is done."""
    return {name, *_all_before(plan, name), *(plan.readers[name] if plan.tasks[name].temporary else ())}


def _all_before(plan: Plan, name: str) -> list[str]:
    """The tasks before one, and those before them, in the order of the plan."""
    found, waiting = set(), list(plan.tasks[name].after)
    while waiting:
        before = waiting.pop()
        if before not in found:
            found.add(before)
            waiting += plan.tasks[before].after
    return [before for before in plan.order if before in found]


def _tell(message: Message) -> None:
    if isinstance(message, Noted):
        print(message.text, file=sys.stderr, flush=True)
    elif isinstance(message, Told):
        print(f"{message.share:4.0%} {message.doing}".rstrip(), flush=True)


def _tell_openjd(message: Message) -> None:
    if isinstance(message, Noted):
        print(f"openjd_status: {_line(message.text)}", flush=True)
    elif isinstance(message, Told):
        print(f"openjd_progress: {100.0 * message.share:.1f}", flush=True)
        if message.doing:
            print(f"openjd_status: {_line(message.doing)}", flush=True)


def _line(text: str) -> str:
    """Text without line ends: what a line begins with would be taken for a message."""
    return " ".join(text.split())


def _cannot(reason: object) -> int:
    print(f"workplan: {reason}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    ended = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender 4.5's module can wait forever while it is taken down.
    os._exit(ended)
