"""Runs the viewer's modules without a page: in Node if available, otherwise in a headless Chromium."""

import json
import shutil
import subprocess
from typing import Any

import pytest

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


def require() -> None:
    """Skip the test if there is no Chromium."""
    if not chromium.PROGRAM:
        pytest.skip("there is no Chromium here (Debian: apt-get install chromium)")
