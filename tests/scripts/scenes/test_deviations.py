import pytest

from rigid_motion_batch.scenes.deviations import magnification


@pytest.mark.parametrize(
    ("deviation", "factor"), [(0.0, 1.0), (1e-5, 2000.0), (1e-3, 20.0), (0.004, 5.0), (0.021, 1.0), (3.0, 1.0)]
)
def test_the_factor_is_a_round_number(deviation, factor):
    assert magnification(deviation, 0.1) == factor
