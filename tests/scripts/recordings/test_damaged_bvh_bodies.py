"""Damaged BVH files of whole bodies, thousands of them: each is refused in one line, or read, measured and shown.

RIGID_MOTION_FUZZ says how many, as in `test_fuzz`, and RIGID_MOTION_FUZZ_FROM with which one to begin.
"""

from __future__ import annotations

import os
import re
import time
from dataclasses import astuple
from pathlib import Path
from random import Random

import numpy as np
import pytest

from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.analysis.choices import Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.radii import Radii
from rigid_motion_batch.analysis.results import clip_result, compare_clip
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_source
from rigid_motion_batch.recordings.clips import Clip
from tests.recordings import RECORDINGS
from tests.scripts.recordings.mutations import mutated
from tests.scripts.recordings.test_fuzz import PATIENCE, assert_is_one_line
from tests.thoroughness import THOROUGH

ALL = 20_000

CASES = int(os.environ.get("RIGID_MOTION_FUZZ", ALL if THOROUGH else ALL // 50))
FIRST = int(os.environ.get("RIGID_MOTION_FUZZ_FROM", "0"))

PARTS = 4
"""For as many processors."""

MEASURED = 3
"""Of so many that can be read one is measured and shown, and of so many of these one gets keys by its motion."""

LONGEST = 200
"""Samples of what is measured: a line that is there 300 times over is no short recording any more."""


def hierarchy(name: str, depth: int, channels: str, children: int = 1) -> str:
    """A joint of a chain so deep, the first one of which has several children."""
    inner = "".join(
        hierarchy(f"{name}{child or ''}_{depth}", depth - 1, channels) for child in range(children * (depth > 0))
    )
    inner = inner or "End Site\n{\nOFFSET 0 0.2 0.1\n}\n"
    return f"JOINT {name}\n{{\nOFFSET 0.1 0.{4 + depth} -0.05\nCHANNELS {channels}\n{inner}}}\n"


def seed(
    order: str, frames: int, *, moved: bool = False, roots: int = 1, end_of_line: str = "\n", speed: float = 0.4
) -> str:
    """A body with two arms that swings them, its joints turned in this order, and moved as well if they shall be."""
    places, turns = "Xposition Yposition Zposition", " ".join(f"{axis}rotation" for axis in order)
    channels = f"6 {places} {turns}" if moved else f"3 {turns}"
    text = "HIERARCHY\n"
    for name in ("Hips", "Prop")[:roots]:
        body = hierarchy(name, 2, channels, 2)
        text += body.replace("JOINT", "ROOT", 1).replace(channels, f"6 {places} {turns}", 1)
    sizes = np.array([30.0 if kind == "rotation" else 0.4 for kind in re.findall("[XYZ](position|rotation)", text)])
    text += f"MOTION\nFrames: {frames}\nFrame Time: 0.0333333\n"
    for frame in range(frames):
        values = sizes * (1.0 + np.sin(speed * frame + np.arange(len(sizes))))
        text += " ".join(f"{value:.4f}" for value in values) + "\n"
    return text.replace("\n", end_of_line)


SEEDS = (
    seed("ZXY", 12),
    seed("XYZ", 30, moved=True),
    seed("YXZ", 8, roots=2, end_of_line="\r\n"),
)


def assert_can_be_shown(clip: Clip, choice: Choice, mode: str) -> None:
    """Measured by the program, with numbers that are some, in tables and in all that a page shows."""
    found = compare_clip(clip, choice, (mode,), Radii(), shared=False)
    if found is None:
        return
    for row in (*found.rows, *found.joints):
        assert all(np.isfinite(cell) for cell in astuple(row) if isinstance(cell, float)), row
    assert found.rows[0].max_shell_m == max(row.max_shell_m for row in found.joints)
    whole = clip_result(clip, [found])
    assert np.isfinite(whole.truth.positions).all()
    for motion in found.motions:
        assert np.isfinite(motion.poses.positions).all()
        assert np.isfinite(motion.errors).all()


def fuzz(folder: Path, seeds: tuple[bytes, ...], numbers: range) -> int:
    """Read damaged files, and return how many could be read nevertheless."""
    path, readable = folder / "walk.bvh", 0
    for number in numbers:
        chance = Random(f"body {number}")
        path.write_bytes(mutated(chance.choice(seeds), chance))
        started = time.perf_counter()
        try:
            try:
                clips, note = read_source(str(path), None)
            except TrajectoryError as error:
                assert_is_one_line(str(error), str(path))
                continue
            assert note.isprintable()
            readable += 1
            (clip,) = clips
            if readable % MEASURED == 0 and clip.figure is not None and len(clip.times) <= LONGEST:
                by_motion = readable % MEASURED**2 == 0
                mode = list(KEYFRAME_MODES)[readable // MEASURED % len(KEYFRAME_MODES)]
                assert_can_be_shown(clip, Tolerance("1cm") if by_motion else Uniform("5"), mode)
        except Exception as error:
            error.add_note(f"case {number}: {path}")
            raise
        assert time.perf_counter() - started < PATIENCE, f"case {number}: {path}"
    return readable


@pytest.mark.parametrize("text", SEEDS)
def test_what_is_damaged_here_is_sound_before(tmp_path: Path, text: str) -> None:
    path = tmp_path / "walk.bvh"
    path.write_text(text, encoding="utf-8", newline="")
    (clip,), note = read_source(str(path), None)
    assert (note, clip.repairs) == ("", ())
    for mode in KEYFRAME_MODES:
        assert_can_be_shown(clip, Uniform("5"), mode)


@pytest.mark.parametrize("part", range(PARTS))
def test_a_damaged_body_is_refused_in_one_line_or_can_be_measured_and_shown(tmp_path: Path, part: int) -> None:
    numbers = range(FIRST + part, FIRST + CASES, PARTS)
    readable = fuzz(tmp_path, tuple(text.encode() for text in SEEDS), numbers)
    assert 0 < readable < len(numbers) or len(numbers) < 50, "damage that is always or never noticed tells little"


@pytest.mark.recordings
def test_other_peoples_bodies_are_damaged_as_well(tmp_path: Path) -> None:
    """The beginning of one, with as many frames as it says: damage is to be the only thing that is wrong."""
    head, _, motion = (RECORDINGS / "beat_saber_body.bvh").read_text(encoding="utf-8").partition("MOTION\n")
    _, frame_time, *rows = motion.splitlines()
    text = "\n".join([f"{head}MOTION", "Frames: 20", frame_time, *rows[:20], ""])
    assert 0 < fuzz(tmp_path, (text.encode(),), range(FIRST, FIRST + CASES // 20)) < CASES // 20
