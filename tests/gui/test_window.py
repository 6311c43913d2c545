"""Test of the extension in real Blender windows, by simulated mouse and keys: each scenario in a Blender of its own.

It runs if the environment variable BLENDER names a Blender with a window, for example
BLENDER=/opt/blender/blender, or BLENDER=.ci/blender-window on a Linux server. Pictures go to renders/gui/SCENARIO/.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCENARIOS = sorted(path.stem for path in (ROOT / "tests" / "gui" / "scenarios").glob("*.py"))

SECONDS = 300
"""Time limit of one Blender in seconds; a scenario stops itself long before."""


@pytest.fixture(scope="module")
def blender() -> str:
    named = os.environ.get("BLENDER")
    if not named:
        pytest.skip("needs a Blender with a window: set BLENDER to its path, or to .ci/blender-window")
    result = shutil.which(named) or shutil.which(str(ROOT / named))
    assert result, f"BLENDER is {named}, which is no program"
    return str(Path(result).absolute())


@pytest.fixture(scope="module")
def shaders(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Mesa's folder of compiled shaders: compiling without a graphics card takes ten seconds of each Blender."""
    return tmp_path_factory.mktemp("shaders")


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_scenario(scenario, blender, extension_zip, shaders, tmp_path):
    pictures = ROOT / "renders" / "gui" / scenario
    shutil.rmtree(pictures, ignore_errors=True)
    pictures.mkdir(parents=True)
    result = tmp_path / "result.json"
    options = ["--factory-startup", "--enable-event-simulate", "-noaudio", "--python"]
    inside = [ROOT / "tests" / "gui" / "inside.py", "--", scenario, extension_zip, pictures, result]
    said = run([blender, *options, *inside], tmp_path / "user", shaders)
    last_words = said[-4000:]
    assert result.exists(), f"Blender ended before the scenario did:\n{last_words}"
    failure = json.loads(result.read_text(encoding="utf-8"))["failure"]
    assert failure is None, f"{failure}\nPictures: {pictures}\n{last_words}"
    assert "Traceback" not in said, f"an error that no one but the console heard of:\n{last_words}"


def run(command: list[str | Path], user: Path, shaders: Path) -> str:
    """Return a program's output and errors; after the time limit it is ended with all programs it started."""
    user.mkdir()
    folders = {"BLENDER_USER_RESOURCES": str(user), "MESA_SHADER_CACHE_DIR": str(shaders)}
    environment = os.environ | folders | {"PYTHONDONTWRITEBYTECODE": "1"}
    with subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env=environment,
        start_new_session=True,
    ) as program:
        try:
            return program.communicate(timeout=SECONDS)[0]
        except subprocess.TimeoutExpired:
            end = os.killpg if hasattr(os, "killpg") else os.kill
            end(program.pid, signal.SIGTERM)
            return program.communicate()[0] + f"\n(ended after {SECONDS} s)"
