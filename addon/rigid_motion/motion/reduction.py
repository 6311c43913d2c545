"""Key reduction: the few samples of a recording that, as keys of a mode, reproduce its motion.

A key is a pose: all channels together. What is promised of them, and checked; `key_search` finds them, and
`key_budget` so many of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_flag, check_radius, check_recording, check_wishes
from .key_budget import fewest_keys
from .key_costs import SampleTracks
from .modes import mode_named
from .poses import Poses, aligned, numbers


def reduce_keys(
    times: ArrayLike,
    poses: Poses,
    mode: str = "motor_spline",
    tolerance: float | None = None,
    radius: float = 0.1,
    *,
    budget: int | None = None,
    rms: bool = False,
    tries: int = 3,
) -> np.ndarray:
    """Return fewest samples that keep the shell error of a mode within a tolerance, or the best ones within a budget.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    mode : str
        A name in `MODES`.
    tolerance : float, optional
        The largest shell error anywhere, in the unit of the positions; with `rms` the root mean square over all
        samples.
    radius : float
        Of the shell, in the unit of the positions; not below zero.
    budget : int, optional
        The most keys, at least 2, instead of a tolerance: the error is then as small as a few tries find, mostly no
        larger than what bisecting the tolerance reaches, and seldom more than a twentieth above it. With `rms` it may
        be up to a third above it. A body that does not move has two.
    rms : bool
        Go by the root mean square of the shell error instead of the largest.
    tries : int
        How many more searches there are, up to three: what they have found is put together. Each begins with fewer keys
        than the tolerance allows, and puts some back where the motion is off, which takes about half as long as the
        first search; under `rms` it keeps to another tolerance, and takes as long. With a budget, 0 is the first
        search alone; one try lays the keys out anew, and a second one does so again for splines with ten samples or
        more for each key.

    Returns
    -------
    array of int, shape (k,)
        Rising, the first and the last sample among them.

    Raises
    ------
    TypeError
        Where the recording is no `Poses`, or an argument is of the wrong type: a tolerance in quotes, a budget that is
        no int. The message names the argument.
    ValueError
        Where not exactly one of tolerance and budget is given, the mode is unknown, either of the two or the radius is
        no sensible number, or a sample is not finite, out of order or of no size. The message names the sample.

    See Also
    --------
    decimate : Keys evenly in time.
    fit_keys : Poses for the keys that are closer to the recording than its own.
    best_modes : The mode of each segment.
    reduce_skeleton_keys : The same for joints that hang on one another.

    Notes
    -----
    Keys are taken out and moved as long as that lowers their number or the error (Lyche and Mørken, "Knot removal for
    parametric B-spline curves and surfaces", 1987), and what several searches found is put together by dynamic
    programming. It is not always the least number of keys that there is.

    Examples
    --------
    Ninety samples of a screw need two keys where screws are what fills in, and more where straight lines are:

    >>> import numpy as np
    >>> from rigid_motion.motion import Poses, reduce_keys
    >>> turn = np.linspace(0, np.pi / 2, 90)
    >>> positions = np.stack((np.cos(turn), np.sin(turn), 0.1 * turn), axis=1)
    >>> poses = Poses(positions, np.stack((np.cos(turn / 2), 0 * turn, 0 * turn, np.sin(turn / 2)), axis=1))
    >>> reduce_keys(np.arange(90) / 90, poses, "dq_sclerp", tolerance=0.005).tolist()
    [0, 89]
    >>> len(reduce_keys(np.arange(90) / 90, poses, "lerp_slerp", tolerance=0.005))
    10
    >>> len(reduce_keys(np.arange(90) / 90, poses, "lerp_slerp", budget=5))
    5
    """
    mode_named(mode)
    check_wishes(tolerance, budget, tries)
    check_flag(rms, "rms")
    check_radius(radius)
    times = numbers(times, "times")
    check_recording(times, poses)
    return fewest_keys(SampleTracks(times, aligned(poses), mode, radius, tolerance or 1.0), budget, tries, rms=rms)
