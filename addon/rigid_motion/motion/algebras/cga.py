"""Poses as versors of 3D conformal geometric algebra (CGA), with their LERP and SLERP.

The basis vectors e1, e2, e3, e4 square to 1 and e5 to -1; e_inf = e4 + e5. A pose is the versor M = T R S with T = 1 -
t e_inf / 2, R as in `pga`, and the dilator S = exp(-log(s) / 2 e45) for a uniform scale s, the innermost factor. The
paper also lists e1, e2 and e3 among the terms of the rotor; a motor has none of them.
"""

from __future__ import annotations

import numpy as np

from ..poses import Poses
from .functions import growth, sinc
from .multivectors import Algebra

CGA = Algebra({"1": 1, "2": 1, "3": 1, "4": 1, "5": -1})

_ROTOR = CGA.indices("1", "e12", "e13", "e23")
_DILATED_ROTOR = CGA.indices("e45", "e1245", "e1345", "e2345")
_T4 = CGA.indices("e14", "e24", "e34")
_T5 = CGA.indices("e15", "e25", "e35")


def cga_lerp(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return (1 - u) M0 + u M1, projected to a versor by `extract`.

    The scale is (1 + k) / (1 - k) with k = tanh(log(s) / 2) of the blend: 1.43 a quarter of the way from 1 to 4, where
    growth at a constant rate (`cga_slerp`) gives 1.41.
    """
    u = np.asarray(u)[..., None]
    return extract((1.0 - u) * encode(first) + u * encode(second), scaled=first.scales is not None)


def cga_slerp(first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return M0 exp(u log(M0^-1 M1)): the geodesic of similarities, which turns, advances and grows at constant rates.

    The result does not depend on the origin of the world, so the first position is taken as the origin: far from the
    origin, squares of e4 and e5 that cancel in M0^-1 M1 would cost half of the digits.
    """
    u, origin = np.asarray(u), first.positions
    start = encode(Poses(np.zeros_like(origin), first.quaternions, first.scales))
    end = encode(Poses(second.positions - origin, second.quaternions, second.scales))
    bivector = logarithm(CGA.product(CGA.reverse(start), end))
    between = extract(CGA.product(start, exponential(u[..., None] * bivector)), scaled=first.scales is not None)
    return Poses(origin + between.positions, between.quaternions, between.scales)


def encode(poses: Poses) -> np.ndarray:
    """Return the versors T R S, shape (..., 32)."""
    scales = np.ones(poses.shape) if poses.scales is None else poses.scales
    return CGA.product(_translator(poses.positions), _rotor(poses.quaternions), _dilator(np.log(scales)))


def extract(versor: np.ndarray, scaled: bool = True) -> Poses:
    """Return the pose of the versor that a blend of versors is projected to, as R, S and t.

    A blend that turns and grows at once is not a versor: the rotor A on 1, e12, e13, e23 and the rotor B of the block B
    e45 point in different directions. The rotation is that of A, and the scale follows from tanh(log(s) / 2) = -<B A~>
    / |A|^2. The translation is where the blend takes the origin: T = C (A + B)^-1 with C the factor of e_inf, and t = T
    . (e5 - e4); A + B acts on e_inf as R S does. So the path does not depend on the origin of the world. For a motor,
    where B = 0, this is the extraction of the paper.
    """
    a, b = versor[..., _ROTOR], versor[..., _DILATED_ROTOR]
    squared = np.sum(a * a, axis=-1)
    log_scales = -2.0 * np.arctanh(np.sum(a * b, axis=-1) / squared)
    w, e12, e13, e23 = np.moveaxis(a / np.sqrt(squared)[..., None], -1, 0)
    quaternions = np.stack((w, -e23, e13, -e12), axis=-1)
    seen = np.zeros_like(versor)
    seen[..., _ROTOR] = a + b
    at_infinity = versor.copy()
    at_infinity[..., _ROTOR + _DILATED_ROTOR] = 0.0
    translator = CGA.product(at_infinity, CGA.reverse(seen)) / np.sum(seen * seen, axis=-1, keepdims=True)
    return Poses(-(translator[..., _T4] + translator[..., _T5]), quaternions, np.exp(log_scales) if scaled else None)


def logarithm(versor: np.ndarray) -> np.ndarray:
    """Return the bivector whose exponential is the versor of a similarity that turns by at most 180 degrees."""
    poses = extract(versor)
    w, vector = poses.quaternions[..., :1], poses.quaternions[..., 1:]
    half_angle = np.arctan2(np.linalg.norm(vector, axis=-1, keepdims=True), w)
    turn = 2.0 * vector / sinc(half_angle)
    log_scales = np.log(poses.scales)
    t1, t2, t3 = -0.5 * np.moveaxis(_swept(poses.positions, turn, log_scales, undo=True), -1, 0)
    x, y, z = 0.5 * np.moveaxis(turn, -1, 0)
    return CGA.multivector(e14=t1, e24=t2, e34=t3, e15=t1, e25=t2, e35=t3, e12=-z, e13=y, e23=-x, e45=-log_scales / 2.0)


def exponential(bivector: np.ndarray) -> np.ndarray:
    """Return the versor of a bivector: advance, turn and growth together, for one unit of time."""
    velocity = -(bivector[..., _T4] + bivector[..., _T5])
    turn = bivector[..., CGA.indices("e23", "e13", "e12")] * np.array((-2.0, 2.0, -2.0))
    log_scales = -2.0 * bivector[..., CGA.index("e45")]
    half_turn = turn / 2.0
    h = np.linalg.norm(half_turn, axis=-1, keepdims=True)
    rotor = _rotor(np.concatenate((np.cos(h), sinc(h) * half_turn), axis=-1))
    return CGA.product(_translator(_swept(velocity, turn, log_scales)), rotor, _dilator(log_scales))


def _swept(vector: np.ndarray, turn: np.ndarray, log_scales: np.ndarray, undo: bool = False) -> np.ndarray:
    """Return the displacement of a point whose velocity starts as `vector` and turns and grows with the motion.

    With `undo`, return the starting velocity for a displacement. Along the axis the factor is (exp(l) - 1) / l. Across
    the axis the point follows a logarithmic spiral, with the complex number l + i angle in the place of l.
    """
    angle = np.linalg.norm(turn, axis=-1, keepdims=True)
    axis = turn / np.where(angle == 0.0, 1.0, angle)
    rate = log_scales[..., None]
    along, across = growth(rate + 0j).real, growth(rate + 1j * angle)
    if undo:
        along, across = 1.0 / along, 1.0 / across
    parallel = axis * np.sum(axis * vector, axis=-1, keepdims=True)
    return along * parallel + across.real * (vector - parallel) + across.imag * np.cross(axis, vector)


def _translator(positions: np.ndarray) -> np.ndarray:
    t1, t2, t3 = -0.5 * np.moveaxis(positions, -1, 0)
    return CGA.multivector(one=1.0, e14=t1, e24=t2, e34=t3, e15=t1, e25=t2, e35=t3)


def _rotor(quaternions: np.ndarray) -> np.ndarray:
    w, x, y, z = np.moveaxis(quaternions, -1, 0)
    return CGA.multivector(one=w, e12=-z, e13=y, e23=-x)


def _dilator(log_scales: np.ndarray) -> np.ndarray:
    return CGA.multivector(one=np.cosh(log_scales / 2.0), e45=-np.sinh(log_scales / 2.0))
