"""Decimation: selects the samples of a recording to keep as keys, at a fixed rate."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_times, number
from .poses import numbers


def decimate(times: ArrayLike, rate: float) -> np.ndarray:
    """Return the samples that a sender of `rate` poses per second would have sent: those nearest to its ticks.

    Parameters
    ----------
    times : array-like, shape (n,)
        Seconds, strictly rising, at least one.
    rate : float
        Keys per second. The ticks start at the first sample.

    Returns
    -------
    array of int, shape (k,)
        Rising indices without repetition, with at least the first; all samples where they are rarer than ticks.

    Raises
    ------
    ValueError
        If the rate is not a positive number, or if there are no times or they are not finite or do not rise. The
        message names the sample.

    See Also
    --------
    reduce_keys : Finds the samples that a mode needs, unevenly in time.

    Examples
    --------
    >>> import numpy as np
    >>> from rigid_motion.motion import decimate
    >>> decimate(np.arange(10) / 90, 30).tolist()
    [0, 3, 6, 9]
    """
    rate = number(rate, "rate")
    if not (np.isfinite(rate) and rate > 0.0):
        raise ValueError(f"a rate of {rate} keys a second is not a positive number")
    times = numbers(times, "times")
    check_times(times)
    if not len(times):
        raise ValueError("there are no times to decimate")
    # One more tick than fits the duration would repeat the last sample; the 1e-9 allows for rounding, as in 2.0 * 0.5.
    duration = times[-1] - times[0]
    if duration * rate > 4.0 * len(times):
        return np.arange(len(times))
    ticks = times[0] + np.arange(np.floor(duration * rate + 1e-9) + 1.0) / rate
    return np.unique(nearest(times, ticks))


def nearest(times: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Return the index of the time nearest to each moment; of two equally near, the earlier one."""
    if len(times) == 1:
        return np.zeros(np.shape(moments), dtype=np.int64)
    after = np.clip(np.searchsorted(times, moments), 1, len(times) - 1)
    return after - (moments - times[after - 1] <= times[after] - moments)
