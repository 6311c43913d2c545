"""Set up everything that Rigid Motion needs in a folder of its own, then run a command. Needs Python and pip only.

    python scripts/bootstrap.py compare                     compare the modes, on the recordings in assets/
    python scripts/bootstrap.py compare hand.csv --axes unity
    python scripts/bootstrap.py inspect hand.csv            show what is in a recording, and what looks wrong
    python scripts/bootstrap.py clean hand.csv              remove jitter and spikes from a recording
    python scripts/bootstrap.py paper                       reproduce the paper's figures and its table
    python scripts/bootstrap.py test                        run the tests
    python scripts/bootstrap.py test --quick                run some of each file of tests, in a minute
    python scripts/bootstrap.py test -m "not blender"       run those that need no Blender
    python scripts/bootstrap.py test --blender 4.5.15       run the tests on another Blender
    python scripts/bootstrap.py bake shot.blend             bake in-betweens of .blend files to real keys, or back
    python scripts/bootstrap.py reduce walk.glb             keep few keys, in glTF and .blend files and recordings
    python scripts/bootstrap.py stream --help               send a recording over a network, in real time
    python scripts/bootstrap.py bundle hand.csv             write a comparison as a job for render farms
    python scripts/bootstrap.py openjd run template.json    run such a job on this machine
    python scripts/bootstrap.py examples lid                make small complete cases to start with: examples/README.md
    python scripts/bootstrap.py benchmark                   measure how fast the modes are
    python scripts/bootstrap.py build                       build the extension, dist/rigid_motion-VERSION.zip
    python scripts/bootstrap.py docs                        build the documentation as a site, dist/site
    python scripts/bootstrap.py types                       check types, with Python 3.12 or later as NumPy asks for
    python scripts/bootstrap.py environment [DIR]           set up all but Blender, for compare --blender PATH

The packages go into .venv/ of this checkout; the first run downloads about 500 MB, of which Blender is 400. Where there
is no Blender for a Python, the commands run that need none: compare --no-video, inspect, clean, stream. No
--help needs it, nor does reduce for glTF files. All arguments after the command are passed on to it: `python
scripts/bootstrap.py compare --help` shows the options of compare.
"""

from __future__ import annotations

import difflib
import hashlib
import itertools
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"

COMMANDS = {
    "compare": ([ROOT / "scripts" / "compare.py"], ()),
    "inspect": (["-m", "rigid_motion_batch", "inspect"], ()),
    "clean": (["-m", "rigid_motion_batch", "clean"], ()),
    "paper": ([ROOT / "scripts" / "research", "paper"], ("benchmark",)),
    "test": (["-m", "pytest"], ("test", "farm", "docs", "stream")),
    "benchmark": ([ROOT / "scripts" / "research", "benchmark"], ("benchmark",)),
    "bake": ([ROOT / "scripts" / "bake.py"], ()),
    "reduce": ([ROOT / "scripts" / "reduce.py"], ()),
    "stream": ([ROOT / "scripts" / "stream.py"], ("stream",)),
    "bundle": ([ROOT / "scripts" / "job_bundle.py"], ()),
    "openjd": (["-m", "openjd"], ("farm",)),
    "examples": ([ROOT / "examples" / "make_examples.py"], ()),
    "build": ([ROOT / "scripts" / "build_extension.py"], ()),
    "docs": ([ROOT / "scripts" / "build_site.py"], ("benchmark", "docs")),
    "types": (["-m", "mypy"], ("types",)),
}
"""Command to the arguments of Python, and the dependency groups of pyproject.toml that it needs."""

ENVIRONMENT = "environment"
"""The command that sets up everything except Blender, and prints the folder."""

WITHOUT_BLENDER = ("inspect", "clean", "stream", "openjd", "types")
"""Commands that need no Blender."""

IN_ROOT = ("test", "types")
"""Commands that run in the folder of the project."""

FILMING = ("compare", "bundle")
NOT_FILMING = {"--no-video", "--blender"}
"""Commands that need no Blender with one of these options."""

TESTED_ALONE = "not blender"
"""The start of a `-m` expression of pytest that selects tests without Blender."""

DRAWING = "paper"
"""The command that needs Blender even for its --help."""

