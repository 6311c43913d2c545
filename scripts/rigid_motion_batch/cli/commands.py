"""The list of commands, and how they start: as `rigid-motion NAME`, or as a script of a checkout, also in Blender."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from pathlib import Path
from typing import cast

from rigid_motion_batch import standard_streams
from rigid_motion_batch.command_line import INSTALLED, did_you_mean, own_arguments, printable, program_of
from rigid_motion_batch.places import EXTENSION, PACKAGE, manifest
from rigid_motion_batch.supervising import begin_child, ended_at_once, stop_signals, supervise
from rigid_motion_batch.system_libraries import problem_of

RESEARCH = {
    "paper": "paper.parts",
    "benchmark": "benchmark",
    "benchmark_live": "benchmark_live",
    "live_costs": "live_costs",
    "reduction": "reduction",
    "cleaning": "cleaning",
    "curve_keys": "curve_keys",
    "glb_sizes": "glb_sizes",
    "rivals": "rivals",
    "stream_tables": "making.stream_tables",
    "pages": "pages",
}
"""The programs that `python scripts/research NAME` runs in a checkout: name to module in the package `research`."""

COMMANDS = {
    "compare": ("compare", "compare interpolation modes on recordings: numbers, charts, videos"),
    "inspect": ("inspect", "inspect recordings: bodies, units, axes, rate, and what looks wrong"),
    "clean": ("clean", "remove jitter and spikes from recordings, within a tolerance"),
    "reduce": ("reduce", "keep the few keys that a motion needs, in glTF and .blend files and recordings"),
    "bake": ("bake", "bake the in-betweens of .blend files to real keys, or back"),
    "stream": ("stream", "send a motion over a network in real time, or show what arrives"),
    "bundle": ("job_bundle", "write a comparison as a job for render farms"),
    "build": ("build_extension", "build the zip that Blender installs"),
}
"""Name to module of this package and summary. The module has a `main(arguments)` that returns the exit code. Its script
has the same name."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run `rigid-motion COMMAND ...`, and return the exit code.

    Without `arguments`, take those of this process, and work in a child process: see `supervising`.
    """
    if arguments is not None:
        return _run_named(list(arguments))
    given = sys.argv[1:]
    if given and given[0] in COMMANDS:
        return _as_program(f"{INSTALLED} {given[0]}", lambda: _run_named(given))
    return _as_program(INSTALLED, lambda: _run_named(given), alone=True)


def launch(script: str) -> None:
    """Run the command of a script, given its `__file__`, and exit with its exit code."""
    program, arguments = program_of(Path(script).name), own_arguments(script)
    sys.exit(_as_program(program, lambda: _run(program, f".{Path(script).stem}", arguments)))


def launch_research(arguments: Sequence[str]) -> None:
    """Run a study or a benchmark of the checkout, and exit with its exit code."""
    name, *rest = arguments or ["--help"]
    if name in ("-h", "--help"):
        print("usage: python scripts/research NAME ...\n\n" + "\n".join(f"  {name}" for name in RESEARCH))
        sys.exit(0)
    if name not in RESEARCH:
        near = did_you_mean(name, RESEARCH) or "; there are " + ", ".join(RESEARCH)
        print(f"research: there is no {name!r}{near}", file=sys.stderr)
        sys.exit(2)
    program = f"research {name}"
    sys.exit(_as_program(program, lambda: _run(program, f"research.{RESEARCH[name]}", rest)))


def _run_named(arguments: list[str]) -> int:
    name, *rest = arguments or ["--help"]
    if name in ("-h", "--help"):
        print(_help())
        return 0
    if name == "--version":
        print(f"{INSTALLED} {manifest()['version']}")
        return 0
    if name not in COMMANDS:
        near = did_you_mean(name, COMMANDS) or "; the commands are " + ", ".join(COMMANDS)
        print(f"{INSTALLED}: there is no command {printable(repr(name))}{near}", file=sys.stderr)
        return 2
    sys.argv = [f"{INSTALLED} {name}", *rest]
    return _run(sys.argv[0], f".{COMMANDS[name][0]}", rest)


def _as_program(program: str, do: Callable[[], int], *, alone: bool = False) -> int:
    """Run a function as a program, with its streams and a supervised child process, and return the exit code."""
    standard_streams.prepare()
    try:
        code = do() if begin_child() or alone else supervise(program)
    except SystemExit as ended:
        code = cast(int, ended.code or 0)
    return standard_streams.finish(program, code)


def _run(program: str, module: str, arguments: Sequence[str]) -> int:
    """Run a command. Name the command in the message if a module is missing, such as in Blender's own Python."""
    received: list[int] = []

    def interrupt(number: int, _: object) -> None:
        received.append(number)
        raise KeyboardInterrupt

    try:
        with ended_at_once():
            command = import_module(module, __package__).main
        for item in stop_signals():
            signal.signal(item, interrupt)
        return command(list(arguments))
    except ModuleNotFoundError as error:
        if not error.name or error.name.partition(".")[0] in (EXTENSION.name, PACKAGE.name, "research"):
            raise
        print(f"{program}: {problem_of(error)}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 128 + (received or [signal.SIGINT])[0]


def _help() -> str:
    width = max(map(len, COMMANDS)) + 2
    listed = "\n".join(f"  {name:{width}}{about}" for name, (_, about) in COMMANDS.items())
    return f"""usage: {INSTALLED} COMMAND ...

Rigid-motion interpolation for keyframes, measured, baked, streamed and rendered.

{listed}

`{INSTALLED} COMMAND --help` shows the options of a command, with examples.

examples:
  {INSTALLED} compare                                  the motions that come with the program
  {INSTALLED} inspect hand.csv
  {INSTALLED} compare hand.csv --axes unity
  {INSTALLED} compare take.csv --tolerance 5mm --no-video
  {INSTALLED} bake shot.blend
  {INSTALLED} reduce shot.blend --tolerance 5mm"""
