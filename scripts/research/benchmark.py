"""Benchmark of interpolation: poses per second of every mode, compared with libraries that offer the same motion.

    python scripts/research benchmark
    python scripts/research benchmark --rounds 30

All implementations take turns, round by round, in one run on this machine, and the fastest round counts. Requires the
packages of the extra `benchmark`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pytransform3d
import scipy
from pytransform3d.trajectories import dual_quaternions_from_pqs, dual_quaternions_sclerp, pqs_from_dual_quaternions
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RigidTransform, Rotation, RotationSpline, Slerp

from research.in_betweens import Case
from research.studies import interleaved_seconds, publish, report, study_parser
from rigid_motion.motion import MODES, Poses
from rigid_motion.motion.poses import reshaped
from rigid_motion.motion.quaternions import align_signs, normalise
from rigid_motion.motion.trigonometry import VECTOR_TANGENT

PROGRAM = "Rigid Motion"

MIN_MEASURED_S = 2.0  # seconds after which one implementation has been measured well enough on a case

Way = tuple[str, str]
"""A mode, and the program or library that computes it."""


def cases(count: int) -> Iterator[Case]:
    """Yield cases with the array shapes of typical work, each with about `count` in-betweens."""
    random = np.random.default_rng(7)

    def case(title: str, objects: int, keys: int, times: np.ndarray) -> Case:
        quaternions = normalise(random.normal(size=(objects, keys, 4)))
        poses = Poses(random.normal(size=(objects, keys, 3)), align_signs(quaternions))
        return Case(title, np.arange(float(keys)), poses, times)

    uneven = partial(random.uniform, 0, count // 9, count)
    yield case("A path, 1000 in-betweens to a segment", 1, count // 1000 + 1, np.arange(count) / 1000.0)
    yield case("A recording, 9 samples to a segment, uneven", 1, count // 9 + 1, np.sort(uneven()))
    yield case(f"{count // 50} objects, 10 segments, 24 frames each", count // 50, 11, np.arange(240) / 24.0)
    yield case("Independent pairs", count, 2, random.uniform(size=(count, 1)))


# -- ways to compute ---------------------------------------------------------------------------------------------------


def pytransform3d_sclerp(case: Case) -> np.ndarray:
    """Evaluate `dual_quaternions_sclerp`, the batch form of pytransform3d."""
    first, u = case.pairs()
    keys = np.concatenate((case.keys.positions, case.keys.quaternions), axis=-1).reshape(-1, 7)
    keys = dual_quaternions_from_pqs(keys)
    return pqs_from_dual_quaternions(dual_quaternions_sclerp(keys[first], keys[first + 1], u))


def scipy_screw(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate `RigidTransform`: a logarithm per segment, an exponential per in-between."""
    (first, u), keys = case.pairs(), reshaped(case.keys, -1)
    turns = Rotation.from_quat(keys.quaternions, scalar_first=True)
    keys = RigidTransform.from_components(keys.positions, turns)
    screws = (keys[:-1].inv() * keys[1:]).as_exp_coords()
    between = keys[first] * RigidTransform.from_exp_coords(u[:, None] * screws[first])
    return between.translation, between.rotation.as_quat(scalar_first=True)


def scipy_slerp(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate `Slerp`, and `numpy.interp` per coordinate."""
    turns = Slerp(case.key_times, Rotation.from_quat(case.keys.quaternions[0], scalar_first=True))
    straight = [np.interp(case.times, case.key_times, column) for column in case.keys.positions[0].T]
    return np.stack(straight, axis=-1), turns(case.times).as_quat(scalar_first=True)


def scipy_spline(case: Case) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate `RotationSpline` and `CubicSpline`: a C2 spline for the rotation, and another for the position."""
    turns = RotationSpline(case.key_times, Rotation.from_quat(case.keys.quaternions[0], scalar_first=True))
    path = CubicSpline(case.key_times, case.keys.positions[0])
    return path(case.times), turns(case.times).as_quat(scalar_first=True)


def ways(case: Case) -> dict[Way, Callable[[], object]]:
    """Return all implementations that can compute a case."""
    result: dict[Way, Callable[[], object]] = {}
    for mode in MODES:
        result[mode, PROGRAM] = partial(case.filled_in, mode)
        if not MODES[mode].is_smooth:
            result[mode, "NumPy, in the algebra"] = partial(case.in_the_algebra, mode)
    result["dq_sclerp", "pytransform3d"] = partial(pytransform3d_sclerp, case)
    result["dq_sclerp", "SciPy"] = partial(scipy_screw, case)
    if case.times.ndim == 1 and case.keys.shape[0] == 1:
        result["lerp_slerp", "SciPy"] = partial(scipy_slerp, case)
        result["motor_spline", "SciPy, RotationSpline and CubicSpline"] = partial(scipy_spline, case)
    return result


def rates(case: Case, seconds: dict[Way, list[float]]) -> list[dict[str, Any]]:
    """Return millions of poses per second, and the ratio of this program's speed to each library's."""
    fastest = {way: min(times) for way, times in seconds.items()}
    return [
        {
            "mode": mode,
            "by": peer,
            "millions": case.in_betweens / best / 1e6,
            "faster_by": None if peer == PROGRAM else best / fastest[mode, PROGRAM],
        }
        for (mode, peer), best in fastest.items()
    ]


def main(arguments: list[str] | None = None) -> int:
    """Run all cases, and write the figures."""
    parser = study_parser("benchmark", __doc__)
    parser.add_argument("--count", type=int, default=100_000, help="in-betweens in a case (%(default)s)")
    parser.add_argument("--rounds", type=int, default=50, help="rounds of all against all (%(default)s)")
    options = parser.parse_args(arguments)
    figures: dict[str, Any] = {"vector_tangent": bool(VECTOR_TANGENT), "cases": []}
    for case in cases(options.count):
        report(case.title)
        about = {"title": case.title, "in_betweens": case.in_betweens, "key_count": int(np.prod(case.keys.shape))}
        seconds = interleaved_seconds(ways(case), options.rounds, warm=True, most=MIN_MEASURED_S)
        figures["cases"].append({**about, "rates": rates(case, seconds)})
    versions = {"SciPy": scipy.__version__, "pytransform3d": pytransform3d.__version__}
    return publish("benchmark", figures, options, "--rounds", options.rounds, **versions)
