"""Runs the viewer's modules without a page: in Node if available, otherwise in a headless Chromium."""

import json
import shutil
import subprocess
from typing import Any

import pytest

from rigid_motion_batch.report.data import json_in_page
from rigid_motion_batch.report.rendering import script_of
from tests.scripts.report import chromium

NODE = shutil.which("node")


def value_of(expression: str, *modules: str) -> Any:
    """Return the value of an expression that may use the exports of these modules, awaited."""
    script = f"{script_of(modules)}\nreturn {expression};"
    wrapped = f"(async () => {{ {script} }})()"
    if NODE:
        source = f"console.log(JSON.stringify(await {wrapped}))"
        arguments = [NODE, "--input-type=module", "-"]
        done = subprocess.run(arguments, input=source, capture_output=True, text=True, timeout=60)
        assert not done.returncode, done.stderr
        return json.loads(done.stdout)
    require()
    with chromium.browser() as browser:
        return browser.run(wrapped)


def read_by_viewer(clip: object, expression: str) -> Any:
    """Return the value of an expression of `recording` and `choice`, which the viewer reads from a clip's data."""
    made = f"""(async (clip) => {{
        const recording = await readRecording(clip.recording), choice = await readChoice(clip.choices[0], recording);
        const plain = (some) => JSON.parse(JSON.stringify(some, (_, one) => ArrayBuffer.isView(one) ? [...one] : one));
        return plain({expression});
    }})({json_in_page(clip)})"""
    return value_of(made, "data", "mathematics")


def require() -> None:
    """Skip the test if there is no Chromium."""
    if not chromium.PROGRAM:
        pytest.skip("there is no Chromium here (Debian: apt-get install chromium)")
