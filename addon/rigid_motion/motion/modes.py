"""The table of interpolation modes, and interpolation between keys in any mode."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from . import curves
from .algebras import cga, dual_quaternions, pga, vector_quaternion
from .checks import check_flag, check_poses
from .poses import MAX_ABS, MIN_TIME_GAP, Poses, numbers, of_each
from .segments import Curves, Segments, interpolate_along, prepare_within


@dataclass(frozen=True)
class Mode:
    """One way to interpolate between two keys: a row of the table `MODES`.

    The formulas are in `docs/conventions.md`, and those of single modes in `algebras`. Source: Kamarianakis, Lydatakis
    and Papagiannakis, "Never 'Drop the Ball' in the Operating Room". The smooth modes are new in this program.

    See Also
    --------
    interpolate : Poses between keys, in a mode given by its name in `MODES`.

    Examples
    --------
    >>> from rigid_motion.motion import MODES
    >>> MODES["motor_spline"].label, MODES["motor_spline"].is_smooth
    ('Smooth Screw', True)
    >>> [name for name, mode in MODES.items() if mode.for_streams]
    ['motor_spline_causal']
    """

    number: int
    """The number that files store for the mode. It never changes and is never reused; 0 is Blender's interpolation."""

    label: str
    """The name shown in menus and reports."""

    description: str
    """The effect on the motion in one sentence, shown as a tooltip."""

    algebra: str
    """The algebra used for the computation, as a separate sentence."""

    curves: Callable[[Segments], Curves] = field(repr=False)
    """The fast implementation."""

    reference: Callable[[Poses, Poses, np.ndarray], Poses] = field(repr=False)
    """The same motion computed in `algebra`, for single pairs of poses."""

    behind: int = 0
    """How many keys before a segment influence it. With `is_reference`, how many the key search considers."""

    ahead: int = 0
    """How many keys after a segment influence it. A stream has to wait for them."""

    for_streams: bool = False
    """Whether the mode is only for streams. It uses no key after the segment's own; keyframes have better modes."""

    is_reference: bool = False
    """Whether this is Blender's own interpolation, for comparison only and not for keyframes. Distant keys influence a
    segment a little."""

    is_separable: bool = False
    """Whether rotation and location are independent, so that each can have separate keys."""

    same: str = ""
    """Which other mode gives the same motion, and when, in one sentence."""

    twin: str = ""
    """The name in `MODES` of the mode that gives the same motion if no scale changes."""

    @property
    def is_smooth(self) -> bool:
        """Whether velocity continues from segment to segment, which requires keys outside the segment."""
        return self.behind > 0 or self.ahead > 0


MODES: dict[str, Mode] = {
    "lerp_slerp": Mode(
        1,
        "Straight",
        "The origin runs along a straight line while the body turns at an even speed",
        "Algebra: vectors and quaternions",
        curves.lerp_slerp,
        vector_quaternion.lerp_slerp,
        is_separable=True,
    ),
    "dq_sclerp": Mode(
        2,
        "Screw",
        "Turns about and slides along one fixed axis in space, both at an even speed",
        "Algebra: dual quaternions",
        curves.screw,
        dual_quaternions.dq_sclerp,
    ),
    "pga_lerp": Mode(
        3,
        "Screw Blend",
        "Nearly the screw motion, slower at the keys and faster half-way",
        "Algebra: motors of projective geometric algebra (PGA)",
        curves.motor_lerp,
        pga.pga_lerp,
    ),
    "pga_slerp": Mode(
        4,
        "Motor Screw",
        "The screw motion, computed as the exponential of the motor's logarithm",
        "Algebra: motors of projective geometric algebra (PGA)",
        curves.screw,
        pga.pga_slerp,
        same="The same motion as Screw",
        twin="dq_sclerp",
    ),
    "cga_lerp": Mode(
        5,
        "Spiral Blend",
        "The motion of Screw Blend, with uniform scale blended too",
        "Algebra: versors of conformal geometric algebra (CGA)",
        curves.similarity_lerp,
        cga.cga_lerp,
        same="The same motion as Screw Blend without scaling",
        twin="pga_lerp",
    ),
    "cga_slerp": Mode(
        6,
        "Spiral",
        "Turns, slides and grows at even rates: a screw that widens as the body grows",
        "Algebra: versors of conformal geometric algebra (CGA)",
        curves.similarity_slerp,
        cga.cga_slerp,
        same="The same motion as Screw without scaling",
        twin="dq_sclerp",
    ),
    "motor_spline": Mode(
        7,
        "Smooth Screw",
        "Screws that flow into one another: no corner at a key, neither in path nor in rotation",
        "Algebra: motors of projective geometric algebra (PGA)",
        curves.motor_spline,
        pga.pga_slerp,
        behind=1,
        ahead=1,
        same="The same motion as Screw between just two keys",
    ),
    "motor_spline_causal": Mode(
        8,
        "Smooth Screw for Streams",
        "Screws that flow into one another as far as possible without knowing beyond the next key",
        "Algebra: motors of projective geometric algebra (PGA)",
        curves.motor_spline_causal,
        pga.pga_slerp,
        behind=2,
        for_streams=True,
    ),
    "bezier": Mode(
        0,
        "Blender's Curves",
        "Every number by itself, with the handles that Blender gives new keys, Auto Clamped",
        "Algebra: none, cubics of x, y, z and the four numbers of a quaternion",
        curves.bezier,
        vector_quaternion.bezier,
        behind=3,
        ahead=3,
        is_reference=True,
    ),
}
"""All modes, by the name that functions accept."""

