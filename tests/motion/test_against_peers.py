"""Tests of every mode against independent libraries: pytransform3d, kingdon, SciPy.

Positions agree to 1e-12 of their own size, both for turns of 1e-9 rad and for turns of 180 degrees less 1e-9. In terms
of unit quaternions both are well-conditioned; only the choice between two shortest ways at exactly 180 degrees is not.
"""

import kingdon
import numpy as np
import pytest
from pytransform3d.trajectories import dual_quaternions_from_pqs, dual_quaternions_sclerp, pqs_from_dual_quaternions
from scipy.spatial.transform import Rotation, Slerp

from rigid_motion.motion import MODES, Poses, interpolate
from rigid_motion.motion.poses import joined
from tests.motion.cases import PAIRS, assert_same, corners, shares, size_of

CORNERS = list(corners())
SCREWS = ["dq_sclerp", "pga_slerp", "cga_slerp"]
BLENDS = ["pga_lerp", "cga_lerp"]


def between(mode: str, first: Poses, second: Poses, u: np.ndarray) -> Poses:
    """Return the in-betweens of the pairs, by the fast form that users run or the reference in the mode's algebra."""
    keys = joined((first[:, None], second[:, None]), axis=1)
    return interpolate([0.0, 1.0], keys, u[:, None], mode)[:, 0]


in_each_corner = pytest.mark.parametrize("corner", CORNERS)


@in_each_corner
@pytest.mark.parametrize("mode", SCREWS)
def test_screws_are_pytransform3ds_sclerp(mode, corner):
    first, second = corners()[corner]
    keys = [dual_quaternions_from_pqs(np.concatenate((p.positions, p.quaternions), axis=-1)) for p in (first, second)]
    pqs = pqs_from_dual_quaternions(dual_quaternions_sclerp(*keys, shares()))
    assert_same(between(mode, first, second, shares()), Poses(pqs[:, :3], pqs[:, 3:]))


PGA = kingdon.Algebra(3, 0, 1)
CGA = kingdon.Algebra(4, 1)


def pga_motor(poses: Poses):
    t1, t2, t3 = poses.positions.T
    w, x, y, z = poses.quaternions.T
    one = np.ones(len(poses))
    return PGA.multivector(e=one, e01=-t1 / 2, e02=-t2 / 2, e03=-t3 / 2) * PGA.multivector(e=w, e12=-z, e13=y, e23=-x)


def cga_versor(poses: Poses):
    t1, t2, t3 = -0.5 * poses.positions.T
    w, x, y, z = poses.quaternions.T
    one, half = np.ones(len(poses)), 0.5 * np.log(np.ones(len(poses)) if poses.scales is None else poses.scales)
    translator = CGA.multivector(e=one, e14=t1, e24=t2, e34=t3, e15=t1, e25=t2, e35=t3)
    rotor = CGA.multivector(e=w, e12=-z, e13=y, e23=-x)
    return translator * rotor * CGA.multivector(e=np.cosh(half), e45=-np.sinh(half))


def in_units_of(unit: float, poses: Poses) -> Poses:
    return Poses(poses.positions / unit, poses.quaternions, poses.scales)


def coefficients(multivector, *blades: str) -> np.ndarray:
    return np.stack([np.broadcast_to(np.asarray(getattr(multivector, b), dtype=float), (PAIRS,)) for b in blades], -1)


def carried_by(versor, points: np.ndarray) -> np.ndarray:
    """Return the points moved by a CGA versor: its sandwich product with their conformal images."""
    x, y, z = points.T
    square = 0.5 * (x * x + y * y + z * z)
    # X = x + x^2 / 2 e_inf + e_o with e_inf = e4 + e5 and e_o = (e5 - e4) / 2
    image = CGA.multivector(e1=x, e2=y, e3=z, e4=square - 0.5, e5=square + 0.5)
    moved = versor * image * versor.reverse()
    weight = coefficients(moved, "e5") - coefficients(moved, "e4")
    return coefficients(moved, "e1", "e2", "e3") / weight


