"""Breaks in the motion of a recording: a T-pose in front of it, gaps without samples, and jumps.

Times are strictly rising and poses are repaired, as `rigid_motion.motion.repair` gives them. What is said in texts
counts from the first sample, as the options `--start` and `--end` do.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rigid_motion.motion import Poses

from .clips import ClipWarning
from .recordings import shown
from .rest_bodies import RestBody, size_of
from .sense import FEWEST, HIGHEST_SPEED

IDENTICAL = 5
"""Samples in front that may hold the same T-pose."""

SAME = 1e-3
"""Part of its size by which a body may move and still hold a pose."""

JUMPS = 0.1
"""Part of its size that a joint moves, at least, from a T-pose to the motion."""

FASTER = 5.0
"""Factor by which that is farther than any joint moves in any sample afterwards."""

STARTLED = 10.0
"""Such a factor where the first pose is neither a T-pose nor that at rest, and more than `HIGHEST_SPEED`."""

SOON = 60
"""Samples that are looked at for that."""

AT_REST = 0.02
"""Part of its size by which any joint may be away from where it is at rest."""

BROAD, FLAT = 0.75, 0.4
"""The least that the arms of a T-pose reach, and the most that it is deep, as parts of its largest extent."""

GAP = 0.2
"""Seconds: the longest time between keys of a comparison at 5 keys a second. In a longer gap there is no key at all."""

ISOLATED = 10.0
"""Factor by which a jump goes farther than the samples around it."""

AROUND = 8
"""Samples before and after a jump that it is compared with."""

MOST_JUMPS = 0.01
"""The share of samples up to which jumps are faults of some, and not the unit of all."""

MOST_NAMED = 5
"""Gaps or jumps that are named, the largest ones."""

BLOCK = 4096
"""Samples of a body that are looked at at once."""

LEAVE_OUT = "take a part without it: --start and --end"


def calibration_pose(
    times: np.ndarray, poses: Poses, rest_body: RestBody, metres: float
) -> tuple[int, ClipWarning | None]:
    """Find a pose in front of a whole body's motion that is no part of it.

    Returns
    -------
    samples : int
        How many samples hold a T-pose or the pose at rest, from which the body jumps into its motion: 0 for none.
    warning : ClipWarning or None
        What to say of these; also of another pose that it jumps from.
    """
    if len(times) < FEWEST:
        return 0, None
    places = rest_body.skeleton.in_root_space(poses[:, : IDENTICAL + SOON]).positions
    size = max(size_of(rest_body.parents, places[:, 0]), size_of(rest_body.parents, rest_body.rest.positions))
    steps = np.linalg.norm(np.diff(places, axis=1), axis=-1)
    held = int(np.argmax(steps.max(axis=0) > SAME * size)) + 1
    joint = int(np.argmax(steps[:, held - 1]))
    jump, others = steps[joint, held - 1], np.max(steps[:, held:], initial=0.0)
    speed = jump * metres / (times[held] - times[held - 1])
    described = (
        f"from there to the next {shown(rest_body.joints[joint])} jumps {jump * metres:.2g} m, and none jumps more "
        f"than {others * metres:.2g} m afterwards"
    )
    where = float(times[0]), float(times[held])
    kind = _kind(places[:, 0], rest_body, size)
    if kind and held <= IDENTICAL and jump > max(JUMPS * size, FASTER * others):
        frames = "its first frame is" if held == 1 else f"its first {held} frames are"
        return held, ClipWarning(f"{frames} {kind} and left out: {described}", "--start 0 keeps it", *where)
    if held == 1 and speed > HIGHEST_SPEED and jump > STARTLED * others:
        text = f"its first sample is a pose of its own, perhaps the T-pose before a recording: {described}; "
        way_out = f"leave it out: --start {times[1] - times[0]:.3g}"
        return 0, ClipWarning(text + "errors around it say nothing of the motion", way_out, *where)
    return 0, None


def _kind(places: np.ndarray, rest_body: RestBody, size: float) -> str:
    """Return what pose these places (joints, 3) are: a T-pose in any axes, or that at rest; empty for any other."""
    smallest, middle, largest = np.sort(np.ptp(places, axis=0))
    if middle > BROAD * largest and smallest < FLAT * largest:
        return "a T-pose"
    away = places - rest_body.rest.positions
    return "the pose at rest" if np.abs(away - away[0]).max() < AT_REST * size else ""


def breaks(
    times: np.ndarray, poses: Poses, rest_body: RestBody | None, metres: float, begin: float
) -> list[ClipWarning]:
    """Find the gaps of a recording that are longer than the time between keys, and its jumps, in their order.

    `metres` is the length of the unit of the poses, `begin` the time of the first sample of the recording.
    """
    steps = np.diff(times)
    result = [*_gaps(times, steps, begin)]
    if len(times) >= FEWEST:
        result += _jumps(times, steps, np.concatenate(list(_lengths(poses, rest_body))) * metres, begin)
    return sorted(result, key=lambda warning: warning.start_s or 0.0)


def _gaps(times: np.ndarray, steps: np.ndarray, begin: float) -> Iterator[ClipWarning]:
    gaps = np.flatnonzero((steps > GAP) & (steps > ISOLATED * np.median(steps)))
    for row in _largest(steps, gaps):
        first, last = times[row : row + 2].tolist()
        text = f"no samples from {first - begin:.2f} s to {last - begin:.2f} s{_of(gaps, 'gaps')}"
        yield ClipWarning(f"{text}: no error is measured there", LEAVE_OUT, first, last)


def _jumps(times: np.ndarray, steps: np.ndarray, lengths: np.ndarray, begin: float) -> Iterator[ClipWarning]:
    fast = np.flatnonzero(lengths > HIGHEST_SPEED * steps)
    if len(fast) > MOST_JUMPS * len(steps):
        return
    around = [lengths[max(0, row - AROUND) : row + AROUND + 1] for row in fast]
    usual = np.array([np.median(lengths) for lengths in around])
    jumps = fast[lengths[fast] > ISOLATED * usual]
    for row in _largest(lengths, jumps):
        first, last = times[row : row + 2].tolist()
        text = f"a jump at {first - begin:.2f} s{_of(jumps, 'jumps')}: {lengths[row]:.2g} m in one sample, at "
        text += f"{lengths[row] / steps[row]:.3g} m/s, where tracking was lost or takes were joined"
        yield ClipWarning(text, LEAVE_OUT, first, last)


def _lengths(poses: Poses, rest_body: RestBody | None) -> Iterator[np.ndarray]:
    """Yield how far a body, or any joint of it, gets from each sample to the next, block by block."""
    count = poses.shape[-1]
    for first in range(0, count - 1, BLOCK):
        part = poses[..., first : first + BLOCK + 1]
        places = part.positions[None] if rest_body is None else rest_body.skeleton.in_root_space(part).positions
        yield np.linalg.norm(np.diff(places, axis=1), axis=-1).max(axis=0)


def _largest(sizes: np.ndarray, rows: np.ndarray) -> list[int]:
    return sorted(rows[np.argsort(-sizes[rows], kind="stable")][:MOST_NAMED].tolist())


def _of(rows: np.ndarray, what: str) -> str:
    return f" (one of {len(rows)} {what})" if len(rows) > 1 else ""
