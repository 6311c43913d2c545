"""Tests of `bezier` against Blender: the same keys evaluated by Blender itself, on recordings and random keys."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras import anim_utils

from rigid_motion.motion import Poses, decimate, interpolate
from rigid_motion.motion.quaternions import align_signs, normalise
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_clips
from tests.blank import blank
from tests.recordings import RECORDINGS

PATHS = {"location": 3, "rotation_quaternion": 4, "scale": 3}

EVERY = 0.125
"""Frames between compared samples: exact in single precision."""


def shown_by_blender(frames: np.ndarray, keys: Poses, at: np.ndarray) -> Poses:
    """Return the poses that Blender shows between keys that are inserted with its defaults."""
    blank()
    obj = bpy.data.objects.new("Tool", None)
    obj.rotation_mode = "QUATERNION"
    bpy.context.scene.collection.objects.link(obj)
    scales = np.ones(len(frames)) if keys.scales is None else keys.scales
    for frame, position, quaternion, scale in zip(frames, keys.positions, keys.quaternions, scales, strict=True):
        obj.location, obj.rotation_quaternion, obj.scale = position, quaternion, [scale] * 3
        for path in PATHS:
            obj.keyframe_insert(path, frame=frame)
    data = obj.animation_data
    curves = anim_utils.action_get_channelbag_for_slot(data.action, data.action_slot).fcurves
    values = [
        np.array([[curves.find(path, index=index).evaluate(frame) for index in range(width)] for frame in at])
        for path, width in PATHS.items()
    ]
    return Poses(values[0], normalise(values[1]), None if keys.scales is None else values[2][:, 0])


def assert_same(frames: np.ndarray, keys: Poses) -> None:
    at = np.arange(frames[0], frames[-1] + EVERY, EVERY)
    expected, found = shown_by_blender(frames, keys, at), interpolate(frames, keys, at, "bezier")
    size = max(1.0, np.abs(keys.positions).max())
    assert np.abs(found.positions - expected.positions).max() < 1e-6 * size
    assert np.abs(found.quaternions - expected.quaternions).max() < 1e-6
    if keys.scales is not None:
        assert np.abs(found.scales - expected.scales).max() < 1e-6 * keys.scales.max()


@pytest.mark.parametrize("seed", range(6))
def test_random_keys(seed):
    random = np.random.default_rng(seed)
    count = int(random.integers(2, 24))
    # Handles are a third of a segment away; single precision rounds them to less than a millionth of a frame.
    frames = np.cumsum(random.integers(1, 9, count)).astype(float)
    positions = random.normal(size=(count, 3)).round(1 if seed % 3 else 9)
    quaternions = align_signs(normalise(random.normal(size=(count, 4))))
    keys = Poses(np.float32(positions), np.float32(quaternions), np.float32(np.exp(random.normal(size=count))))
    assert_same(frames, Poses(keys.positions, keys.quaternions, keys.scales if seed % 2 else None))


FOLDERS = (ASSETS, RECORDINGS, RECORDINGS.parent / "rigs")

FROM_SKELETONS = ("hips", "head", "lefthand", "rightfoot")
"""Joints of whole bodies that are used as tracks, by their motion in the space of the roots."""


def tracks() -> list[tuple[Path, str]]:
    """Return all tracks as (path, name): devices and joints in assets/, and in other recordings if they exist."""
    result = []
    for folder in FOLDERS:
        tables = sorted(path for path in folder.glob("*") if path.suffix in (".csv", ".tum"))
        result += [(path, name) for path in tables for name in (("hand", "tool") if path.stem == "hold" else ("",))]
        result += [(path, joint) for path in sorted(folder.glob("*.bvh")) for joint in FROM_SKELETONS]
    return result


def poses_of(path: Path, name: str) -> tuple[np.ndarray, Poses]:
    """Return the times (n,) in seconds and the poses (n,) in metres of a track."""
    skeleton = path.suffix == ".bvh"
    clip = read_clips([f"{path}:{name}" if name and not skeleton else str(path)], "blender")[0][0]
    poses = clip.in_metres(clip.poses)
    if skeleton:
        (joint,) = (at for at, joint in enumerate(clip.rest_body.joints) if joint.lower().endswith(name))
        poses = clip.rest_body.skeleton.in_root_space(poses)[joint]
    return clip.times - clip.times[0], poses


def test_there_are_twenty_recordings():
    if not RECORDINGS.exists():
        pytest.skip(f"no {RECORDINGS}")
    assert len(tracks()) >= 20
    assert len({(path.stem, name) for path, name in tracks()}) == len(tracks())


@pytest.mark.any_blender
@pytest.mark.parametrize("rate", [2.0, 5.0, 15.0])
@pytest.mark.parametrize(("path", "name"), tracks(), ids=lambda part: part.stem if isinstance(part, Path) else part)
def test_recordings(path, name, rate):
    times, poses = poses_of(path, name)
    times = 24.0 * times
    kept = decimate(times, rate / 24.0)
    # Frames as Blender stores keys: exact in single precision, distinct, and small enough not to be rounded.
    kept = kept[times[kept] < 250.0]
    frames = np.round(times[kept] / EVERY) * EVERY
    kept, frames = kept[np.diff(frames, prepend=-1.0) > 0.0], frames[np.diff(frames, prepend=-1.0) > 0.0]
    keys = poses[kept]
    assert_same(frames, Poses(np.float32(keys.positions), np.float32(align_signs(keys.quaternions))))
