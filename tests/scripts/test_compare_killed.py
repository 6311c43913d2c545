"""compare.py under processes that die: whatever is killed, and whenever, the same command goes on and ends the same."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rigid_motion_batch.pipeline.steps import OWN
from tests.scripts.comparing import outputs, write_toss
from tests.thoroughness import THOROUGH

ROOT = Path(__file__).resolve().parents[2]

pytestmark = pytest.mark.skipif(
    not Path("/proc/self/task").exists(), reason="kills, and looks for processes where Linux shows them"
)

MOMENTS = int(os.environ.get("RIGID_MOTION_KILLS", "3" if THOROUGH else "2"))
"""How many times a run is killed, half of them the program and half of them one of its workers."""

OPTIONS = (
    *("--rates", "5,10", "--modes", "lerp_slerp,motor_spline", "--jobs", "2"),
    *("--films", "all", "--resolution", "64x36", "--fps", "12"),
)


def start(output: Path, clip: Path) -> subprocess.Popen:
    command = [sys.executable, ROOT / "scripts" / "compare.py", clip, "--output", output, *OPTIONS]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def children_of(process: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{process}/task/{process}/children").read_text().split()]
    except FileNotFoundError:
        return []


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_toss(tmp_path_factory.mktemp("clips") / "toss.csv", samples=90)


@pytest.fixture(scope="module")
def undisturbed(clip: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, float]:
    """The output folder of a run that nobody disturbed, and the seconds that it took."""
    folder = tmp_path_factory.mktemp("undisturbed")
    started = time.monotonic()
    process = start(folder, clip)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    return folder, time.monotonic() - started


def test_a_run_that_was_killed_again_and_again_ends_like_one_that_was_not(
    clip: Path, undisturbed: tuple[Path, float], tmp_path: Path
) -> None:
    reference, seconds = undisturbed
    wanted = outputs(reference)
    assert sum(path.endswith(".mp4") for path in wanted) == 2
    chance = random.Random(7)
    for number in range(MOMENTS):
        process = start(tmp_path, clip)
        time.sleep(chance.uniform(0.1, 0.9) * seconds)
        # The command waits for the program, which has the workers.
        programs = children_of(process.pid)
        workers = [worker for program in programs for worker in children_of(program)]
        if number % 2 and workers:
            os.kill(chance.choice(workers), signal.SIGKILL)
            _, said = process.communicate(timeout=300)
            assert process.returncode == 0, said
            if number + 1 < MOMENTS:
                # The next one is to have something to do.
                for path in [*tmp_path.rglob("*.mp4"), *tmp_path.rglob("keys.csv")]:
                    path.unlink()
        else:
            for program in (*programs[: number % 4 // 2], process.pid):
                os.kill(program, signal.SIGKILL)
            process.communicate()
        found = outputs(tmp_path)
        half = [path for path, content in found.items() if content not in (wanted.get(path), b"")]
        assert half == [], f"half-written after kill {number}"
    process = start(tmp_path, clip)
    _, said = process.communicate(timeout=300)
    assert process.returncode == 0, said
    assert outputs(tmp_path) == wanted
    assert not (tmp_path / OWN / "scratch").exists()
