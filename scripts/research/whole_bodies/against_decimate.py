"""Keys of whole bodies beside those that Blender's Decimate leaves, where both keep to the same error."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rigid_motion.motion import reduce_skeleton_keys
from rigid_motion_batch.scenes.decimated_bodies import FREE, STRAIGHT, TRIALS, Decimations, Left, left_of_fcurves

from .bodies import RADIUS, Body, Keys
from .rigs import Rig


def of_poses(how: str, body: Body, keys: Keys, mode: str) -> Left:
    channels = (body.moving + body.turning).tolist()
    counted = [(own, count) for own, count in zip(keys, channels, strict=True) if count]
    return Left(
        how,
        len(set().union(*(own.tolist() for own, _ in counted))),
        sum(len(own) for own, _ in counted),
        sum(len(own) * (1 + count) for own, count in counted),
        float(body.errors(body.shown(keys, mode)).max()),
    )


def of_key_poses(how: str, body: Body, keys: np.ndarray, mode: str) -> Left:
    """A key pose has its frame once."""
    channels = body.moving + body.turning
    largest = float(body.errors(body.shown_by_key_poses(keys, mode)).max())
    poses = len(keys) * np.count_nonzero(channels)
    return Left(how, len(keys), poses, len(keys) * (1 + int(channels.sum())), largest)


def of_fcurves(how: str, rig: Rig, body: Body, numbers_of_key: int) -> Left:
    """What the F-curves have now; the body is that of the rig as it was imported, of any size."""
    poses = rig.poses()
    poses.positions[...] *= body.enlarged
    largest = float(body.errors(body.skeleton.in_root_space(poses)).max())
    return left_of_fcurves(how, rig.keys(), largest, numbers_of_key)


def decimated(rig: Rig, body: Body, tolerance: float) -> Left:
    """Of Decimate with one error margin for all F-curves: the fewest keys that keep the body within the tolerance."""

    def seen() -> Left:
        return of_fcurves("Decimate", rig, body, FREE)

    return Decimations(rig.obj, seen, TRIALS).within(tolerance) or seen()


def measure(rig: Rig, body: Body, mode: str, tolerance: float) -> list[Left]:
    """Keys of each joint's own, key poses, Decimate, and what was there before."""
    options = {"tolerance": tolerance, "radius": RADIUS}
    own = reduce_skeleton_keys(body.times, body.poses, body.parents, mode, **options)
    shared = reduce_skeleton_keys(body.times, body.poses, body.parents, mode, shared=True, **options)[0]
    return [
        of_poses("each joint its own", body, own, mode),
        of_key_poses("key poses", body, shared, mode),
        decimated(rig, body, tolerance),
        of_fcurves("as imported", rig, body, STRAIGHT),
    ]


def report(name: str, frames: int, found: list[Left]) -> Iterator[str]:
    """The rows of a body."""
    first = f"{name}, {frames} frames"
    for left in found:
        yield f"| {first} | {left.how} | {left.frames} | {left.keys} | {left.numbers} | {1e3 * left.largest:.2f} |"
        first = ""


HEADER = (
    "| body | | frames with keys | keys | numbers | largest error, mm |",
    "|---|---|---:|---:|---:|---:|",
)


def summary(outcomes: list[list[Left]]) -> Iterator[str]:
    """What Decimate has, in multiples of ours: geometric means over the bodies."""
    yield "| Decimate, in multiples of | frames with keys | numbers |"
    yield "|---|---:|---:|"
    for row in (0, 1):
        ratios = [[there[2].frames / there[row].frames, there[2].numbers / there[row].numbers] for there in outcomes]
        frames, numbers = np.exp(np.log(ratios).mean(axis=0))
        yield f"| {outcomes[0][row].how} | {frames:.2f} | {numbers:.2f} |"
