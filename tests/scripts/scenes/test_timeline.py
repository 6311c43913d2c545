import numpy as np

from rigid_motion_batch.scenes.timeline import peaks


def test_the_least_and_the_largest_of_each_column_are_kept():
    values = np.random.default_rng(5).normal(size=10_000)
    kept = peaks(values, 100)
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= 202
    for column in np.split(np.arange(10_000), 100):
        here = values[kept[(kept >= column[0]) & (kept <= column[-1])]]
        assert (here.min(), here.max()) == (values[column].min(), values[column].max())
    assert np.array_equal(peaks(values[:7], 100), np.arange(7))
