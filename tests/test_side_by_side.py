"""Tests of parallel test runs in which every test must run: slow tests run, and any problem fails the whole run."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import EVERY_TEST

pytestmark = pytest.mark.once

SLOW = "import pytest\n@pytest.mark.slow\ndef test_slow(): pass"
SKIPPED = "import pytest\ndef test_skipped(): pytest.skip()"
LOST_AT_THE_END = """
import os
def pytest_sessionfinish(session):
    if hasattr(session.config, "workerinput"):
        os._exit(0)
"""


def run(folder: Path, files: dict[str, str], *options: str) -> subprocess.CompletedProcess:
    """Run these test files in a folder of their own, the way the files of this checkout are run."""
    for name, content in {"conftest.py": "from tests.conftest import *", **files}.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(content, encoding="utf-8")
    # These tests contain no assertions, so no module needs rewriting for them.
    options = ("-p", "no:cacheprovider", "--assert", "plain", *options)
    command = [sys.executable, "-m", "pytest", "--rootdir", folder, *options, folder]
    environment = os.environ | {EVERY_TEST: "1"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"test_a.py": SLOW, "test_b.py": SKIPPED}, "1 failed, 1 passed"),
        ({"end/test_a.py": SLOW, "end/conftest.py": LOST_AT_THE_END}, "A worker ended before its time"),
    ],
    ids=["skipped", "lost at the end"],
)
def test_a_run_is_red_if_a_test_of_it_was_skipped_or_a_worker_was_lost(tmp_path, files, said):
    done = run(tmp_path, files, "-n", "1", "--max-worker-restart", "0")
    assert said in done.stdout, done.stdout + done.stderr
    assert done.returncode == 1


def test_a_quick_run_takes_the_first_test_of_each_file_that_is_not_slow(tmp_path):
    more = "\ndef test_second(): pass\ndef test_third(): assert False"
    done = run(tmp_path, {"test_a.py": SLOW + more, "test_b.py": more}, "-n", "0", "--quick")
    assert "2 passed, 3 deselected" in done.stdout, done.stdout + done.stderr
