"""Run all tests on every Blender that the Pythons of this machine can install, in a window, and check what users get.

    .ci/run               all of it; red unless every part of it ran and was green
    .ci/run --list        the parts, and what they run
    .ci/run site 5.2.3    the parts that are named, once what they need is set up

What is marked `blender` runs on each Blender; all else runs without one, once for each Python and its NumPy, which
shows that it needs none. What is marked `once` or `any_blender` runs on the newest Blender alone, where tests that try
many cases try all of them. Environments are set up, the site is built and the wheel is installed while tests run.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BOOTSTRAP = "scripts/bootstrap.py"
OWN_WINDOW = ".ci/blender-window"
WINDOW_TESTS = "tests/gui/test_window.py"
NOT_IN_WINDOWS = ("--ignore", WINDOW_TESTS)

BROWSER = "chromium"
"""In which the pages of reports are opened."""

MINUTES_A_TEST = 10
"""A test that waits for longer ends its process, with a traceback, instead of the whole run."""


@dataclass
class Part:
    """A part of the run: commands that have to end with 0, and what sets it up, which has to before."""

    name: str
    commands: list[list[str]]
    setup: list[str]
    environment: Mapping[str, str] = field(default_factory=dict)
    folder: Path = ROOT
    is_of_tests: bool = True
    """The others run beside these, and take one processor at most."""


def main(arguments: list[str]) -> int:
    """Set up and run the parts that are named, or all, and return 1 unless each of them was green."""
    os.chdir(ROOT)
    with tempfile.TemporaryDirectory() as folder:
        parts = every_part(Path(folder))
        if arguments == ["--list"]:
            for part in parts:
                print(part.name, *(" ".join(command) for command in part.commands), sep="\n    ")
            return 0
        if unknown := [word for word in arguments if not any(word in part.name for part in parts)]:
            print(f"No part is named {unknown[0]!r}; .ci/run --list shows them", file=sys.stderr)
            return 2
        install_system_libraries()
        chosen = [part for part in parts if not arguments or any(word in part.name for word in arguments)]
        results = run_parts(chosen)
    print("===", *(f"{name}: {result}" for name, result in results.items()), sep="\n")
    red = sum(not result.startswith("green") for result in results.values())
    print(f"=== {len(chosen)} parts, {red} of them red")
    return int(red > 0)


def every_part(folder: Path) -> list[Part]:
    """Return all that is to run here, in the order in which it begins."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    known = project["tool"]["rigid-motion"]["blender"]
    window = os.environ.setdefault("BLENDER", OWN_WINDOW)
    pythons = {version: python for version in known if (python := python_of(version))}
    if not pythons:
        sys.exit(f"None of the Pythons {', '.join(known)} is on this machine: nothing was tested")
    for version in known.keys() - pythons:
        print(f"No Python {version} on this machine")
    newest_python, newest = max(
        ((python, blender) for version, python in pythons.items() for blender in known[version]),
        key=lambda pair: as_numbers(pair[1]),
    )
    # A commit is tried with the same random examples each time, so it is green or red for what it did.
    commit = subprocess.run(["git", "rev-parse", "--short=8", "HEAD"], capture_output=True, text=True).stdout
    options = ["--hypothesis-seed", str(int(commit or "0", 16))]
    options += ["-o", f"faulthandler_timeout={60 * MINUTES_A_TEST}", "-o", "faulthandler_exit_on_timeout=true"]

    def tests(name: str, python: str, *arguments: str, **variables: str) -> Part:
        command = [python, BOOTSTRAP, "test", *arguments]
        where = arguments[: arguments.index("--blender") + 2] if "--blender" in arguments else arguments[:2]
        return Part(name, [[*command, *options]], [python, BOOTSTRAP, "test", *where, "--version"], variables)

    parts = []
    for version, python in pythons.items():
        thorough = {"RIGID_MOTION_THOROUGH": "1"} if python == newest_python else {}
        parts.append(tests(f"Python {version} without Blender", python, "-m", "not blender and not once", **thorough))
        for blender in known[version]:
            if blender == newest:
                marks, several = "blender or once", thorough
            else:
                marks, several = "blender and not once and not any_blender", {}
            where = ("--blender", blender, "-m", marks, *NOT_IN_WINDOWS)
            parts.append(tests(f"Blender {blender}", python, *where, **several))
            if blender == newest:
                set_up_newest = parts[-1].setup
    # One file of tests runs in one process unless asked otherwise; these hardly share anything, each has its own
    # Blender, and a hand in it waits now and then.
    hands = str((os.cpu_count() or 1) + 1)
    where = ("--blender", newest, WINDOW_TESTS, "-n", hands, "--dist", "worksteal")
    in_windows = tests(f"a window of {window}", newest_python, *where)
    if window == OWN_WINDOW:
        in_windows.setup = [OWN_WINDOW, "--set-up"]
    parts.append(in_windows)
    site = [newest_python, BOOTSTRAP, "docs", "--output", str(folder / "site")]
    parts.append(Part("site", [site], set_up_newest, is_of_tests=False))
    parts.append(installation(newest_python, folder))
    return parts


