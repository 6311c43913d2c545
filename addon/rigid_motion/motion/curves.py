"""Fast forms of the modes: the curve of each mode between keys, in the terms of `rigid_motion.motion.segments`.

With D the chord, n the axis and h a quarter of the angle turned, positions relative to the centre are

    lerp_slerp              D s / 2
    dq_sclerp, pga_slerp    D_along s / 2 + D_across a + (n x D) b,       psi = s h
    pga_lerp, cga_lerp      D a + (n x D) b,                              tan(psi) = s tan(h)

    a = sin(psi) cos(psi) / sin(2 h),    b = sin(psi)^2 / sin(2 h) - tan(h) / 2

So the normalised blend of motors, which needs no sine, is the curve of the screw, except for its uneven speed and its
advance along the axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .channel_curves import auto_clamped_slopes
from .poses import MAX_ABS
from .quaternions import components
from .segments import SMALLEST_ANGLE, Basis, Curves, Rows, Segments
from .trigonometry import fill_sine_and_cosine

LATE_SEGMENT_RATIO = 2.0
"""A key of a stream counts as late if its segment takes more than this many times as long as the segment before."""

MAX_LOG_SCALE = float(np.log(MAX_ABS))
"""Outside the keys the logarithm of a scale grows to this at most, and falls to its negative."""


def lerp_slerp(segments: Segments) -> Curves:
    """Return straight lines for positions and great arcs for rotations."""

    def basis(s: np.ndarray, parameters: list[np.ndarray], narrow: bool) -> Rows:
        rows = np.empty((4, s.size))
        _slerp(s, parameters[0], narrow, rows[:2])
        rows[2], rows[3] = 1.0, s
        return rows, _geometric_scales(s, parameters)

    return _curves(segments, (segments.centre, 0.5 * segments.chord), (segments.quarter_angle,), basis)


def bezier(segments: Segments) -> Curves:
    """Return Blender's own curves: each number by itself, with Auto Clamped handles, and then unit quaternions."""

    def basis(s: np.ndarray, parameters: list[np.ndarray], _narrow: bool) -> Rows:
        # Outside its keys, an F-curve of Blender is constant.
        powers = np.vander(np.clip(0.5 + 0.5 * s, 0.0, 1.0), 7, increasing=True).T
        squared, scales = np.einsum("kn,kn->n", powers, parameters[:7]), None
        if parameters[7:]:
            # It stays between the keys, except for rounding.
            scales = np.maximum(np.einsum("kn,kn->n", powers[:4], parameters[7:11]), parameters[11])
        return np.concatenate((powers[:4] / np.sqrt(squared), powers[:4])), scales

    keys, desired, durations = segments.keys, segments.desired, segments.durations
    scales = () if keys.scales is None else (keys.scales[None],)
    values = np.concatenate((components(keys.positions), components(keys.quaternions), *scales))
    slopes, steps = auto_clamped_slopes(durations, values), np.diff(values)
    leaving, arriving = slopes[..., :-1] * durations, slopes[..., 1:] * durations
    cubics = np.stack(
        (values[..., :-1], leaving, 3.0 * steps - 2.0 * leaving - arriving, leaving + arriving - 2.0 * steps), axis=1
    )
    cubics = cubics[..., desired].reshape(len(values), 4, -1)
    turning = cubics[3:7]
    squared = np.zeros((7, turning.shape[-1]))
    for power in range(4):
        squared[power : power + 4] += np.einsum("ks,kbs->bs", turning[:, power], turning)
    least = () if segments.scales is None else (segments.scales.min(axis=0)[None],)
    return Curves(turning, cubics[:3], np.concatenate((squared, *cubics[7:], *least)), basis)


def screw(segments: Segments) -> Curves:
    """Return the screw motion from key to key: ScLERP, and the SLERP of motors."""

    def basis(s: np.ndarray, parameters: list[np.ndarray], narrow: bool) -> Rows:
        rows = np.empty((6, s.size))
        _slerp(s, parameters[0], narrow, rows[:2])
        rows[2], rows[3] = 1.0, s
        np.multiply(rows[1], rows[:2], out=rows[4:])
        return rows, _geometric_scales(s, parameters)

    along, across, around = segments.decompose()
    sine = np.sin(2.0 * segments.quarter_angle)
    offset = segments.centre - 0.5 * np.tan(segments.quarter_angle) * around
    return _curves(segments, (offset, 0.5 * along, across / sine, around / sine), (segments.quarter_angle,), basis)


