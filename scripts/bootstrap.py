"""Set up everything that Rigid Motion needs in a folder of its own, then run a command. Needs Python and pip only.

    python scripts/bootstrap.py compare                     compare the modes, on the recordings in assets/
    python scripts/bootstrap.py compare hand.csv --axes unity --output renders/hand
    python scripts/bootstrap.py paper                       reproduce the paper's figures and its table
    python scripts/bootstrap.py test                        run the tests
    python scripts/bootstrap.py test --blender 4.5.15       run the tests on another Blender
    python scripts/bootstrap.py bake shot.blend             turn in-betweens of .blend files into real keys, or back
    python scripts/bootstrap.py reduce shot.blend           keep few keys, in .blend files and of recordings
    python scripts/bootstrap.py stream --help               send a recording over a network, in real time
    python scripts/bootstrap.py tasks list renders/hand     list the tasks of a comparison, and which are done
    python scripts/bootstrap.py dask scheduler              use many machines, with Dask's own commands
    python scripts/bootstrap.py bundle hand.csv             write a comparison as a job for render farms
    python scripts/bootstrap.py openjd run template.json    run such a job on this machine
    python scripts/bootstrap.py examples lid                make small complete cases to begin with: examples/README.md
    python scripts/bootstrap.py benchmark                   measure how fast the modes are
    python scripts/bootstrap.py build                       build the extension, dist/rigid_motion-VERSION.zip
    python scripts/bootstrap.py docs                        build the documentation as a site, dist/site

The packages go into .venv/ of this checkout; the first run downloads about 400 MB. All arguments after the command are
passed on to it: `python scripts/bootstrap.py compare --help` shows the options of compare.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Mapping
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PYTHON = f"{sys.version_info.major}.{sys.version_info.minor}"

COMMANDS = {
    "compare": ([ROOT / "scripts" / "compare.py"], ()),
    "paper": ([ROOT / "scripts" / "research", "paper"], ()),
    "test": (["-m", "pytest"], ("test", "farm", "docs")),
    "benchmark": ([ROOT / "scripts" / "research", "benchmark"], ("benchmark",)),
    "bake": ([ROOT / "scripts" / "bake.py"], ()),
    "reduce": ([ROOT / "scripts" / "reduce.py"], ()),
    "stream": ([ROOT / "scripts" / "stream.py"], ()),
    "tasks": (["-m", "rigid_motion_batch.workplan"], ()),
    "dask": (["-m", "dask"], ("farm",)),
    "bundle": ([ROOT / "scripts" / "job_bundle.py"], ()),
    "openjd": (["-m", "openjd"], ("farm",)),
    "examples": ([ROOT / "examples" / "make_examples.py"], ()),
    "build": ([ROOT / "scripts" / "build_extension.py"], ()),
    "docs": ([ROOT / "scripts" / "build_site.py"], ("benchmark", "docs")),
}
"""Command to what Python runs for it, and the extras of pyproject.toml that it needs."""


def main(arguments: list[str]) -> int:
    """Set up, run, and pass on the exit code."""
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__.strip())
        return 0
    command, *rest = arguments
    if command not in COMMANDS:
        return _fail(f"there is no command {command!r}; the commands are {', '.join(COMMANDS)}")
    if sys.version_info < (3, 11):  # noqa: UP036 - whoever starts it with another Python is to read why
        return _fail(f"Python {PYTHON} is too old: run this with Python 3.11 or 3.13")
    project = _project()
    known = project["tool"]["rigid-motion"]["blender"]
    if PYTHON not in known:
        return _fail(f"Blender has no wheel for Python {PYTHON}: run this with Python {' or '.join(known)}")
    blender = known[PYTHON][0]
    if "--blender" in rest:
        place = rest.index("--blender")
        blender = rest[place + 1] if place + 1 < len(rest) else ""
        del rest[place : place + 2]
        if blender not in known[PYTHON]:
            return _fail(f"--blender takes one of {', '.join(known[PYTHON])} with Python {PYTHON}")
    run, extras = COMMANDS[command]
    python = install(blender, _requirements(project, blender, extras))
    if python is None or not _blender_starts(python):
        return 1
    # Paths that a user gives count from where the user is; those of pytest from where its configuration is.
    folder = ROOT if command == "test" else None
    variables = environment(os.environ)
    if command in ("dask", "tasks"):
        variables["PYTHONPATH"] = os.pathsep.join([str(ROOT / "scripts"), *filter(None, [variables.get("PYTHONPATH")])])
    return _become([python, *run, *rest], folder, variables)


def _become(command: list, folder: Path | None, variables: Mapping[str, str]) -> int:
    """Run a command in the place of this process, so that signals reach it, or wait for it where that is not known."""
    if os.name != "nt":
        os.chdir(folder or ".")
        os.execve(command[0], list(map(str, command)), variables)
    return subprocess.call(command, cwd=folder, env=variables)


def environment(environ: Mapping[str, str]) -> dict[str, str]:
    """What programs run in: as here, but where Python is to leave no bytecode in folders, it goes into .venv/.

    Without any, every process compiles all of the program again, and pytest all that it asserts with.
    """
    ours = dict(environ)
    if ours.pop("PYTHONDONTWRITEBYTECODE", ""):
        ours.setdefault("PYTHONPYCACHEPREFIX", str(ROOT / ".venv" / "bytecode"))
    return ours


def install(blender: str, requirements: list[str]) -> Path | None:
    """The Python of an environment with these requirements, made or completed where it has to be; None on failure."""
    folder = ROOT / ".venv" / f"blender-{blender}-python-{PYTHON}"
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    stamp = folder / "installed.json"
    wanted = hashlib.sha256("\n".join([sys.version, *requirements]).encode()).hexdigest()
    installed = json.loads(stamp.read_text()) if stamp.is_file() and python.exists() else []
    if wanted in installed:
        return python
    print(f"Setting up Blender {blender} for Python {PYTHON} in {folder} ...", file=sys.stderr, flush=True)
    if not python.exists():
        shutil.rmtree(folder, ignore_errors=True)
        venv.create(folder, with_pip=True)
    pip = [str(python), "-m", "pip", "install", "--disable-pip-version-check", *requirements]
    if subprocess.call(pip, cwd=ROOT) != 0:
        _fail("the packages above could not be installed; with the network back, the same command goes on")
        return None
    stamp.write_text(json.dumps([*installed, wanted]))
    return python


def _project() -> dict:
    # Python 3.11 brought it; older ones are to get this far, and be told.
    import tomllib

    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def _requirements(project: dict, blender: str, extras: tuple[str, ...]) -> list[str]:
    """The pinned packages of pyproject.toml, with this Blender."""
    listed = [f"bpy=={blender}", f"numpy=={project['tool']['rigid-motion']['numpy'][PYTHON]}"]
    for extra in extras:
        listed += project["project"]["optional-dependencies"][extra]
    return listed


def _blender_starts(python: Path) -> bool:
    tried = subprocess.run([str(python), "-c", "import bpy"], capture_output=True, text=True)
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
