"""BVH files of whole bodies with several limbs and roots: they are read, measured and shown in every mode."""

import re
from dataclasses import astuple
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.analysis.choices import Choice, Radii, Uniform
from rigid_motion_batch.analysis.results import clip_result
from rigid_motion_batch.recordings.clip_reading import read_source
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.clips.recordings import compare_clip


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


SEEDS = (seed("ZXY", 12), seed("XYZ", 30, moved=True), seed("YXZ", 8, roots=2, end_of_line="\r\n"))


def assert_can_be_shown(clip: Clip, choice: Choice, mode: str) -> None:
    """Measured by the program, with numbers that are some, in tables and in all that a page shows."""
    result = compare_clip(clip, choice, (mode,), Radii())
    if result is None:
        return
    for row in (*result.rows, *result.joints):
        assert all(np.isfinite(cell) for cell in astuple(row) if isinstance(cell, float)), row
    assert result.rows[0].max_shell_m == max(row.max_shell_m for row in result.joints)
    whole = clip_result(clip, [result])
    assert np.isfinite(whole.truth.positions).all()
    for motion in result.motions:
        assert np.isfinite(motion.poses.positions).all()
        assert np.isfinite(motion.errors).all()


@pytest.mark.parametrize("text", SEEDS)
def test_bodies_of_every_kind_are_read_whole_and_shown(tmp_path: Path, text: str) -> None:
    path = tmp_path / "walk.bvh"
    path.write_text(text, encoding="utf-8", newline="")
    (clip,), note = read_source(str(path), None)
    assert (note, clip.repairs) == ("", ())
    for mode in KEYFRAME_MODES:
        assert_can_be_shown(clip, Uniform("5"), mode)
