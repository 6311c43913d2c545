"""Fuzz tests of readers: a damaged file is refused in one line, or becomes a recording that modes can interpolate.

RIGID_MOTION_FUZZ=20000 tries that many damaged files of each format, instead of the few that an ordinary run has time
for. A failure names its case; RIGID_MOTION_FUZZ_FROM begins there.
"""

import os
import re
import sys
import time
from pathlib import Path
from random import Random

import numpy as np
import pytest

from rigid_motion.motion import MODES, interpolate, measure, reduce_keys
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.recordings import ReadingOptions, TrajectoryError, read_trajectories
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.options import AS_THE_FILE_SAYS
from tests.scripts.bvh_bodies import TIMES, bvh_text
from tests.scripts.recordings.layouts import LAYOUTS
from tests.scripts.recordings.mutations import mutated
from tests.thoroughness import tried

CASES = int(os.environ.get("RIGID_MOTION_FUZZ", tried(400)))
FIRST = int(os.environ.get("RIGID_MOTION_FUZZ_FROM", "0"))

FILLED_IN = max(1, CASES // 400)
"""One in this many cases is also interpolated, which takes longer than reading."""

PATIENCE = 20
"""Limit of processor time for one small file, in seconds."""

LONGEST_ERROR = 2000
"""The most characters of an error message, without the path."""

BONE = ":Body/Hand"
"""Suffix of a source that requests a bone."""

WHAT_IS_WRONG = re.compile(rf"(:\d+|:\*|{BONE})?: .+; .+")
"""The form of an error message after the path."""


def read_and_fill_in(source: str, number: int, options: ReadingOptions = AS_THE_FILE_SAYS) -> bool:
    """Return whether the file holds a recording; any outcome other than that or a refusal in one line is an error."""
    try:
        recording = read_trajectories(source, options)
        clips = [make_clip(trajectory, source, trajectory.name, "blender") for trajectory in recording.trajectories]
    except TrajectoryError as error:
        assert_is_one_line(str(error), source)
        return False
    assert recording.note.isprintable()
    if number % FILLED_IN:
        return True
    mode = list(MODES)[number // FILLED_IN % len(MODES)]
    for clip in clips:
        between = np.linspace(clip.times[0], clip.times[-1], 20)
        poses = interpolate(clip.times, clip.poses, between, mode)
        assert np.isfinite(poses.positions).all()
        assert np.isfinite(poses.quaternions).all()
        ends = [0, len(clip.times) - 1]
        shown = interpolate(clip.times[ends], clip.poses[..., ends], clip.times, mode)
        assert np.isfinite(measure(clip.times, shown, clip.poses).shell).all()
        if clip.rest_body is not None:
            made = reconstruct(clip, Uniform("5"), (mode,), 0.03)
            if made is not None:
                assert np.isfinite(measured(made).rows[0].rms_shell_m)
        elif len(clip.times) < 50:
            assert len(reduce_keys(clip.times, clip.poses, mode, tolerance=0.01)) >= 2
    return True


def find_bpy_itself() -> None:
    """Let a process that takes over the module path of one with Blender find the package bpy, and not a part of it."""
    sys.path[:] = [folder for folder in sys.path if not Path(folder, "addon_utils.py").exists()]


def assert_is_one_line(message: str, source: str) -> None:
    path = source.removesuffix(":*").removesuffix(BONE)
    assert message.startswith(path)
    assert WHAT_IS_WRONG.fullmatch(message, len(path)), f"not of the form FILE:LINE: problem; way out: {message!r}"
    assert message.isprintable()
    assert len(message) < LONGEST_ERROR + 3 * len(path)


def fuzz(folder: Path, ending: str, sound: bytes, cases: int, options: ReadingOptions = AS_THE_FILE_SAYS) -> int:
    """Read damaged files, and return how many could still be read."""
    path, readable = folder / f"take{ending}", 0
    for number in range(FIRST, FIRST + cases):
        chance = Random(f"{ending} {number}")
        path.write_bytes(mutated(sound, chance))
        source = f"{path}{chance.choice(('', ':*'))}"
        started = time.process_time()
        try:
            readable += read_and_fill_in(source, number, options)
        except Exception as error:
            error.add_note(f"case {number} of {ending}: {path}")
            raise
        assert time.process_time() - started < PATIENCE, f"case {number} of {ending}: {path}"
    return readable


@pytest.mark.any_blender
def test_a_damaged_bvh_is_refused_in_one_line_or_can_be_filled_in(tmp_path: Path) -> None:
    readable = fuzz(tmp_path, ".bvh", bvh_text(TIMES[:8]).encode(), CASES)
    assert 0 < readable < CASES, "damage that is always or never noticed tells little"


@pytest.mark.any_blender
@pytest.mark.parametrize("name", LAYOUTS)
def test_damage_to_any_layout_is_refused_in_one_line_or_can_be_filled_in(tmp_path: Path, name: str) -> None:
    layout = LAYOUTS[name]
    fuzz(tmp_path, f".{layout.name}", layout.text.encode(), CASES // 10, ReadingOptions(**layout.said))
