"""The benchmark of many clips: its clips are recordings, and it sees what processes take."""

from __future__ import annotations

import os
import sys

import numpy as np
import pytest

from research import benchmark_batch
from rigid_motion_batch.recordings import read_trajectories


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
    np.testing.assert_allclose(np.linalg.norm(clip.poses.quaternions, axis=1), 1.0, atol=1e-12)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux tells")
def test_it_sees_what_a_process_has_taken_at_most():
    before = benchmark_batch.peak_memory_of(os.getpid())
    assert before > 1e7
    block = np.ones(30_000_000)
    assert benchmark_batch.peak_memory_of(os.getpid()) >= max(before, block.nbytes)
    assert benchmark_batch.peak_memory_of(2**22 + 1) == 0
    assert benchmark_batch.children_of(2**22 + 1) == []


def test_two_workers_are_told_beside_one(tmp_path, monkeypatch):
    took = {(1, False): 20.0, (2, False): 10.5, (1, True): 21.0}

    def compare(clips, folder, jobs, *options, alone):
        return benchmark_batch.Run(took[jobs, alone], 10**8, 2 * 10**8, 0.9 * took[jobs, alone] * jobs, 15.0)

    monkeypatch.setattr(benchmark_batch, "compare", compare)
    page = "\n".join(benchmark_batch.workers("two", [tmp_path] * 7, tmp_path, 2, "--no-video"))
    assert "| 1 | 20.0 | 21 | 1.00 times | 90% | 16.7% |" in page
    assert ("| 1 on one processor | 21.0 | 20 | 0.95 times | 90% |" in page) == hasattr(os, "sched_setaffinity")
    assert "| 2 | 10.5 | 40 | 1.90 times | 90% | 20.6% |" in page
