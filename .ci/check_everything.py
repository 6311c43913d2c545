"""Run all tests on every Blender that this machine's Pythons can install, in a window too, and check what users get.

    .ci/run               all parts; red unless every part ran and was green
    .ci/run --list        the parts and their commands
    .ci/run site 5.2.3    only the named parts, after their setup

Tests marked `blender` run on each Blender. All others run without Blender, once for each Python and its NumPy, which
proves that they do not need it. Tests marked `once` or `any_blender` run only on the newest Blender, where tests with
many cases try all of them. Setting up environments, building the site and installing the wheel happen while tests run.
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
"""The browser that opens the pages of reports."""

MINUTES_A_TEST = 10
"""A test that hangs for longer than this ends its own process with a traceback, instead of blocking the whole run."""


@dataclass
class Part:
    """A part of the run: commands that must exit with 0, and a setup command that must succeed first."""

    name: str
    commands: list[list[str]]
    setup: list[str]
    environment: Mapping[str, str] = field(default_factory=dict)
    folder: Path = ROOT
    is_of_tests: bool = True
    """Parts without tests run in parallel with the tests, on one processor at most."""


def main(arguments: list[str]) -> int:
    """Set up and run the named parts (default: all), and return 1 unless all of them were green."""
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
    """Return all parts that run on this machine, in the order in which they start."""
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
    # The seed comes from the commit: a commit always gets the same random examples, so only its changes turn it red.
    commit = subprocess.run(["git", "rev-parse", "--short=8", "HEAD"], capture_output=True, text=True).stdout
    options = ["--hypothesis-seed", str(int(commit or "0", 16)), "--durations", "15"]
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
    # By default, a test file runs in one process. These tests share almost nothing, each has its own Blender, and
    # its simulated hand pauses now and then.
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
    """Return the part that installs this checkout with pip into an empty environment and runs the main command."""
    folder = folder / "empty"
    programs = folder / "bin"
    made = [str(programs / "pip"), "install", "-q", f"{ROOT}[blender]"]
    ran = [[str(programs / "rigid-motion"), "compare", "--no-video"], ["test", "-s", "renders/comparison/report.html"]]
    return Part("pip install", [made, *ran], [python, "-m", "venv", str(folder)], folder=folder, is_of_tests=False)


def python_of(version: str) -> str | None:
    """Return the path of a Python of a version such as "3.11", from PATH or pyenv, or None if there is none."""
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv")) / "versions"
    for candidate in (shutil.which(f"python{version}"), *map(str, pyenv.glob(f"{version}.*/bin/python"))):
        # A pyenv shim exists even for versions that are not selected, and then fails.
        if candidate:
            asked = [candidate, "-c", "import sys; print('%d.%d' % sys.version_info[:2])"]
            if subprocess.run(asked, capture_output=True, text=True).stdout.strip() == version:
                return candidate
    return None


def as_numbers(version: str) -> list[int]:
    return [int(number) for number in version.split(".")]


def install_system_libraries() -> None:
    """Install Blender's system libraries and a browser on Debian; other systems are assumed to have them."""
    if not shutil.which("apt-get") or os.getuid() != 0:
        return
    sys.path.insert(0, str(ROOT / "scripts"))
    from rigid_motion_batch.system_libraries import DEBIAN

    packages = [*DEBIAN.split(), BROWSER]
    if subprocess.run(["dpkg", "-s", *packages], capture_output=True).returncode:
        subprocess.run(["apt-get", "update", "-q"])
        subprocess.run(["apt-get", "install", "-y", "-q", "--no-install-recommends", *packages])


def run_parts(parts: list[Part]) -> dict[str, str]:
    """Run parts, those with tests one after another, and return the result line of each part by its name."""
    set_up: dict[tuple[str, ...], Future[tuple[bool, str]]] = {}
    with ThreadPoolExecutor(2) as sets_up, ThreadPoolExecutor(1) as beside:
        # The window setup takes longest, so it starts first. Two setups of the same environment at once would conflict.
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
    """Run a part, show its output, and return one line: green or red, minutes taken, and test counts."""
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
    """Run commands in a folder, stop at the first failure, and return whether all succeeded, and their output."""
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