def motor_lerp(segments: Segments) -> Curves:
    """Return the normalised blend of two motors: of PGA, of CGA without scale, or of dual quaternions."""

    def basis(s: np.ndarray, parameters: list[np.ndarray], _narrow: bool) -> Rows:
        rows = np.empty((5, s.size))
        _lerp(s, parameters[0], rows[:2])
        rows[2] = 1.0
        np.multiply(rows[1], rows[:2], out=rows[3:])
        return rows, _geometric_scales(s, parameters)

    _, _, around = segments.decompose()
    tangent, sine = np.tan(segments.quarter_angle), np.sin(2.0 * segments.quarter_angle)
    return _curves(
        segments,
        (segments.centre - 0.5 * tangent * around, segments.chord / sine, around / sine),
        (tangent,),
        basis,
    )


def motor_spline(segments: Segments, tangents: np.ndarray | None = None, spins: np.ndarray | None = None) -> Curves:
    """Return a screw from key to key, bent so that its twist is continuous at every key.

    The twist at a key is a mean of the twists of the segments next to it, see `twist_shares`. The outermost keys have
    the twist of their segment. A key has none if the body rests before or after it. `tangents`, shape (2, ..., S),
    scales the twists at both ends of each segment, for keys that are passed at speeds of their own. `spins` (3, 2, ...,
    n - 1) are angular velocities that are added to the curve at both ends of the segments, in the segments' own time:
    the twist that is continuous at a key includes them.
    """

    def at_keys(
        leaving: np.ndarray, arriving: np.ndarray, before: np.ndarray, after: np.ndarray, rests: np.ndarray
    ) -> np.ndarray:
        share = twist_shares(before, after)
        inner = share * arriving[..., :-1] + (1.0 - share) * leaving[..., 1:]
        if rests.any():
            inner[:, rests[..., :-1] | rests[..., 1:]] = 0.0
        return np.concatenate((leaving[..., :1], inner, arriving[..., -1:]), axis=-1)

    return _bent(segments, at_keys, 1.0 if tangents is None else tangents, spins)


def motor_spline_causal(segments: Segments) -> Curves:
    """Return the spline for streams, which depends on no key after the segment.

    The twist at a key is that of the screw leading to it, plus half of a share of its change from the screw before: the
    whole share overshoots. A rest is kept, although the stream did not announce it when the body arrived there. Nor
    does a stream announce that the next key comes late: where a segment takes more than `LATE_SEGMENT_RATIO` times as
    long as the one before, the twist it starts with dies away in that time, and the screw goes on alone.
    """

    def at_keys(
        twists: np.ndarray, _: np.ndarray, before: np.ndarray, after: np.ndarray, rests: np.ndarray
    ) -> np.ndarray:
        share = np.minimum(after / (before + after), before / after)
        inner = twists[..., 1:] + 0.5 * share * (twists[..., 1:] - twists[..., :-1])
        if rests.any():
            inner[:, rests[..., 1:]] = 0.0
        return np.concatenate((twists[..., :1], twists[..., :1], inner), axis=-1)

    duration = segments.durations
    before = np.concatenate((duration[..., :1], duration[..., :-1]), axis=-1)
    fades = np.minimum(LATE_SEGMENT_RATIO * before / duration, 1.0)
    fades = np.broadcast_to(fades, segments.keys[..., 1:].shape)[..., segments.desired].ravel()
    return replace(_bent(segments, at_keys), fades=None if np.all(fades == 1.0) else fades)


SHORT_SEGMENT_RATIO = 1.0 / 16.0
"""Fraction of its neighbour's duration up to which a segment passes on no twist."""


