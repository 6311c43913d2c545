"""Poses a second of every mode, beside the libraries that offer the same motion, in one run on this machine.

    python scripts/research benchmark
    python scripts/research benchmark --rounds 30

All ways of computing take turns, round by round, and the fastest round counts. It needs the packages of the extra
`benchmark`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytransform3d
import scipy
from pytransform3d.trajectories import (
    dual_quaternions_from_pqs,
    dual_quaternions_sclerp,
    pqs_from_dual_quaternions,
)
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import RigidTransform, Rotation, RotationSpline, Slerp

from research.publishing import publish, say, study_parser
from rigid_motion.motion import MODES, Poses, interpolate, reduce_keys, shell_error, twists
from rigid_motion.motion.quaternions import align_signs, multiply
from rigid_motion.motion.trigonometry import VECTOR_TANGENT

OURS = "Rigid Motion"

ENOUGH = 4.0
"""Seconds after which one way of computing a case has been measured well enough."""


@dataclass(frozen=True, eq=False)
class Case:
    """Objects (b) with keys (n), looked at m times each; and the same as a list of pairs, as the peers want it."""

    title: str
    key_times: np.ndarray
    keys: Poses
    times: np.ndarray

    @property
    def in_betweens(self) -> int:
        return self.keys.shape[0] * self.times.shape[-1]

    def pairs(self) -> tuple[np.ndarray, np.ndarray]:
        """The first key of each in-between among all keys of all objects, and the share u of the way to the next."""
        objects, n = self.keys.shape
        times = np.broadcast_to(self.times, (objects, self.times.shape[-1]))
        segment = np.clip(np.searchsorted(self.key_times, times, side="right") - 1, 0, n - 2)
        u = (times - self.key_times[segment]) / (self.key_times[segment + 1] - self.key_times[segment])
        return (segment + n * np.arange(objects)[:, None]).ravel(), u.ravel()


def cases(count: int) -> Iterator[Case]:
    """The shapes of work that users bring: `count` in-betweens or a few more in each."""
    random = np.random.default_rng(7)

    def case(title: str, objects: int, keys: int, times: np.ndarray) -> Case:
        quaternions = random.normal(size=(objects, keys, 4))
        quaternions /= np.linalg.norm(quaternions, axis=-1, keepdims=True)
        poses = Poses(random.normal(size=(objects, keys, 3)), align_signs(quaternions))
        return Case(title, np.arange(float(keys)), poses, times)

    yield case("A path, 1000 in-betweens to a segment", 1, count // 1000 + 1, np.arange(count) / 1000.0)
    yield case(
        "A recording, 9 samples to a segment, uneven", 1, count // 9 + 1, np.sort(random.uniform(0, count // 9, count))
    )
    objects = count // 50
    yield case(f"{objects} objects, 10 segments, 24 frames each", objects, 11, np.arange(240) / 24.0)
    yield case("Independent pairs", count, 2, random.uniform(size=(count, 1)))


def numpy_closed_form(case: Case, mode: str) -> Callable[[], object]:
    """What one would write first: gather both keys of every in-between and evaluate the closed form on all of them."""

    def run() -> Poses:
        first, u = case.pairs()
        p0, q0 = case.keys.positions.reshape(-1, 3)[first], case.keys.quaternions.reshape(-1, 4)[first]
        p1, q1 = case.keys.positions.reshape(-1, 3)[first + 1], case.keys.quaternions.reshape(-1, 4)[first + 1]
        u = u[:, None]
        cosine = np.sum(q0 * q1, axis=1, keepdims=True)
        chord = p1 - p0
        if mode == "pga_lerp":
            squared = (1 - u) ** 2 + u**2 + 2 * u * (1 - u) * cosine
            v = multiply(q1, q0 * (1, -1, -1, -1))[:, 1:]
            across = u * (1 - u) / squared * np.cross(v, chord)
            return Poses(
                p0 + (u**2 + u * (1 - u) * cosine) / squared * chord - across,
                ((1 - u) * q0 + u * q1) / np.sqrt(squared),
            )
        angle = np.arccos(np.minimum(cosine, 1.0))
        sine = np.maximum(np.sin(angle), 1e-12)
        w0, w1 = np.sin((1 - u) * angle) / sine, np.sin(u * angle) / sine
        quaternions = w0 * q0 + w1 * q1
        if mode == "lerp_slerp":
            return Poses(p0 + u * chord, quaternions)
        v = multiply(q1, q0 * (1, -1, -1, -1))[:, 1:]
        across = chord - v * np.sum(v * chord, axis=1, keepdims=True) / sine**2
        swing = (w1 * np.cos((1 - u) * angle) - u) * across
        return Poses(p0 + u * chord + swing - w0 * w1 * np.cross(v, chord), quaternions)

    return run


def numpy_algebra(case: Case, mode: str) -> Callable[[], object]:
    """This program's own reference of the mode, in the algebra it is named after."""

    def run() -> Poses:
        first, u = case.pairs()
        keys = Poses(case.keys.positions.reshape(-1, 3), case.keys.quaternions.reshape(-1, 4))
        return MODES[mode].reference(keys[first], keys[first + 1], u)

    return run


