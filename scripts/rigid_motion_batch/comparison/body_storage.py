"""The keys of whole bodies as files between the tasks of a run."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rigid_motion_batch.analysis.bodies import BodyReconstruction
from rigid_motion_batch.analysis.choices import Choice
from rigid_motion_batch.files import written_beside
from rigid_motion_batch.recordings.clips import Clip

COUNTS = "counts"
"""Behind the name of a mode and a blank: how many keys each joint has."""


def write_body_keys(path: Path, made: BodyReconstruction) -> None:
    """Write what a body's reconstruction can be made of again: the keys of all joints, one after another."""
    content = {}
    for mode, keys in made.keys.items():
        content |= {mode: np.concatenate(keys), f"{mode} {COUNTS}": np.array([len(own) for own in keys])}
    with written_beside(path) as beside:
        np.savez(beside, **content)


def read_body_keys(path: Path, clip: Clip, choice: Choice, *, shared: bool) -> BodyReconstruction:
    """Make a body's reconstruction again from its keys."""
    with np.load(path) as arrays:
        modes = [name for name in arrays.files if not name.endswith(COUNTS)]
        keys = {mode: tuple(np.split(arrays[mode], np.cumsum(arrays[f"{mode} {COUNTS}"])[:-1])) for mode in modes}
    return BodyReconstruction(clip, choice, keys, shared or choice.decimation == "uniform")
