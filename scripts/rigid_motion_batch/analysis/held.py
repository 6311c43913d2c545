"""Bodies of one recording that hold one another rigidly, as a hand does a tool, and how far modes let them slip.

Where a body is held is its mean pose in the recording, seen from the one that holds it. A slip is the largest distance
of any point of the ball around the held body's origin from there: a shell error. Lengths are in metres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses, interpolate, rms, shell_error
from rigid_motion.motion.quaternions import conjugate, multiply, rotate
from rigid_motion_batch.recordings.clips import Clip

from .choices import Choice
from .reconstructions import Reconstruction

MAX_HELD_SLIP_M = 0.005
"""The farthest that a body which is held slips in a recording."""

MIN_MOVE_PER_SLIP = 10.0
"""How many times as far both bodies move: what lies on one table does not hold one another."""

GLANCED_SAMPLES = 64
"""Samples that tell of most pairs that they are none."""

BETWEEN_MODE = "dq_sclerp"
"""How a recording goes on between its samples, where two bodies were not recorded at the same times."""


@dataclass(frozen=True)
class Slip:
    """A pair of clips with one choice of keys under one mode: the columns of `slip.csv`, in their order."""

    clip_a: str
    """The one that holds."""

    clip_b: str
    """The one that is held."""

    mode: str

    rate_hz: str
    """As the user wrote it; empty where a tolerance decides."""

    rms_slip_m: float
    max_slip_m: float

    recorded_slip_m: float
    """The largest slip of the recording itself."""

    decimation: str
    tolerance_m: float | None


@dataclass(frozen=True)
class ChoiceSlips:
    """A pair under one choice of keys: a row for each mode."""

    choice: Choice
    rows: tuple[Slip, ...]


@dataclass(frozen=True)
class PairSlips:
    """What was found of a pair of clips."""

    holder: str
    held: str
    choices: tuple[ChoiceSlips, ...]
    """Those with keys of both clips at a time that they share."""


def common_times(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the times of both clips, (n,) and (m,), between the later beginning and the earlier end."""
    times = np.union1d(first, second)
    return times[(times >= max(first[0], second[0])) & (times <= min(first[-1], second[-1]))]


def find_held(clips: Sequence[Clip], radius: float) -> list[tuple[int, int]]:
    """Return pairs of rigid bodies, by their places: each held one after the first before it that holds it."""
    pairs = []
    for held in range(1, len(clips)):
        holder = next((place for place in range(held) if is_held(clips[place], clips[held], radius)), None)
        if holder is not None:
            pairs.append((holder, held))
    return pairs


def is_held(holder: Clip, held: Clip, radius: float) -> bool:
    """Return whether a clip stays within `MAX_HELD_SLIP_M` of its place in another, at all times of both, while both
    move.
    """
    own = holder.times[(holder.times >= held.times[0]) & (holder.times <= held.times[-1])]
    if len(own) < 2:
        return False
    some = own[np.unique(np.linspace(0, len(own) - 1, GLANCED_SAMPLES).astype(int))]
    place = seen_from(recorded(holder, some), recorded(held, some))
    # Two places that are as near to their mean are not farther apart than twice that.
    if shell_error(place, place[np.zeros(len(some), dtype=int)], radius).max() > 2.0 * MAX_HELD_SLIP_M:
        return False
    times = common_times(holder.times, held.times)
    poses = [recorded(clip, times) for clip in (holder, held)]
    if distances(seen_from(*poses), radius).max() > MAX_HELD_SLIP_M:
        return False
    return all(distances(one, radius).max() > MIN_MOVE_PER_SLIP * MAX_HELD_SLIP_M for one in poses)


def slips(holder: Reconstruction, held: Reconstruction) -> tuple[Slip, ...]:
    """Measure how far each mode lets a body slip in the one that holds it, both with the same choice of keys.

    None where the times from the first key to the last have nothing in common.
    """
    times = common_times(holder.times, held.times)
    if len(times) < 2:
        return ()
    radius, choice = float(held.radii[0]), held.choice
    place = seen_from(recorded(holder.clip, times), recorded(held.clip, times))
    mean, rows = mean_pose(place), []
    in_recording = float(distances(place, radius).max())
    for mode in (mode for mode in holder.keys if mode in held.keys):
        shown = [made.clip.in_blender(made.filled_in(mode, times)) for made in (holder, held)]
        off = shell_error(seen_from(*shown), mean[np.zeros(len(times), dtype=int)], radius)
        rows.append(
            Slip(
                holder.clip.name,
                held.clip.name,
                mode,
                choice.rate,
                rms(off),
                float(off.max()),
                in_recording,
                choice.decimation,
                choice.tolerance(held.clip),
            )
        )
    return tuple(rows)


def recorded(clip: Clip, times: np.ndarray) -> Poses:
    """Return the poses of a clip at times (m,) of it, in Blender's axes."""
    after = np.clip(np.searchsorted(clip.times, times), 1, len(clip.times) - 1)
    samples = np.union1d(after - 1, after)
    return clip.in_blender(interpolate(clip.times[samples], clip.poses[samples], times, BETWEEN_MODE))


def seen_from(holder: Poses, held: Poses) -> Poses:
    """Return poses (n,) along the axes of others (n,)."""
    back = conjugate(holder.quaternions)
    return Poses(rotate(back, held.positions - holder.positions), multiply(back, held.quaternions))


def mean_pose(poses: Poses) -> Poses:
    """Return the mean of poses (n,), shape (1,): the rotation has the least squared distance from all of them."""
    quaternions = poses.quaternions
    return Poses(poses.positions.mean(axis=0)[None], np.linalg.eigh(quaternions.T @ quaternions)[1][:, -1][None])


def distances(poses: Poses, radius: float) -> np.ndarray:
    """Return how far any point of the ball around a body is from its mean place, at each of its poses (n,)."""
    return shell_error(poses, mean_pose(poses)[np.zeros(len(poses), dtype=int)], radius)
