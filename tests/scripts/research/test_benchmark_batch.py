"""The benchmark of many clips: its clips are recordings, and it sees what processes take."""

from research import benchmark_batch
from tests.scripts.research.keeping import written


def test_two_workers_are_measured_beside_one(tmp_path, monkeypatch):
    def compare(clips, folder, jobs, *options, alone=False):
        return benchmark_batch.Run(1.0, 10**8, 2 * 10**8)

    took = {(1, False): [20.0, 21.0], (2, False): [11.0, 10.0], (1, True): [21.0, 22.0]}
    monkeypatch.setattr(benchmark_batch, "interleaved_seconds", lambda runs, rounds: took)
    monkeypatch.setattr(benchmark_batch, "compare", compare)
    assert benchmark_batch.main(["--clips", "4", "--films", "2", "--minutes", "1", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_batch")
    assert [row["clips_a_minute"] for row in result["numbers"][:2]] == [12.0, 24.0]
    assert [row["speedup"] for row in result["videos"][:2]] == [1.0, 2.0]