@in_each_corner
@pytest.mark.parametrize("mode", BLENDS)
def test_blends_are_plain_multivector_lerps(mode, corner):
    first, second = corners()[corner]
    u = shares()
    motor = pga_motor(first) * (1 - u) + pga_motor(second) * u
    w, e12, e13, e23 = coefficients(motor, "e", "e12", "e13", "e23").T
    squared = w * w + e12 * e12 + e13 * e13 + e23 * e23
    translator = motor * PGA.multivector(e=w, e12=e12, e13=e13, e23=e23).reverse() * (1 / squared)
    quaternions = np.stack((w, -e23, e13, -e12), axis=-1) / np.sqrt(squared)[:, None]
    expected = Poses(-2.0 * coefficients(translator, "e01", "e02", "e03"), quaternions)
    assert_same(between(mode, first, second, u), expected)


@in_each_corner
def test_blends_with_scale_take_the_origin_where_the_plain_lerp_takes_it(corner):
    first, second = corners(scaled=True)[corner]
    u = shares()
    versor = cga_versor(first) * (1 - u) + cga_versor(second) * u
    poses = between("cga_lerp", first, second, u)
    rotor = coefficients(versor, "e", "e12", "e13", "e23")
    dilated = coefficients(versor, "e45", "e1245", "e1345", "e2345")
    w, e12, e13, e23 = (rotor / np.linalg.norm(rotor, axis=-1, keepdims=True)).T
    k = -np.sum(rotor * dilated, axis=-1) / np.sum(rotor * rotor, axis=-1)
    # The image of a point holds its squared distance: in units of the point's size, no digits are lost.
    unit = size_of(first, second)
    near = [cga_versor(in_units_of(unit, p)) for p in (first, second)]
    origin = unit * carried_by(near[0] * (1 - u) + near[1] * u, np.zeros((PAIRS, 3)))
    assert_same(poses, Poses(origin, np.stack((w, -e23, e13, -e12), axis=-1), (1 + k) / (1 - k)), tolerance=1e-11)


@pytest.mark.parametrize("parts", [2, 3])
@in_each_corner
def test_similarities_go_the_same_step_again_and_again(corner, parts):
    first, second = corners(scaled=True)[corner]
    third = between("cga_slerp", first, second, np.full(PAIRS, 1.0 / parts))
    start, part, end = (cga_versor(in_units_of(size_of(first, second), p)) for p in (first, third, second))
    step = start.reverse() * part
    arrived = start
    for _ in range(parts):
        arrived = arrived * step
    blades = ["e", "e12", "e13", "e23", "e45", "e1245", "e1345", "e2345", "e14", "e24", "e34", "e1234"]
    expected = coefficients(end, *blades)
    assert np.abs(coefficients(arrived, *blades) - expected).max() < 1e-12 * np.abs(expected).max()


@in_each_corner
def test_rotation_of_lerp_slerp_is_scipys_slerp(corner):
    first, second = corners()[corner]
    poses = between("lerp_slerp", first, second, shares())
    for row in range(0, PAIRS, 20):
        ends = Rotation.from_quat(np.stack((first.quaternions[row], second.quaternions[row])), scalar_first=True)
        expected = Slerp([0, 1], ends)(shares()[row])
        # SciPy uses a rotation vector: near 180 degrees it is exact to about 1e-8.
        near_half_turn = corner == "near 180 degrees"
        actual = Rotation.from_quat(poses.quaternions[row], scalar_first=True)
        assert (expected.inv() * actual).magnitude() < (1e-7 if near_half_turn else 1e-12)


@pytest.mark.parametrize("scaled", [False, True], ids=["rigid", "scaled"])
@in_each_corner
@pytest.mark.parametrize("mode", MODES)
def test_fast_form_is_the_reference(mode, corner, scaled):
    first, second = corners(scaled)[corner]
    assert_same(between(mode, first, second, shares()), MODES[mode].reference(first, second, shares()))
