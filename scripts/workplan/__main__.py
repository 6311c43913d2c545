"""One task of a plan that another program has written: for render farms, and for looking closer at one that failed.

    python -m scripts.workplan list OUTPUT          what there is to do, and what is done
    python -m scripts.workplan run OUTPUT TASK      do one task, if it is not done

Any number of tasks may run at the same time, on any machines that share the folder. What they did is in the manifest
when the program that made the plan runs again, or `list` does. Exit code: 0 the outputs are there, 1 the task failed,
2 it cannot be begun.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

from .lock import FolderInUse
from .manifest import ManifestError
from .performing import Failed, Message, Noted, Told, perform
from .plan import Plan, PlanError
from .running import Keys, order_for
from .workspace import Workspace


def main(arguments: list[str]) -> int:
    """Run a command, and return the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m scripts.workplan", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    listing = commands.add_parser("list", help="the tasks of a plan, and which are done")
    running = commands.add_parser("run", help="do one task")
    for command in (listing, running):
        command.add_argument("output", type=Path, metavar="OUTPUT", help="the output folder")
    running.add_argument("task", metavar="TASK", help="its name, as list prints it")
    options = parser.parse_args(arguments)
    try:
        with Workspace(options.output, shared=True) as workspace:
            plan = Plan.read(workspace.plan_path)
            os.chdir(plan.folder)
            if options.command == "list":
                return _list(plan, workspace)
            return run_one(plan, workspace, options.task)
    except (PlanError, ManifestError, FolderInUse) as error:
        return _cannot(error)
    except OSError as error:
        return _cannot(f"{error.filename or options.output}: {error.strerror or error}")


def run_one(plan: Plan, workspace: Workspace, name: str) -> int:
    """Do one task, in this process, and return the exit code."""
    if name not in plan.tasks:
        return _cannot(f"{workspace.output}: its plan has no task {name!r}; see list")
    task, keys, there = plan.tasks[name], Keys(plan), []
    for before in _all_before(plan, name):
        if _is_there(before, keys, plan, workspace):
            there.append(before)
    missing = [before for before in task.after if before not in there]
    if missing and not (task.partial and len(missing) < len(task.after)):
        return _cannot(f"{name}: first do {', '.join(map(repr, missing))}")
    finished = [before for before in task.after if before in there]
    key = keys.with_those(name, finished)
    record = workspace.manifest.tasks.get(name)
    if record and record.holds(key, workspace.output):
        print(f"{task.title}: up to date", flush=True)
        return 0
    order = order_for(task, keys.seen(name), finished, workspace)
    done = perform(order, _tell)
    if isinstance(done, Failed):
        print(f"{task.title}: {done.message}\n{done.details}".rstrip(), file=sys.stderr)
        return 1
    workspace.put_in_place(name, key, done, Path(order.scratch))
    print(f"{task.title}: done in {done.seconds:.1f} s", flush=True)
    return 0


def _list(plan: Plan, workspace: Workspace) -> int:
    keys = Keys(plan)
    for name in plan.order:
        print(f"{'done' if _is_there(name, keys, plan, workspace) else 'to do':6}{name}")
    return 0


def _all_before(plan: Plan, name: str) -> list[str]:
    """The tasks before one, and those before them, in the order of the plan."""
    found, waiting = set(), list(plan.tasks[name].after)
    while waiting:
        before = waiting.pop()
        if before not in found:
            found.add(before)
            waiting += plan.tasks[before].after
    return [before for before in plan.order if before in found]


def _is_there(name: str, keys: Keys, plan: Plan, workspace: Workspace) -> bool:
    """To be asked in the order of the plan: a partial task counts with those before it that are there."""
    records = workspace.manifest.tasks
    there = [before for before in plan.tasks[name].after if not plan.tasks[name].partial or before in records]
    return name in records and records[name].holds(keys.with_those(name, there), workspace.output)


def _tell(message: Message) -> None:
    if isinstance(message, Noted):
        print(message.text, file=sys.stderr, flush=True)
    elif isinstance(message, Told):
        print(f"{message.share:4.0%} {message.doing}".rstrip(), flush=True)


def _cannot(reason: object) -> int:
    print(f"workplan: {reason}", file=sys.stderr)
    return 2


if __name__ == "__main__":
    ended = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    # Blender 4.5's module can wait forever while it is taken down.
    os._exit(ended)
