"""Tests of killed runs and workers: finished results stay, and the next run completes the work."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.scripts.pipeline.plans import contents, half_written
from tests.scripts.processes import alive, descendants, run_python
from tests.thoroughness import THOROUGH

KILLED = """
import os, sys, time
from pathlib import Path
from rigid_motion_batch.pipeline.executors import ProcessExecutor
from tests.scripts.pipeline.plans import joining, run_in, task
from tests.scripts.pipeline.steps import Write

if __name__ == "__main__":
    tasks = [task(str(n), Write(str(n), seconds=0.05)) for n in range(20)]
    run_in(Path(sys.argv[1]), *tasks, joining("all", *tasks), executor=ProcessExecutor(2))
"""

MOMENTS = 10 if THOROUGH else 5


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="looks for processes where Linux shows them")
def test_a_run_that_was_killed_again_and_again_ends_like_one_that_was_not(output: Path, tmp_path: Path) -> None:
    expected = {f"{n}.txt": f"{n}" for n in range(20)} | {"all.txt": "".join(f"{n}" for n in range(20))}
    (tmp_path / "killed.py").write_text(KILLED)
    command, results = [sys.executable, tmp_path / "killed.py", output], 0
    for number in range(MOMENTS):
        with subprocess.Popen(command) as process:
            ends = time.monotonic() + 30.0
            while len(list(output.glob("*.txt"))) <= min(results, 20) and process.poll() is None:
                assert time.monotonic() < ends
                time.sleep(0.01)
            time.sleep(0.01 * (number % 5))
            workers = descendants(process.pid)
            process.kill()
        result = contents(output)
        results = len(result)
        assert result.items() <= expected.items()
        ends = time.monotonic() + 5.0
        while any(map(alive, workers)) and time.monotonic() < ends:
            time.sleep(0.01)
        assert not any(map(alive, workers))
    assert run_python(*command[1:]).returncode == 0
    assert contents(output) == expected
    assert half_written(output) == []