def pytransform3d_sclerp(case: Case) -> Callable[[], object]:
    """`dual_quaternions_sclerp` of `pytransform3d.trajectories`, its batch form."""

    def run() -> np.ndarray:
        first, u = case.pairs()
        pqs = np.concatenate((case.keys.positions, case.keys.quaternions), axis=-1).reshape(-1, 7)
        keys = dual_quaternions_from_pqs(pqs)
        return pqs_from_dual_quaternions(dual_quaternions_sclerp(keys[first], keys[first + 1], u))

    return run


def scipy_screw(case: Case) -> Callable[[], object]:
    """`RigidTransform`: a logarithm for each segment, an exponential for each in-between."""

    def run() -> tuple[np.ndarray, np.ndarray]:
        first, u = case.pairs()
        keys = RigidTransform.from_components(
            case.keys.positions.reshape(-1, 3),
            Rotation.from_quat(case.keys.quaternions.reshape(-1, 4), scalar_first=True),
        )
        screws = (keys[:-1].inv() * keys[1:]).as_exp_coords()
        between = keys[first] * RigidTransform.from_exp_coords(u[:, None] * screws[first])
        return between.translation, between.rotation.as_quat(scalar_first=True)

    return run


def scipy_slerp(case: Case) -> Callable[[], object]:
    """`Slerp`, and NumPy's `interp` for the three coordinates; one object after the other, as SciPy has it."""

    def run() -> list[tuple[np.ndarray, np.ndarray]]:
        result = []
        for positions, quaternions in zip(case.keys.positions, case.keys.quaternions, strict=True):
            turns = Slerp(case.key_times, Rotation.from_quat(quaternions, scalar_first=True))
            straight = np.stack([np.interp(case.times, case.key_times, p) for p in positions.T], axis=-1)
            result.append((straight, turns(case.times).as_quat(scalar_first=True)))
        return result

    return run


def scipy_spline(case: Case) -> Callable[[], object]:
    """`RotationSpline` and `CubicSpline`: a C2 spline for the rotation, and another for the position."""

    def run() -> tuple[np.ndarray, np.ndarray]:
        turns = RotationSpline(case.key_times, Rotation.from_quat(case.keys.quaternions[0], scalar_first=True))
        path = CubicSpline(case.key_times, case.keys.positions[0])
        return path(case.times), turns(case.times).as_quat(scalar_first=True)

    return run


def ways(case: Case) -> dict[tuple[str, str], Callable[[], object]]:
    """(mode, who computes it) to what computes it."""
    result: dict[tuple[str, str], Callable[[], object]] = {}
    for mode in MODES:
        result[mode, OURS] = lambda mode=mode: interpolate(case.key_times, case.keys, case.times, mode)
        if not MODES[mode].is_smooth:
            result[mode, "NumPy, in the algebra"] = numpy_algebra(case, mode)
    for mode in ("lerp_slerp", "dq_sclerp", "pga_lerp"):
        result[mode, "NumPy, closed form"] = numpy_closed_form(case, mode)
    result["dq_sclerp", "pytransform3d"] = pytransform3d_sclerp(case)
    result["dq_sclerp", "SciPy"] = scipy_screw(case)
    if case.times.ndim == 1 and case.keys.shape[0] == 1:
        result["lerp_slerp", "SciPy"] = scipy_slerp(case)
        result["motor_spline", "SciPy, RotationSpline and CubicSpline"] = scipy_spline(case)
    return result