KEYFRAME_MODES: dict[str, Mode] = {
    name: mode for name, mode in MODES.items() if not (mode.for_streams or mode.is_reference)
}
"""The modes for keyframes, where all keys are known from the beginning."""


def mode_named(name: str) -> Mode:
    """Return the mode with this name in `MODES`. For any other name, raise a ValueError that lists the modes."""
    if not isinstance(name, str):
        raise TypeError(f"mode is {name!r}: give the name of one, such as 'dq_sclerp'")
    if name not in MODES:
        raise ValueError(no_such_mode(name, MODES))
    return MODES[name]


def no_such_mode(name: str, modes: Iterable[str]) -> str:
    """Return the error message for a name that is not among these modes."""
    return f"there is no mode {name!r}; the modes are {', '.join(modes)}"


def interpolate(
    key_times: ArrayLike, keys: Poses, times: ArrayLike, mode: str = "dq_sclerp", *, extrapolate: bool = False
) -> Poses:
    """Return the poses at `times` of objects with the poses `keys` at `key_times`.

    Parameters
    ----------
    key_times : array-like, shape (n,) or (..., n)
        Strictly rising, in any unit; the same for all objects, or one row for each.
    keys : Poses, shape (n,) or (..., n)
        The leading axes count objects. Quaternions need not be normalised. A quaternion more than 180 degrees from its
        predecessor is used with the opposite sign, so that the motion goes the short way.
    times : array-like, shape (m,) or (..., m)
        In any order, in the unit of `key_times`; the same for all objects, or one row for each.
    mode : str
        A name in `MODES`. The formulas of all modes, with sources, are in `docs/conventions.md`.
    extrapolate : bool
        Whether the motion of the first and last segment continues outside the keys. Otherwise the end poses hold.
        Scales stay positive: they stop at `1e40` and `1e-40`, and `cga_lerp` with growth stops before a scale of zero.

    Returns
    -------
    Poses, shape (m,) or (..., m)
        With unit quaternions, in the unit of the keys' positions. The arrays may be views that are not contiguous.

    Raises
    ------
    TypeError
        If the keys are not a `Poses`.
    ValueError
        For an unknown mode, shapes that do not fit, times that do not rise, numbers that are not finite, quaternions of
        length zero and scales that are not positive. The message names the key.

    See Also
    --------
    in_betweens : Interpolation with a custom timing of each segment, such as an ease.

    Notes
    -----
    Between two rotations exactly 180 degrees apart there are two shortest ways. The signs of the given quaternions
    decide which one is used.

    Examples
    --------
    One metre along x with a quarter turn about z. The screw turns around an axis and does not follow the straight line:

    >>> from rigid_motion.motion import Poses, interpolate
    >>> keys = Poses([[0, 0, 0], [1, 0, 0]], [[1, 0, 0, 0], [1, 0, 0, 1]])
    >>> interpolate([0, 1], keys, [0.5], "dq_sclerp").positions.round(6).tolist()
    [[0.5, -0.207107, 0.0]]
    >>> interpolate([0, 1], keys, [0.5], "lerp_slerp").positions.round(6).tolist()
    [[0.5, 0.0, 0.0]]
    """
    curves_of_mode = mode_named(mode).curves
    key_times, times = numbers(key_times, "key times"), numbers(times, "times")
    check_flag(extrapolate, "extrapolate")
    keys = _checked(key_times, keys)
    if keys.shape[-1] == 1:
        # A motion with a single key rests all the time: a segment from that key to itself.
        keys, key_times = keys[..., [0, 0]], np.array((0.0, 1.0))
    if times.ndim == 0:
        raise ValueError("times to interpolate at need the shape (m,): of a single one make a list, [time]")
    if times.shape not in ((times.shape[-1],), keys.shape[:-1] + times.shape[-1:]):
        raise ValueError(f"times of shape {times.shape} do not fit keys of shape {keys.shape}")
    if times.size == 0:
        return keys[..., :0]
    # Rising times with finite ends are all finite, and NaN never compares as rising.
    if np.all(times[..., 1:] >= times[..., :-1]) and np.isfinite(times[..., [0, -1]]).all():
        return interpolate_along(curves_of_mode, key_times, keys, times, extrapolate)
    if not np.isfinite(times).all():
        raise ValueError("times to interpolate at need to be finite numbers")
    order = np.argsort(times, axis=-1, kind="stable")
    rising = np.take_along_axis(times, order, axis=-1)
    poses = interpolate_along(curves_of_mode, key_times, keys, rising, extrapolate)
    inverse = np.broadcast_to(np.argsort(order, axis=-1, kind="stable"), poses.shape)
    return of_each(poses, lambda rows: np.take_along_axis(rows, inverse[..., None], axis=-2))


