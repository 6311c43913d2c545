from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import MODES, Poses
from rigid_motion_batch.analysis.choices import Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.comparison.storage import (
    ClipReference,
    file_names,
    read_clip,
    read_facts,
    read_keys,
    read_times,
    write_keys,
    write_recording,
)
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.comparison.recordings import swinging_clip


def same(first: Poses, second: Poses) -> bool:
    scales = (first.scales is None) == (second.scales is None) and (
        first.scales is None or np.array_equal(first.scales, second.scales)
    )
    return (
        scales
        and np.array_equal(first.positions, second.positions)
        and np.array_equal(first.quaternions, second.quaternions)
    )


def store(output: Path, clips: list[Clip], note: str = "") -> None:
    arrays, facts = (output / name for name in file_names("recording"))
    write_recording(arrays, facts, clips, note)


def test_a_recording_is_read_back_to_the_bit_under_another_name(tmp_path: Path) -> None:
    plain = swinging_clip("hand", repairs=("dropped 3 rows", "undid sign flips"))
    growing = replace(
        swinging_clip("head", seed=2),
        poses=Poses(plain.poses.positions, plain.poses.quaternions, 1.0 + plain.times / 7.0),
        source=b"clip\xff.bvh:*".decode("utf-8", "surrogateescape"),
        axes="unity",
        metres_per_unit=0.0254,
        body="Head",
    )
    store(tmp_path, [plain, growing], "a note")
    facts = read_facts(tmp_path, "recording")
    assert (facts.note, facts.repairs) == ("a note", (plain.repairs, ()))
    assert (facts.names, facts.bodies) == (("hand", "head"), ("", "Head"))
    for body, clip in enumerate((plain, growing)):
        reference = ClipReference(f"{clip.name}-2", "recording", body)
        again = read_clip(tmp_path, reference)
        assert (again.name, again.source, again.axes) == (f"{clip.name}-2", clip.source, clip.axes)
        assert (again.repairs, again.metres_per_unit, again.body) == (clip.repairs, clip.metres_per_unit, clip.body)
        assert np.array_equal(again.times, clip.times)
        assert np.array_equal(read_times(tmp_path, reference), clip.times)
        assert same(again.poses, clip.poses)


def test_the_same_recording_is_the_same_file(tmp_path: Path) -> None:
    for folder in ("a", "b"):
        store(tmp_path / folder, [swinging_clip()])
    for name in file_names("recording"):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()


@pytest.mark.parametrize("choice", [Uniform("10"), Tolerance("5mm")], ids=["evenly spaced", "adaptive"])
def test_a_reconstruction_is_made_again_from_its_keys_to_the_bit(tmp_path: Path, choice: Choice) -> None:
    clip = swinging_clip(seconds=1.5)
    made = reconstruct(clip, choice, (*MODES, BEST_OF), 0.1)
    write_keys(tmp_path / "keys.npz", made)
    again = read_keys(tmp_path / "keys.npz", clip, choice, 0.1)
    assert list(again.keys) == list(made.keys)
    assert again.segment_modes == made.segment_modes
    for mode, poses in made.poses.items():
        assert np.array_equal(again.keys[mode], made.keys[mode])
        assert same(again.poses[mode], poses)
        assert np.array_equal(again.errors[mode].velocity, made.errors[mode].velocity)
