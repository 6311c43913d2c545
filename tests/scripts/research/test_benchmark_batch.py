"""The benchmark of many clips: its clips are recordings, and it sees what processes take."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest

from research import benchmark_batch
from rigid_motion_batch.recordings import read_trajectories
from tests.scripts.research.keeping import written


def test_its_clips_are_recordings_of_which_none_is_like_another(tmp_path):
    seen = set()
    for number, text in enumerate(benchmark_batch.pieces(9)):
        path = tmp_path / f"{number}.csv"
        path.write_text(text, encoding="utf-8")
        (clip,) = read_trajectories(str(path)).trajectories
        assert clip.times[-1] - clip.times[0] == pytest.approx(benchmark_batch.SECONDS, abs=0.1)
        assert np.isfinite(clip.poses.positions).all()
        seen.add(clip.poses.positions.tobytes())
    assert len(seen) == 9


def test_its_long_clip_has_as_many_samples_as_it_says(tmp_path):
    path = tmp_path / "long.csv"
    path.write_text(benchmark_batch.wandering(540), encoding="utf-8")
    (clip,) = read_trajectories(str(path)).trajectories
    assert len(clip.times) == 540
    np.testing.assert_allclose(np.linalg.norm(clip.poses.quaternions, axis=1), 1.0, atol=2e-6)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells")
def test_it_sees_what_a_process_has_taken_at_most():
    before = benchmark_batch.peak_memory_of(os.getpid())
    assert before > 1e7
    block = np.ones(30_000_000)
    assert benchmark_batch.peak_memory_of(os.getpid()) >= max(before, block.nbytes)
    assert benchmark_batch.peak_memory_of(2**22 + 1) == 0
    assert benchmark_batch.children_of(2**22 + 1) == []


def test_two_workers_are_measured_beside_one(tmp_path, monkeypatch):
    took = {(1, False): 20.0, (2, False): 10.0, (1, True): 21.0}

    def compare(clips, folder, jobs, *options, alone=False):
        return benchmark_batch.Run(took[jobs, alone], 10**8, 2 * 10**8)

    monkeypatch.setattr(benchmark_batch, "compare", compare)
    assert benchmark_batch.main(["--clips", "4", "--films", "2", "--minutes", "1", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_batch")
    assert [row["clips_a_minute"] for row in result["numbers"][:2]] == [12.0, 24.0]
    assert [row["speedup"] for row in result["videos"][:2]] == [1.0, 2.0]