GLTF = (".glb", ".gltf", ".vrm", ".vrma")
TABLES = (".csv", ".tsv", ".txt", ".tum", ".chan", ".g2o", ".json")
"""Extensions of inputs for which reduce needs no Blender; for tables only if they become tables."""

IN_BLENDER = (".blend", ".bvh", ".fbx")
"""Extensions of inputs for which reduce needs Blender, and which it takes from folders."""


def main(arguments: list[str]) -> int:
    """Set up an environment, run the command in it, and return its exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__.strip())
        return 0
    command, *rest = arguments
    if command not in (*COMMANDS, ENVIRONMENT):
        near = difflib.get_close_matches(command, (*COMMANDS, ENVIRONMENT), n=1)
        meant = f": did you mean {near[0]}?" if near else ""
        return _fail(f"there is no command {command!r}{meant}\nThe commands are {', '.join(COMMANDS)}.")
    if sys.version_info < (3, 11):  # noqa: UP036 - users of an older Python should read this
        return _fail(f"Python {PYTHON} is too old: run this with Python 3.11 or 3.13")
    project = _project()
    if command == ENVIRONMENT:
        python = install(None, _requirements(project, None, ()), Path(rest[0]) if rest else None)
        print(*([python.parents[1]] if python else []), sep="\n")
        return int(python is None)
    known = project["tool"]["rigid-motion"]["blender"]
    here = known.get(PYTHON, [])
    blender = here[0] if here else None
    if "--blender" in rest and not (command in FILMING and _is_program(rest)):
        place = rest.index("--blender")
        blender = rest[place + 1] if place + 1 < len(rest) else ""
        del rest[place : place + 2]
        if blender not in here:
            return _fail(f"--blender takes one of {', '.join(here)} with Python {PYTHON}")
    alone = command != DRAWING and bool({"--help", "-h"} & {*rest})
    alone = alone or (command == "reduce" and _is_without_blender(rest))
    tested_alone = command == "test" and any(argument.startswith(TESTED_ALONE) for argument in rest)
    if tested_alone or (alone and not (blender and _folder(blender).exists())):
        blender = None
    needed = not (alone or tested_alone or command in WITHOUT_BLENDER or (command in FILMING and NOT_FILMING & {*rest}))
    if needed and blender is None:
        without = "; or add --no-video, for the numbers and the report" if command in FILMING else ""
        fitting = " or ".join(known)
        return _fail(f"Blender has no wheel for Python {PYTHON}: run this with Python {fitting}{without}")
    run, groups = COMMANDS[command]
    if command == "types":
        # Otherwise Blender's modules would be imported for their types, instead of the stubs.
        python = install(None, _requirements(project, None, groups), ROOT / ".venv" / f"types-python-{PYTHON}")
    else:
        python = install(blender, _requirements(project, blender, groups))
    if python is None or (needed and not _blender_starts(python)):
        return 1
    # Paths from the user are relative to the current folder; paths of pytest and mypy to their configuration.
    folder = ROOT if command in IN_ROOT else None
    variables = environment(os.environ)
    if run[0] == "-m" and command not in IN_ROOT:
        variables["PYTHONPATH"] = os.pathsep.join([str(ROOT / "scripts"), *filter(None, [variables.get("PYTHONPATH")])])
    return _become([python, *run, *rest], folder, variables)


def _become(command: list, folder: Path | None, variables: Mapping[str, str]) -> int:
    """Replace this process by a command, so that signals reach it; on Windows, run it and wait."""
    if os.name != "nt":
        os.chdir(folder or ".")
        os.execve(command[0], list(map(str, command)), variables)
    return subprocess.call(command, cwd=folder, env=variables)


def environment(environ: Mapping[str, str]) -> dict[str, str]:
    """Return the environment for programs: as here, but bytecode goes into .venv/ if it may not go into folders.

    Without bytecode, every process would compile the whole program again, and pytest all modules with assertions.
    """
    ours = dict(environ)
    if ours.pop("PYTHONDONTWRITEBYTECODE", ""):
        ours.setdefault("PYTHONPYCACHEPREFIX", str(ROOT / ".venv" / "bytecode"))
    return ours


def _is_program(arguments: list[str]) -> bool:
    """Whether --blender names a program for filming, not a version."""
    named = arguments[arguments.index("--blender") + 1 :][:1]
    return bool(named) and not named[0].replace(".", "").isdecimal()


def _is_without_blender(arguments: list[str]) -> bool:
    """Return whether all inputs of reduce are glTF files that stay glTF, or tables that become tables.

    An argument after an option counts as its value, unless a file of that name exists: an unneeded Blender does less
    harm than a missing one. For folders, their contents count.
    """
    inputs = [
        argument
        for before, argument in itertools.pairwise(["", *arguments])
        if not argument.startswith("-")
        and (not before.startswith("-") or (before != "--output" and _is_there(argument)))
    ]
    endings = GLTF if "--glb" in arguments else (*GLTF, *TABLES)
    files = [name for given in inputs for name in (_in_folder(given) if os.path.isdir(given) else [given])]
    return bool(inputs) and all(name.lower().endswith(endings) for name in files) and "--blend" not in arguments


def _in_folder(folder: str) -> list[str]:
    """Return the names of the files that reduce takes from a folder and below it."""
    endings = (*GLTF, *IN_BLENDER, *TABLES)
    return [name for _, _, names in os.walk(folder) for name in names if name.lower().endswith(endings)]


def _is_there(source: str) -> bool:
    """Return whether a file exists, also if a body is named after a colon."""
    return os.path.exists(source) or os.path.exists(source.rpartition(":")[0])


def _folder(blender: str | None) -> Path:
    return ROOT / ".venv" / (f"blender-{blender}-python-{PYTHON}" if blender else f"python-{PYTHON}")


def install(blender: str | None, requirements: list[str], folder: Path | None = None) -> Path | None:
    """Return the Python of an environment with these requirements, set up if necessary; None on failure.

    The environment is in `.venv/` unless a folder is given.
    """
    folder = folder.absolute() if folder else _folder(blender)
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    stamp = folder / "installed.json"
    requested = hashlib.sha256("\n".join([sys.version, *requirements]).encode()).hexdigest()
    installed = json.loads(stamp.read_text()) if stamp.is_file() and python.exists() else []
    if requested in installed:
        return python
    what = f"Blender {blender}" if blender else "what is needed without Blender"
    print(f"Setting up {what} for Python {PYTHON} in {folder} ...", file=sys.stderr, flush=True)
    if not python.exists():
        if folder.exists() and not (folder / "pyvenv.cfg").exists() and any(folder.iterdir()):
            _fail(f"{folder} is there, and no environment: choose another folder")
            return None
        shutil.rmtree(folder, ignore_errors=True)
        try:
            import ensurepip  # noqa: F401 - a separate package in Debian
            import venv

            venv.create(folder, with_pip=True)
        except (ImportError, subprocess.CalledProcessError) as error:
            _fail(f"this Python cannot make an environment ({error}): install its modules venv and ensurepip")
            return None
    # Standard output is for the command's own output.
    pip = [str(python), "-m", "pip", "install", "--disable-pip-version-check", *requirements]
    if subprocess.call(pip, cwd=ROOT, stdout=sys.stderr) != 0:
        _fail("the packages above could not be installed; with the network back, the same command continues")
        return None
    stamp.write_text(json.dumps([*installed, requested]))
    return python


def _project() -> dict:
    # tomllib came with Python 3.11; users of an older Python should get the message first.
    import tomllib

    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _requirements(project: dict, blender: str | None, groups: tuple[str, ...]) -> list[str]:
    """Return the pinned packages of pyproject.toml, with this version of Blender."""
    pins = project["tool"]["rigid-motion"]["numpy"]
    numpy = pins.get(PYTHON) or [*pins.values()][-1]
    listed = [*([f"bpy=={blender}"] if blender else []), f"numpy=={numpy}"]
    for group in ("libraries", *groups):
        listed += project["dependency-groups"][group]
    return listed


def _blender_starts(python: Path) -> bool:
    tried = subprocess.run([str(python), "-c", "import bpy"], capture_output=True, text=True, errors="replace")
    if tried.returncode != 0:
        sys.path.insert(0, str(ROOT / "scripts"))
        from rigid_motion_batch.system_libraries import way_out

        last_words = (tried.stderr.strip() or "import bpy failed").splitlines()[-1]
        _fail(f"{last_words}\n{way_out(last_words)}")
    return tried.returncode == 0


def _fail(message: str) -> int:
    print(message, file=sys.stderr)
    return 2


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