def installation(python: str, folder: Path) -> Part:
    """Return the part that has pip install this checkout where nothing else is, and runs the main job."""
    folder = folder / "empty"
    programs = folder / "bin"
    made = [str(programs / "pip"), "install", "-q", f"{ROOT}[blender]"]
    ran = [[str(programs / "rigid-motion"), "compare", "--no-video"], ["test", "-s", "renders/comparison/report.html"]]
    return Part("pip install", [made, *ran], [python, "-m", "venv", str(folder)], folder=folder, is_of_tests=False)


def python_of(version: str) -> str | None:
    """Return the Python of a version such as "3.11", on the path or among pyenv's; None where there is none."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for candidate in (shutil.which(f"python{version}"), *map(str, pyenv.glob(f"{version}.*/bin/python"))):
        # A shim of pyenv's is there for versions that are not chosen, and fails.
        if candidate:
            asked = [candidate, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
            if subprocess.run(asked, capture_output=True, text=True).stdout.strip() == version:
                return candidate
    return None


def as_numbers(version: str) -> list[int]:
    return [int(number) for number in version.split(".")]


def install_system_libraries() -> None:
    """Install what Blender takes from a Debian system, and a browser; elsewhere they are thought to be there."""
    if not shutil.which("apt-get") or os.getuid() != 0:
        return
    sys.path.insert(0, str(ROOT / "scripts"))
    from rigid_motion_batch.system_libraries import DEBIAN

    packages = [*DEBIAN.split(), BROWSER]
    if subprocess.run(["dpkg", "-s", *packages], capture_output=True).returncode:
        subprocess.run(["apt-get", "update", "-q"])
        subprocess.run(["apt-get", "install", "-y", "-q", "--no-install-recommends", *packages])


def run_parts(parts: list[Part]) -> dict[str, str]:
    """Run parts, those with tests one after the other, and return for each what became of it."""
    set_up: dict[tuple[str, ...], Future[tuple[bool, str]]] = {}
    with ThreadPoolExecutor(2) as sets_up, ThreadPoolExecutor(1) as beside:
        # What a window needs takes longest. Two that set up one environment at once would get in each other's way.
        for part in sorted(parts, key=lambda part: part.setup[0] != OWN_WINDOW):
            if (key := tuple(part.setup)) not in set_up:
                set_up[key] = sets_up.submit(run, [part.setup], {}, ROOT)
        others = {
            part.name: beside.submit(run_part, part, set_up[tuple(part.setup)])
            for part in parts
            if not part.is_of_tests
        }
        results = {part.name: run_part(part, set_up[tuple(part.setup)]) for part in parts if part.is_of_tests}
        return results | {name: future.result() for name, future in others.items()}


def run_part(part: Part, set_up: Future[tuple[bool, str]]) -> str:
    """Run a part, show what it says, and return one line: green or red, its minutes and its tests."""
    ready, said = set_up.result()
    if not ready:
        print(f"=== {part.name}", said, sep="\n", flush=True)
        return "red: it could not be set up"
    began = time.monotonic()
    if part.is_of_tests:
        print(f"=== {part.name}", flush=True)
    green, said = run(part.commands, part.environment, part.folder, shown=part.is_of_tests)
    if not part.is_of_tests:
        print(f"=== {part.name}", said, sep="\n", flush=True)
    counts = re.findall(r"\d+ (?:passed|failed|errors?)\b.* in [\d.]+s", said) if part.is_of_tests else [""]
    green = green and bool(counts)
    last = counts[-1] if counts else "pytest did not come to its end"
    return f"{'green' if green else 'red'} in {(time.monotonic() - began) / 60:.1f} minutes {last}".rstrip()


def run(commands: list[list[str]], variables: Mapping[str, str], folder: Path, shown: bool = False) -> tuple[bool, str]:
    """Run commands in a folder, up to the first that fails, and return whether none did and what they said."""
    folder.mkdir(exist_ok=True)
    said: list[str] = []
    for command in commands:
        try:
            running = subprocess.Popen(
                command,
                cwd=folder,
                env={**os.environ, "RIGID_MOTION_EVERY_TEST": "1", **variables},
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
            )
        except OSError as error:
            return False, "".join([*said, str(error)])
        with running:
            for line in running.stdout or ():
                said.append(line)
                if shown:
                    print(line, end="", flush=True)
        if running.returncode:
            return False, "".join(said)
    return True, "".join(said)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