def twist_shares(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the share of the twist before a key in the twist of the key; the twist after it has the rest.

    The parabola through the key and its neighbours would have

        h1 / (h0 + h1)

    for segments of durations h0 and h1. That gives nearly all to the shorter segment, and its twist, kept up for as
    long as the longer one takes, leads any distance away. So the share of the shorter one is at most short / long:
    neither segment then gets more than |r0| + |r1| of the two screws in its own time, measured anywhere on the body.
    Up to `SHORT_SEGMENT_RATIO` the share is zero: a segment this short is often a jump, such as a change of parent from
    one frame to the next, which would swing the neighbouring segment by 4/27 of its way. Durations alone decide,
    because the length of a screw depends on the choice of the body's origin.
    """
    shares = np.clip(after / (before + after), 1.0 - after / before, before / after)
    return np.where(
        after <= SHORT_SEGMENT_RATIO * before, 1.0, np.where(before <= SHORT_SEGMENT_RATIO * after, 0.0, shares)
    )


def _bent(
    segments: Segments,
    at_keys: Callable[..., np.ndarray],
    tangents: np.ndarray | float = 1.0,
    spins: np.ndarray | None = None,
) -> Curves:
    """Return a screw from key to key, bent so that the body has the given twists at the keys.

    Between the poses M and M exp(r), with twists w and w' at the ends, in the segment's own time u from 0 to 1, it is

        M exp(u r) exp(u (1 - u)^2 (w - r) - u^2 (1 - u) (w' - r))

    Each factor is a function of twists in the body's own axes, so neither the axes of the world nor those of the body
    matter. If the twists at keys treat before and after equally, the motion backwards is the same.

    `at_keys` returns the twists at the n + 1 keys (7, ..., n + 1). It is given the twists with which the n segments
    leave their first keys and arrive at their second ones, the durations of all segments but the last and of all but
    the first, and where the body rests (..., n). The given twists are those of the screws, plus the `spins` of
    `motor_spline`.
    """
    duration, rests, desired = segments.durations, segments.are_still, segments.desired
    ways = segments.screws[:, None]
    if spins is not None:
        ways = np.concatenate((ways[:3] + spins, ways[3:].repeat(2, axis=1)))
        rests = rests & ~spins.any(axis=(0, 1))
    rates = ways / duration
    leaving, arriving = rates[:, 0], rates[:, -1]
    twists = at_keys(leaving, arriving, duration[..., :-1], duration[..., 1:], rests)
    ends = np.stack([twists[..., keys][..., desired] for keys in (slice(None, -1), slice(1, None))], axis=1)
    ends = ends * (duration[..., desired] * tangents) - ways[..., desired]
    if rests.any():
        ends[..., rests[..., desired]] = 0.0
    return replace(screw(segments), bends=ends.reshape(7, 2, -1))


def similarity_slerp(segments: Segments) -> Curves:
    """Return the geodesic of similarities: constant rates of turning, advance and growth. A screw if nothing grows."""
    if segments.scales is None:
        return screw(segments)

    def basis(s: np.ndarray, parameters: list[np.ndarray], narrow: bool) -> Rows:
        quarter_angle, half_growth, mean, least, most = parameters
        rows = np.empty((6, s.size))
        _slerp(s, quarter_angle, narrow, rows[:2])
        rows[2] = 1.0
        growth = np.clip(s * half_growth, least, most)
        np.expm1(growth, out=rows[3])
        grown = np.exp(growth, out=growth)
        np.multiply(rows[1], rows[:2], out=rows[4:])
        rows[4:] *= grown
        return rows, mean * grown

    # The fraction done of the way along the axis, with z the growth of log scale, and across it, with z + 4 i h, is
    #     (exp(z u) - exp(z / 2)) / (exp(z) - 1) = (exp(z s / 2) - 1) / (2 sinh(z / 2)) - tanh(z / 4) / 2.
    # Across, exp(z s / 2) - 1 = e + 2 (1 + e) (i sin(psi) cos(psi) - sin(psi)^2), where e is this for the growth alone.
    # See `algebras.cga`.
    h, half_growth = segments.quarter_angle, 0.5 * np.log(segments.scales[1] / segments.scales[0])
    half_growth = np.where(half_growth == 0.0, SMALLEST_ANGLE, half_growth)
    along, across, around = segments.decompose()
    (rate, middle), (turned_rate, turned_middle) = _growth_factors(half_growth), _growth_factors(half_growth + 2.0j * h)
    outward = turned_rate.real * across + turned_rate.imag * around
    sideward = turned_rate.real * around - turned_rate.imag * across
    mean = np.sqrt(segments.scales[0]) * np.sqrt(segments.scales[1])
    centre = segments.centre - middle.real * along - turned_middle.real * across - turned_middle.imag * around
    return Curves(
        quaternions=np.stack((segments.middle, segments.difference), axis=1),
        positions=np.stack((centre, rate.real * along + outward, 2.0 * sideward, -2.0 * outward), axis=1),
        parameters=np.stack((h, half_growth, mean, -MAX_LOG_SCALE - np.log(mean), MAX_LOG_SCALE - np.log(mean))),
        basis=basis,
    )


def similarity_lerp(segments: Segments) -> Curves:
    """Return the projected blend of two versors of CGA, which is the blend of motors if nothing grows.

    With the roots k0 and k1 of the scales, the blend has no scale at |s| = (k0 + k1) / |k0 - k1| if nothing turns, or
    later otherwise, and a negative scale beyond. So the motion stops half-way from the key to there. Where rounding
    could pass that point, it stops at the key.
    """
    if segments.scales is None:
        return motor_lerp(segments)

    def basis(s: np.ndarray, parameters: list[np.ndarray], _narrow: bool) -> Rows:
        cosine, last, *roots = parameters
        s = np.clip(s, -last, last)
        # In a versor of scale k, the translation has the weight 1 / sqrt(k), and the rotor has the mean of that and its
        # inverse. See `algebras.cga.extract`.
        shares = np.stack((1.0 - s, 1.0 + s))
        shrinking, growing = shares / roots, shares * roots
        rotor = 0.5 * (shrinking + growing)

        def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return a[0] * b[0] + a[1] * b[1] + cosine * (a[0] * b[1] + a[1] * b[0])

        weight = dot(shrinking, shrinking)
        rows = np.empty((5, s.size))
        rows[:2] = rotor / np.sqrt(dot(rotor, rotor))
        rows[2] = 1.0
        rows[3] = (shrinking[1] ** 2 - shrinking[0] ** 2) / (2.0 * weight)
        rows[4] = -shrinking[0] * shrinking[1] / weight
        return rows, dot(rotor, growing) / dot(rotor, shrinking)

    h, (first, second) = segments.quarter_angle, np.sqrt(segments.scales)
    beyond = np.minimum(first, second) / np.maximum(np.abs(first - second), SMALLEST_ANGLE)
    last = 1.0 + np.where(beyond > 1e-15, beyond, 0.0)
    _, _, around = segments.decompose()
    ends = segments.middle * np.cos(h), segments.difference * np.sin(h)
    return Curves(
        quaternions=np.stack((ends[0] - ends[1], ends[0] + ends[1]), axis=1),
        positions=np.stack((segments.centre, segments.chord, np.sin(2.0 * h) * around), axis=1),
        parameters=np.stack((np.cos(2.0 * h), last, first, second)),
        basis=basis,
    )


def _curves(segments: Segments, positions: tuple, parameters: tuple, basis: Basis) -> Curves:
    """Return curves that turn about one axis and, if there are scales, grow geometrically."""
    if segments.scales is not None:
        logarithms = np.log(segments.scales)
        parameters = (*parameters, logarithms[1] - logarithms[0], 0.5 * (logarithms[0] + logarithms[1]))
    return Curves(
        quaternions=np.stack((segments.middle, segments.difference), axis=1),
        positions=np.stack(positions, axis=1),
        parameters=np.stack(parameters),
        basis=basis,
    )


def _slerp(s: np.ndarray, quarter_angle: np.ndarray, narrow: bool, turn: np.ndarray) -> None:
    """Fill in cos(psi) and sin(psi) of psi = s h; `narrow` says that psi is at most 60 degrees."""
    fill_sine_and_cosine(s * quarter_angle, turn[1], turn[0], narrow=narrow)


def _lerp(s: np.ndarray, tangent: np.ndarray, turn: np.ndarray) -> None:
    """Fill in cos(psi) and sin(psi) of tan(psi) = s tan(h)."""
    cosine, sine = turn
    np.multiply(s, tangent, out=sine)
    np.multiply(sine, sine, out=cosine)
    cosine += 1.0
    np.sqrt(cosine, out=cosine)
    np.reciprocal(cosine, out=cosine)
    sine *= cosine


def _geometric_scales(s: np.ndarray, parameters: list[np.ndarray]) -> np.ndarray | None:
    """Return scales that grow at a constant rate, from the last parameters of `_curves`; None if there are no
    scales.
    """
    if len(parameters) < 3:
        return None
    growth, middle = parameters[-2:]
    return np.exp(np.clip(middle + 0.5 * s * growth, -MAX_LOG_SCALE, MAX_LOG_SCALE))


def _growth_factors(w: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return 1 / (2 sinh(w)) and tanh(w / 2) / 2."""
    return 0.5 / _sinh(w), 0.5 * _sinh(0.5 * w) / np.cosh(0.5 * w)


def _sinh(z: np.ndarray) -> np.ndarray:
    """Return sinh of complex z, with both parts accurate where they are small."""
    return np.sinh(z.real) * np.cos(z.imag) + 1j * np.cosh(z.real) * np.sin(z.imag)
