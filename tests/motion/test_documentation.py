"""Tests of the public docstrings: arguments, results and errors are described, and examples are true."""

import doctest
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rigid_motion import motion

ADDON = Path(__file__).resolve().parents[2] / "addon"
CALLABLES = sorted(name for name in motion.__all__ if callable(getattr(motion, name)))
FUNCTIONS = [name for name in CALLABLES if inspect.isfunction(getattr(motion, name))]

ALONE = """
import sys
import numpy
before = {name.split(".")[0] for name in sys.modules}
import rigid_motion.motion
print(*sorted({name.split(".")[0] for name in sys.modules} - before - sys.stdlib_module_names))
"""


def sections(name: str) -> dict[str, str]:
    """Return the sections of a docstring: text by heading."""
    parts = re.split(r"^(\w[\w ]*)\n-+$", inspect.getdoc(getattr(motion, name)), flags=re.MULTILINE)
    return {heading: text.strip("\n") for heading, text in zip(parts[1::2], parts[2::2], strict=True)}


def entries(text: str) -> list[str]:
    """Return the names that a docstring section describes: the text at the margin, before a colon."""
    heads = [line.split(" : ")[0] for line in text.splitlines() if line and not line.startswith(" ")]
    return [name for head in heads for name in head.split(", ")]


@pytest.mark.parametrize("name", CALLABLES)
def test_the_examples_of_what_is_public_are_true(name):
    documented = getattr(motion, name)
    # In an empty namespace, as for a reader who copies the example.
    result = doctest.DocTestFinder(recurse=inspect.isclass(documented)).find(documented, name, globs={})
    runner = doctest.DocTestRunner(verbose=False)
    report: list[str] = []
    for example in result:
        runner.run(example, out=report.append)
    assert runner.tries > 0, f"{name} has no example"
    assert runner.failures == 0, "".join(report)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_argument_is_described_and_none_that_is_not_there(name):
    described = entries(sections(name)["Parameters"])
    assert described == list(inspect.signature(getattr(motion, name)).parameters)


def test_motion_needs_numpy_alone_and_warns_of_nothing():
    command = [sys.executable, "-W", "error", "-c", ALONE]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ADDON)
    assert (done.returncode, done.stdout.split(), done.stderr) == (0, ["rigid_motion"], "")
