"""Key reduction: the few samples of a recording that reproduce its motion as keys of a mode.

A key is a pose: all channels together. This module has the public function and checks its arguments. `key_search` finds
the keys, and `key_budget` finds keys within a budget.
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
    """Return the fewest samples that keep a mode's shell error within a tolerance, or the best ones within a budget.

    Parameters
    ----------
    times : array-like, shape (n,)
        Strictly rising, in any unit.
    poses : Poses, shape (n,)
        The recording, with unit quaternions.
    mode : str
        A name in `MODES`.
    tolerance : float, optional
        The largest shell error at any sample, in the unit of the positions; with `rms` the root mean square over all
        samples.
    radius : float
        The radius of the shell, in the unit of the positions; not below zero.
    budget : int, optional
        The maximum number of keys, at least 2, instead of a tolerance. The error is then as small as a few tries can
        make it: mostly no larger than by bisecting the tolerance, and seldom more than a twentieth above that. With
        `rms` it may be up to a third above. A body that does not move gets two keys.
    rms : bool
        Use the root mean square of the shell error instead of the largest.
    tries : int
        How many additional searches are made, up to three; their results are combined. Each begins with fewer keys than
        the tolerance allows and adds keys where the error is too large, which takes about half as long as the first
        search. With `rms` it uses a different tolerance and takes as long as the first. With a budget, 0 means the
        first search alone; the first try distributes the keys anew, and the second does so again for splines with ten
        samples or more for each key.

    Returns
    -------
    array of int, shape (k,)
        The samples to use as keys, rising, including the first and the last sample.

    Raises
    ------
    TypeError
        If the recording is not a `Poses`, or an argument is of the wrong type: a tolerance in quotes, a budget that is
        not an int. The message names the argument.
    ValueError
        Unless exactly one of tolerance and budget is given, or if the mode is unknown, the tolerance, the budget or the
        radius is not a sensible number, or a sample is not finite, out of order, or has a quaternion of length zero or
        a scale that is not positive. The message names the sample.

    See Also
    --------
    decimate : Keys evenly spaced in time.
    fit_keys : Key poses that approximate the recording better than its own samples.
    reduce_skeleton_keys : The same for the joints of a skeleton.

    Notes
    -----
    Keys are removed and moved as long as this lowers their number or the error (Lyche and Mørken, "Knot removal for
    parametric B-spline curves and surfaces", 1987). The results of several searches are combined by dynamic
    programming. The number of keys is not always the smallest possible one.

    Examples
    --------
    Ninety samples of a screw need two keys with screw interpolation, and more with straight lines:

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