def in_betweens(
    key_times: ArrayLike, keys: Poses, counts: ArrayLike, progress: ArrayLike, mode: str = "dq_sclerp"
) -> Poses:
    """Return poses within segments at a custom timing of each segment, such as an ease.

    Parameters
    ----------
    key_times : array-like, shape (n,) or (..., n)
        Strictly rising, in any unit.
    keys : Poses, shape (n,) or (..., n)
        As in `interpolate`, at least two a row.
    counts : array-like of int, shape (n - 1,) or (..., n - 1)
        How many poses to return for each segment.
    progress : array-like, shape (m,), m the sum of the counts
        The progress of each pose within its segment, from 0 at the first key to 1 at the second. Outside this range,
        the motion of the segment continues, as in `interpolate` with `extrapolate`.
    mode : str
        A name in `MODES`.

    Returns
    -------
    Poses, shape (m,)
        One segment after the other, with unit quaternions, in the unit of the keys' positions. The arrays may be views
        that are not contiguous.

    Raises
    ------
    TypeError, ValueError
        As `interpolate` does, and for counts that are not whole numbers from 0 on, or whose sum is not the number of
        progress values.

    See Also
    --------
    prepare : The same for several calls with the same keys.
    interpolate : Poses at given times.

    Examples
    --------
    Two early poses of the first segment, as with an ease, and one pose of the second:

    >>> from rigid_motion.motion import Poses, in_betweens
    >>> keys = Poses([[0, 0, 0], [1, 0, 0], [1, 2, 0]], [[1, 0, 0, 0]] * 3)
    >>> in_betweens([0, 1, 2], keys, [2, 1], [0.01, 0.25, 0.5], "lerp_slerp").positions.round(6).tolist()
    [[0.01, 0.0, 0.0], [0.25, 0.0, 0.0], [1.0, 1.0, 0.0]]
    """
    return prepare(key_times, keys, mode)(counts, progress)


