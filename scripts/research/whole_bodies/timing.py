"""How long key reduction takes, beside greedy insertion in the same run."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from rigid_motion.motion import Poses, reduce_keys, reduce_skeleton_keys

from .against_greedy import greedy
from .bodies import RADIUS, Body, repeated
from .goals import verdict

MODE = "motor_spline"

RUNS = 2
"""Of which the faster one counts."""

LONGER = 4
"""Times as many frames, for the cost of a frame in a longer recording."""

GOAL_LONGER = 1.5
"""The most that a frame may cost then, in multiples of what it costs in the short one."""

GOAL_SINGLE = 0.5
"""Seconds for the samples of one recording."""

SAMPLES = 900
"""Of a recording."""

SINGLE_TOLERANCE, SINGLE_RADIUS = 0.005, 0.1


def seconds(run: Callable[[], object]) -> float:
    """Of the faster run."""
    found = []
    for _ in range(RUNS):
        start = time.perf_counter()
        run()
        found.append(time.perf_counter() - start)
    return min(found)


def bodies(timed: list[tuple[Body, float | None]], tolerance: float) -> Iterator[str]:
    """Rows of bodies, each with a goal in seconds, both ways to have keys; and greedy insertion of key poses."""
    yield "| body | keys | seconds | goal | | µs a frame and joint | of greedy insertion's |"
    yield "|---|---|---:|---:|---|---:|---:|"
    for body, goal in timed:
        theirs = seconds(lambda body=body: greedy(body, MODE, tolerance))
        for how, shared in (("each joint its own", False), ("key poses", True)):
            ours = _reduction_seconds(body, tolerance, shared=shared)
            name = f"{body.name}, {len(body.joints)} joints, {body.frames} frames"
            wished = ("", "") if goal is None else (f"{goal:g}", verdict(ours <= goal))
            yield (
                f"| {name} | {how} | {ours:.2f} | {wished[0]} | {wished[1]} "
                f"| {ours / body.poses.positions[..., 0].size * 1e6:.1f} | {ours / theirs:.2f} |"
            )


def longer(cycle: Body, frames: int, tolerance: float) -> Iterator[str]:
    """What a frame costs in a cycle that goes on for so many frames, and for some times as many."""
    yield f"| {cycle.name}, walking on | {frames} frames | {LONGER * frames} | ms a frame | then | ratio | goal |"
    yield "|---|---:|---:|---:|---:|---:|---|"
    for how, shared in (("each joint its own", False), ("key poses", True)):
        took = [_reduction_seconds(repeated(cycle, n), tolerance, shared=shared) for n in (frames, LONGER * frames)]
        costs = [1e3 * took[0] / frames, 1e3 * took[1] / (LONGER * frames)]
        ratio = costs[1] / costs[0]
        yield (
            f"| {how} | {took[0]:.2f} s | {took[1]:.2f} s | {costs[0]:.2f} | {costs[1]:.2f} | {ratio:.2f} "
            f"| {verdict(ratio <= GOAL_LONGER)} |"
        )


def recordings(found: list[tuple[str, float, Poses]]) -> Iterator[str]:
    """Rows of single recordings: their names, frames a second and poses (n,)."""
    yield "| recording | samples | seconds | goal | keys | greedy insertion, s | keys | time in multiples of it |"
    yield "|---|---:|---:|---|---:|---:|---:|---:|"
    for name, rate, poses in found:
        poses = poses[:SAMPLES]
        times = np.arange(len(poses)) / rate
        body = _of_one_joint(name, rate, poses)
        options = {"tolerance": SINGLE_TOLERANCE, "radius": SINGLE_RADIUS}
        ours = seconds(lambda: reduce_keys(times, poses, MODE, **options))  # noqa: B023
        theirs = seconds(lambda: greedy(body, MODE, **options))  # noqa: B023
        keys, their_keys = reduce_keys(times, poses, MODE, **options), greedy(body, MODE, **options)
        yield (
            f"| {name} | {len(poses)} | {ours:.2f} | {verdict(ours <= GOAL_SINGLE)} | {len(keys)} "
            f"| {theirs:.2f} | {len(their_keys)} | {ours / theirs:.2f} |"
        )


def _reduction_seconds(body: Body, tolerance: float, *, shared: bool) -> float:
    return seconds(
        lambda: reduce_skeleton_keys(
            body.times, body.poses, body.parents, MODE, tolerance=tolerance, radius=RADIUS, shared=shared
        )
    )


def _of_one_joint(name: str, rate: float, poses: Poses) -> Body:
    one = Poses(poses.positions[None], poses.quaternions[None])
    return Body(name, rate, (name,), np.array([-1]), one, np.array([3]), np.array([4]))
