"""Held bodies of a recording: which body holds another rigidly, as a hand holds a tool, and how far modes let it slip.

The place of a held body is its mean pose in the recording, seen from its holder. A slip is the largest distance from
that place of any point of the ball around the held body's origin: a shell error. Lengths are in metres.
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
"""The farthest that a held body slips in a recording, in metres."""

MIN_MOVE_PER_SLIP = 10.0
"""How many times farther than the allowed slip both bodies must move: two things lying on one table do not hold each
other."""

GLANCED_SAMPLES = 64
"""Number of samples for a first look, which rules out most pairs."""

BETWEEN_MODE = "dq_sclerp"
"""The mode that interpolates a recording between its samples, if two bodies were recorded at different times."""


@dataclass(frozen=True)
class Slip:
    """A pair of clips with one choice of keys under one mode: the columns of `slip.csv`, in order."""

    clip_a: str
    """The holder."""

    clip_b: str
    """The held body."""

    mode: str

    rate_hz: str
    """As the user wrote it; empty if the choice is a tolerance."""

    rms_slip_m: float
    max_slip_m: float

    recorded_slip_m: float
    """The largest slip of the recording itself."""

    decimation: str
    tolerance_m: float | None


@dataclass(frozen=True)
class ChoiceSlips:
    """A pair of clips under one choice of keys: a row for each mode."""

    choice: Choice
    rows: tuple[Slip, ...]


@dataclass(frozen=True)
class PairSlips:
    """The slips of a pair of clips."""

    holder: str
    held: str
    choices: tuple[ChoiceSlips, ...]
    """The choices under which the keys of both clips overlap in time."""


def common_times(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return all times of both clips, (n,) and (m,), from the later start to the earlier end."""
    times = np.union1d(first, second)
    return times[(times >= max(first[0], second[0])) & (times <= min(first[-1], second[-1]))]


def find_held(clips: Sequence[Clip], radius: float) -> list[tuple[int, int]]:
    """Return index pairs (holder, held) of rigid bodies: each held body with the first earlier body that holds it."""
    pairs = []
    for held in range(1, len(clips)):
        holder = next((place for place in range(held) if is_held(clips[place], clips[held], radius)), None)
        if holder is not None:
            pairs.append((holder, held))
    return pairs


def is_held(holder: Clip, held: Clip, radius: float) -> bool:
    """Return whether a clip stays within `MAX_HELD_SLIP_M` of its place in the holder while both move.

    All times of both clips count.
    """
    own = holder.times[(holder.times >= held.times[0]) & (holder.times <= held.times[-1])]
    if len(own) < 2:
        return False
    some = own[np.unique(np.linspace(0, len(own) - 1, GLANCED_SAMPLES).astype(int))]
    place = seen_from(recorded(holder, some), recorded(held, some))
    # If both places are within a distance of the mean, they are within twice that distance of each other.
    if shell_error(place, place[np.zeros(len(some), dtype=int)], radius).max() > 2.0 * MAX_HELD_SLIP_M:
        return False
    times = common_times(holder.times, held.times)
    poses = [recorded(clip, times) for clip in (holder, held)]
    if distances(seen_from(*poses), radius).max() > MAX_HELD_SLIP_M:
        return False
    return all(distances(one, radius).max() > MIN_MOVE_PER_SLIP * MAX_HELD_SLIP_M for one in poses)


def slips(holder: Reconstruction, held: Reconstruction) -> tuple[Slip, ...]:
    """Measure how far each mode lets a body slip in its holder, both with the same choice of keys.

    Empty if the key ranges of the two clips do not overlap in time.
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
    """Return the poses of a clip at times (m,) within it, in Blender's axes."""
    after = np.clip(np.searchsorted(clip.times, times), 1, len(clip.times) - 1)
    samples = np.union1d(after - 1, after)
    return clip.in_blender(interpolate(clip.times[samples], clip.poses[samples], times, BETWEEN_MODE))


def seen_from(holder: Poses, held: Poses) -> Poses:
    """Return poses (n,) in the spaces of the holder's poses (n,)."""
    back = conjugate(holder.quaternions)
    return Poses(rotate(back, held.positions - holder.positions), multiply(back, held.quaternions))


def mean_pose(poses: Poses) -> Poses:
    """Return the mean of poses (n,), shape (1,). Its rotation has the least squared distance from all rotations."""
    quaternions = poses.quaternions
    return Poses(poses.positions.mean(axis=0)[None], np.linalg.eigh(quaternions.T @ quaternions)[1][:, -1][None])


def distances(poses: Poses, radius: float) -> np.ndarray:
    """Return the largest distance of any point of the ball around a body from its mean place, at each pose (n,)."""
    return shell_error(poses, mean_pose(poses)[np.zeros(len(poses), dtype=int)], radius)