def prepare(key_times: ArrayLike, keys: Poses, mode: str = "dq_sclerp") -> Callable[..., Poses]:
    """Prepare several calls of `in_betweens` with the same keys: work that depends only on the keys is done once.

    Parameters
    ----------
    key_times : array-like, shape (n,) or (..., n)
        Strictly rising, in any unit.
    keys : Poses, shape (n,) or (..., n)
        As in `interpolate`, at least two a row.
    mode : str
        A name in `MODES`.

    Returns
    -------
    callable
        Takes (counts, progress, selected=slice(None)) and returns Poses of shape (m,), with counts and progress as in
        `in_betweens`. `selected` is the slice of segments to use, counted through all objects one after the other. Its
        step is 1 and its bounds are not negative.

    Raises
    ------
    TypeError, ValueError
        As `in_betweens` does; the returned callable raises the same errors.

    See Also
    --------
    in_betweens : The same in a single call.

    Examples
    --------
    >>> from rigid_motion.motion import Poses, prepare
    >>> segments = prepare([0, 1, 2], Poses([[0, 0, 0], [1, 0, 0], [1, 2, 0]], [[1, 0, 0, 0]] * 3), "lerp_slerp")
    >>> segments([1, 1], [0.5, 0.5]).positions.tolist()
    [[0.5, 0.0, 0.0], [1.0, 1.0, 0.0]]
    >>> segments([1], [0.25], slice(1, 2)).positions.tolist()
    [[1.0, 0.5, 0.0]]
    """
    curves_of_mode = mode_named(mode).curves
    key_times = numbers(key_times, "key times")
    keys = _checked(key_times, keys)
    if keys.shape[-1] < 2:
        raise ValueError("in-betweens need at least two keys")
    shape = (*keys.shape[:-1], keys.shape[-1] - 1)
    within = prepare_within(curves_of_mode, key_times, keys)

    def poses(counts: ArrayLike, progress: ArrayLike, selected: slice = slice(None)) -> Poses:
        """Return poses (m,) of the selected segments, from the pose count of each and the progress of each pose."""
        counts, progress = np.asarray(counts), numbers(progress, "progress")
        if counts.size and (not np.issubdtype(counts.dtype, np.integer) or counts.min() < 0):
            raise ValueError("counts of in-betweens need to be whole numbers from 0 on, one for each segment")
        expected = shape if selected == slice(None) else (len(range(*selected.indices(math.prod(shape)))),)
        if counts.shape != expected or progress.shape != (int(counts.sum()),):
            raise ValueError(
                f"counts of shape {counts.shape} and {progress.size} progresses do not fit keys of {keys.shape}"
            )
        if not np.isfinite(progress).all():
            raise ValueError("progress needs to be made of finite numbers")
        return within(counts.ravel(), progress, selected)

    return poses


def _checked(key_times: np.ndarray, keys: Poses) -> Poses:
    """Return the keys with unit quaternions. Raise a ValueError that names the first invalid key."""
    check_poses(keys, "keys")
    if not keys.shape or keys.shape[-1] == 0:
        raise ValueError("interpolation needs at least one key")
    if key_times.shape not in (keys.shape, keys.shape[-1:]):
        raise ValueError(f"key times of shape {key_times.shape} do not fit keys of shape {keys.shape}")
    lengths = np.sqrt(np.einsum("...i,...i->...", keys.quaternions, keys.quaternions))
    _require(np.abs(key_times) < MAX_ABS, f"has a time that is not finite, or beyond {MAX_ABS:g}")
    _require(np.diff(key_times, prepend=-np.inf) > MIN_TIME_GAP, "is not later than the key before it")
    _require(np.abs(keys.positions) < MAX_ABS, f"has a position that is not finite, or beyond {MAX_ABS:g}", 1)
    _require(np.isfinite(lengths), "has a quaternion that is not finite")
    _require(lengths > 0.0, "has a quaternion of length zero")
    if keys.scales is not None:
        valid = (keys.scales > 1.0 / MAX_ABS) & (keys.scales < MAX_ABS)
        _require(valid, f"has a scale that is not a positive number, or beyond {MAX_ABS:g}")
    return Poses(keys.positions, keys.quaternions / lengths[..., None], keys.scales)


def _require(valid: np.ndarray, complaint: str, axes_of_a_key: int = 0) -> None:
    """Raise a ValueError that names the first invalid key. The last `axes_of_a_key` axes are within a key."""
    if not valid.all():
        index = np.argwhere(~valid)[0].tolist()
        *objects, key = index[: len(index) - axes_of_a_key]
        raise ValueError(f"key {key}{f' of object {objects}' if objects else ''} {complaint}")