def race(contestants: dict[tuple[str, str], Callable[[], object]], rounds: int) -> dict[tuple[str, str], list[float]]:
    """Seconds of every round of each, all taking turns. Whoever has used up `ENOUGH` seconds has had its rounds.

    Each runs twice in its turn, and the second run counts: the first one pays for the memory and the caches that the
    one before it has left behind.
    """
    seconds: dict[tuple[str, str], list[float]] = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            if sum(seconds[name]) < ENOUGH / 2:
                run()
                start = time.perf_counter()
                run()
                seconds[name].append(time.perf_counter() - start)
    return seconds


def rates(case: Case, seconds: dict[tuple[str, str], list[float]]) -> list[dict[str, Any]]:
    """Million poses a second, and this program's multiple of each peer."""
    fastest = {name: min(times) for name, times in seconds.items()}
    return [
        {
            "mode": mode,
            "by": who,
            "millions": case.in_betweens / best / 1e6,
            "faster_by": None if who == OURS else best / fastest[mode, OURS],
        }
        for (mode, who), best in fastest.items()
    ]


def recording(count: int) -> tuple[np.ndarray, Poses]:
    """A hand at 90 samples a second that reaches, turns and rests, for as long as is asked for."""
    random = np.random.default_rng(11)
    times = np.arange(count) / 90.0
    rates = random.uniform(0.1, 1.5, size=(6, 8, 1))
    swings = (np.sin(2.0 * np.pi * rates * times + random.uniform(0.0, 6.0, size=(6, 8, 1))) / rates).sum(axis=1)
    lively = np.clip(3.0 * np.sin(2.0 * np.pi * 0.05 * times), 0.0, 1.0)
    way = np.cumsum(lively * np.gradient(swings, axis=1), axis=1)
    turn, _ = twists.exponential(np.concatenate((0.5 * way[:3], np.zeros((3, count)))))
    noise = 2e-4 * random.normal(size=(count, 3))
    return times, Poses(0.05 * way[3:].T + noise, turn.T)


def greedy(times: np.ndarray, poses: Poses, tolerance: float) -> np.ndarray:
    """Keys put in where the error is largest, one in each segment that passes the tolerance, until none does."""
    keys = np.array((0, len(times) - 1))
    while True:
        shown = interpolate(times[keys], poses[keys], times, "motor_spline")
        errors = shell_error(shown, poses)
        worst = np.maximum.reduceat(errors, keys[:-1])
        if worst.max() <= tolerance:
            return keys
        over = np.flatnonzero(worst > tolerance)
        ends = np.append(keys, len(times))
        keys = np.union1d(keys, [keys[i] + int(np.argmax(errors[keys[i] : ends[i + 1]])) for i in over])


def reduction(count: int, tolerance: float = 0.005) -> dict[str, float]:
    """Key reduction of so many samples, beside greedy insertion: the faster of two runs."""
    times, poses = recording(count)
    seconds: dict[str, list[float]] = {"": [], "greedy_": []}
    result: dict[str, float] = {"samples": count}
    for _ in range(2):
        for name, choose in (("", reduce_keys), ("greedy_", greedy)):
            start = time.perf_counter()
            keys = choose(times, poses, tolerance=tolerance)
            seconds[name].append(time.perf_counter() - start)
            result |= {f"{name}seconds": min(seconds[name]), f"{name}key_count": len(keys)}
    return result


def main(arguments: list[str] | None = None) -> int:
    """Run all cases, and write the figures."""
    parser = study_parser("benchmark", __doc__)
    parser.add_argument("--count", type=int, default=100_000, help="in-betweens in a case (%(default)s)")
    parser.add_argument("--rounds", type=int, default=50, help="rounds of all against all (%(default)s)")
    options = parser.parse_args(arguments)
    result = []
    for case in cases(options.count):
        say(case.title)
        about = {"title": case.title, "in_betweens": case.in_betweens, "key_count": int(np.prod(case.keys.shape))}
        result.append({**about, "rates": rates(case, race(ways(case), options.rounds))})
    say("key reduction")
    figures = {
        "vector_tangent": bool(VECTOR_TANGENT),
        "cases": result,
        "reductions": [reduction(count) for count in (900, 1000, options.count // 10, options.count)],
    }
    versions = {"SciPy": scipy.__version__, "pytransform3d": pytransform3d.__version__}
    return publish("benchmark", figures, options, "--rounds", options.rounds, **versions)
