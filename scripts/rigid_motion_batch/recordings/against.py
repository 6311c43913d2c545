"""Another motion of a clip: read like the clip, matched to it in time and joint by joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.axes import from_blender

from . import clip_reading
from .clips import Clip, OtherMotion
from .options import ReadingOptions
from .reading import format_of, split_source
from .recordings import TrajectoryError, listed
from .rest_bodies import in_parents

ROUNDED = 6e-4
"""Seconds that a motion may begin later or end sooner: times are often rounded to milliseconds."""


def with_against(clip: Clip, source: str, name: str, axes: str | None, options: ReadingOptions) -> tuple[Clip, str]:
    """Return a clip beside another motion, cut to the time that both have, and notes on that, which may be empty.

    Parameters
    ----------
    clip : Clip
    source : str
        As `read_trajectories` takes it; of one body.
    name : str
        What to call its motion.
    axes : str, optional
        As for the clip; None for those of the source's own format.
    options : ReadingOptions
        Those of the clip. Its part is not that of the other motion, whose clock is its own.

    Raises
    ------
    TrajectoryError
        Where the source cannot be read, has not the joints of the clip, or no time that the clip has.
    """
    honoured = {"scale", *format_of(split_source(source)[0]).honours}
    own = {name: getattr(options, name) for name in options.given if name in honoured}
    others, note = clip_reading.read_source(source, axes, ReadingOptions(**own, start=0.0))
    if len(others) > 1:
        raise TrajectoryError(source, f"{len(others)} bodies", "name the one that moves as the recording does")
    other = others[0]
    result = OtherMotion(name, other.times, _as_in(clip, other, source))
    first, last = np.searchsorted(clip.times, other.times[[0, -1]] + (-ROUNDED, ROUNDED))
    if last - first < 2:
        problem = f"it lasts from {_span(other.times)}, and {clip.source} from {_span(clip.times)}"
        raise TrajectoryError(source, problem, "give both the same clock")
    notes = [note, *(f"{name}: {repair}" for repair in other.repairs)]
    if last - first < len(clip.times):
        part = slice(int(first), int(last))
        said = f"compared from {_span(clip.times[part])} alone, where {name} has a motion too"
        clip = replace(clip, times=clip.times[part], poses=clip.poses[..., part], repairs=(*clip.repairs, said))
    return replace(clip, against=result), "; ".join(filter(None, notes))


def _span(times: np.ndarray) -> str:
    return f"{times[0].round(3):.13g} to {times[-1].round(3):.13g} s"


def _as_in(clip: Clip, other: Clip, source: str) -> Poses:
    """Return the poses of another clip in the axes, the unit and, of a whole body, the joints of a clip."""
    own, theirs = clip.rest_body, other.rest_body
    poses = from_blender(other.in_blender(other.poses), clip.axes)
    poses = Poses(poses.positions / clip.metres_per_unit, poses.quaternions, poses.scales)
    if own is None and theirs is None:
        return poses
    if own is None or theirs is None:
        kinds = [f"a body of {len(item.joints)} joints" if item else "a single rigid body" for item in (own, theirs)]
        raise TrajectoryError(source, f"this is {kinds[1]}, and {clip.source} {kinds[0]}", "give the same of both")
    places = {name: place for place, name in enumerate(theirs.joints)}
    if missing := [name for name in own.joints if name not in places]:
        has = f"{clip.source} has {'it' if len(missing) == 1 else 'them'}"
        raise TrajectoryError(source, f"it has no joint {listed(missing, 5)}", has)
    world = theirs.skeleton.in_root_space(poses)[[places[name] for name in own.joints]]
    return in_parents(world, own.parents)
