"""Tests of the interpolation benchmark: rates of the fastest round, and the figures that its page reads."""

import pytest

from research import benchmark
from tests.scripts.research.keeping import written


def test_rates_are_those_of_the_fastest_round():
    case = next(benchmark.cases(2000))
    program, peer = benchmark.rates(
        case, {("dq_sclerp", benchmark.PROGRAM): [0.004, 0.005], ("dq_sclerp", "SciPy"): [0.4, 0.3]}
    )
    assert program["millions"] == pytest.approx(case.in_betweens / 0.004 / 1e6)
    assert (program["faster_by"], peer["faster_by"]) == (None, pytest.approx(75.0))


def test_the_study_writes_what_the_page_reads(tmp_path):
    assert benchmark.main(["--count", "1000", "--rounds", "1", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark")
    assert result["cases"][0]["in_betweens"] == 1000
