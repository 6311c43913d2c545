"""The benchmark of many clips: its clips are recordings, and it sees what processes take."""

import os
import sys

import numpy as np
import pytest

from research import benchmark_batch
from tests.scripts.research.keeping import written


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
