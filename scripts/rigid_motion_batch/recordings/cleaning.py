"""Clips without jitter and spikes, and descriptions of what was removed: see `rigid_motion.motion.clean`."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from rigid_motion.motion import Cleaned, Poses, clean, repair, standing
from rigid_motion.motion.contacts import slide, spans
from rigid_motion_batch.command_line import listed

from .clips import Clip
from .recordings import Trajectory

RIGID_RADIUS_M, JOINT_RADIUS_M = 0.1, 0.03
"""Metres: the radius of an object in a hand, and of the surroundings of a joint of a body."""

MAX_LISTED_ROWS = 8
"""Number of rows listed by number."""

MIN_UNTOUCHED_RATIO = 0.25
"""Share of untouched samples above which the description mentions them."""


def cleaned_clip(clip: Clip, tolerance: float | None = None, radius: float | None = None) -> tuple[Clip, Cleaned]:
    """Return a clip without jitter, and what was found; tolerance and radius are in metres."""
    metres, body = clip.metres_per_unit, clip.rest_body
    radius = radius or (JOINT_RADIUS_M if body else RIGID_RADIUS_M)
    stands = standing(clip.times, _joint_positions(clip, clip.poses), shaky=True) if body else None
    tolerance, skeleton = tolerance and tolerance / metres, body.skeleton if body else None
    found = clean(clip.times, clip.poses, tolerance, radius / metres, skeleton, stands=stands)
    return replace(clip, times=found.times, poses=found.poses), found


def cleaned_first(clip: Clip, tolerance: float | None) -> Clip:
    """Return a clip without jitter, with a sentence among its repairs that says so."""
    cleaned, found = cleaned_clip(clip, tolerance)
    said = "; ".join(described(clip, found))
    return replace(
        cleaned, repairs=(*clip.repairs, f"cleaned first: {said}; keys and errors are relative to the cleaned motion")
    )


def described(clip: Clip, found: Cleaned, rows: np.ndarray | None = None) -> Iterator[str]:
    """Yield what was found in a clip, and how far samples were moved; `rows` (n,) are their row numbers."""
    rows = np.arange(len(clip.times)) if rows is None else rows
    metres, body = clip.metres_per_unit, clip.rest_body
    position, rotation = (float(np.max(each)) for each in found.noise)
    sizes = [f"{length(metres * position)}"] * (position > 0.0) + [f"{np.degrees(rotation):.2g} degrees"] * (
        rotation > 0.0
    )
    worst = " at its worst joint" if body and sizes else ""
    yield f"jitters by {' and '.join(sizes)}{worst}" if sizes else "no noticeable jitter"
    replaced = found.spikes | found.repeats
    within = np.where(_with_joints_below(clip, replaced), 0.0, found.moved)
    yield f"moved at most {length(metres * float(within.max()))}"
    kinds = ("a spike", "spikes"), ("a repeat of the one before", "repeats of the one before")
    for mask, (single, several) in zip((found.spikes, found.repeats), kinds, strict=True):
        if mask.any():
            some = rows[mask.reshape(-1, mask.shape[-1]).any(axis=0)]
            what = f"1 row was {single}" if len(some) == 1 else f"{len(some)} rows were {several}"
            yield f"{what}: {listed(list(map(str, some)), MAX_LISTED_ROWS)}"
    if (found.times != clip.times).any():
        yield "clock jitters"
    if (share := float(np.mean(found.alone))) > MIN_UNTOUCHED_RATIO:
        yield f"{share:.0%} is left nearly unchanged: noise cannot be distinguished from motion there"
    if body:
        now, before = (
            length(slide(_joint_positions(clip, poses), found.stands)) for poses in (found.poses, clip.poses)
        )
        contacts = f"contacts held: {len(spans(found.stands))}, feet slide by {now} there, before by {before}"
        yield contacts if found.stands.any() else "no foot clearly stands: none is held"


def _joint_positions(clip: Clip, poses: Poses) -> np.ndarray:
    """Return the positions of the joints of a body in these poses, in metres and Blender's axes."""
    return clip.in_blender(clip.whole_body.skeleton.in_root_space(poses)).positions


def _with_joints_below(clip: Clip, marked: np.ndarray) -> np.ndarray:
    """Return the marked samples and those of the joints below them."""
    if clip.rest_body is None:
        return marked
    marked = marked.copy()
    for joint in np.flatnonzero(clip.rest_body.parents >= 0).tolist():
        marked[joint] |= marked[clip.rest_body.parents[joint]]
    return marked


def length(metres: float) -> str:
    """Return a length as text, in millimetres below a metre."""
    return f"{metres:.2g} m" if metres >= 1.0 else f"{1e3 * metres:.2g} mm"


def rows_of(clip: Clip, trajectory: Trajectory) -> np.ndarray:
    """Return the indices of the trajectory's samples that its clip contains, shape (n,)."""
    times, _, repairs = repair(trajectory.times, trajectory.poses, trajectory.rate)
    kept = np.ones(len(trajectory.times), dtype=bool)
    for done in repairs:
        kept[done.rows] &= not done.fault.startswith("dropped")
    first = int(np.searchsorted(times, clip.times[0]))
    return np.flatnonzero(kept)[first : first + len(clip.times)]


def fill_in(numbers: np.ndarray, clip: Clip, found: Cleaned, trajectory: Trajectory, rows: np.ndarray) -> None:
    """Fill the moved samples of a clip into numbers (rows, columns) of a file; `rows` index the trajectory."""
    cells = trajectory.cells
    assert cells is not None
    poses = replace(
        trajectory.poses, positions=trajectory.poses.positions.copy(), quaternions=trajectory.poses.quaternions.copy()
    )
    changed = np.zeros(poses.shape, dtype=bool)
    changed[..., rows] = (found.poses.positions != clip.poses.positions).any(axis=-1)
    changed[..., rows] |= np.abs(found.poses.quaternions - clip.poses.quaternions).max(axis=-1) > 1e-12
    poses.positions[..., rows, :], poses.quaternions[..., rows, :] = found.poses.positions, found.poses.quaternions
    moved = changed.reshape(-1, changed.shape[-1]).any(axis=0)
    with np.errstate(invalid="ignore"):
        for column, values in cells.numbers(poses).items():
            numbers[cells.rows[moved], column] = values[moved]
    if cells.times and (found.times != clip.times).any():
        later = np.interp(trajectory.times, clip.times, found.times - clip.times)
        for column, values in cells.times(trajectory.times + later).items():
            numbers[cells.rows, column] = values
