"""Reduction to curves: keys set by hand are found again, and the tolerance holds at the frames of the file."""

import numpy as np
import pytest

from rigid_motion.gltf import Options, curves, reduce_file
from tests.gltf.making import Making, turns, walk
from tests.gltf.player import File, off, shown
from tests.gltf.test_reducing import RADIUS, ROUNDING, both

TOLERANCE = 1e-3
RATE, LAST = 24, 120


def error_at_frames(before: File, after: File) -> float:
    """Return the largest displacement of any point around any node at the keys of the file, computed from matrices."""
    return off(before, after, 0, RADIUS, before.moments(0)).error


def hand_made(joints: int = 8, seed: int = 0) -> tuple[Making, dict[int, np.ndarray]]:
    """Return a chain of joints keyed by hand, each on its own frames, and baked."""
    made, random = Making(), np.random.default_rng(seed)
    made.json["nodes"] = [{"translation": [0.0, 0.2, 0.0], "children": [joint + 1]} for joint in range(joints)]
    del made.json["nodes"][-1]["children"]
    made.json["skins"] = [{"joints": list(range(joints))}]
    times, own = made.times(np.arange(LAST + 1) / RATE), {}
    for joint in range(joints):
        inner = 8 * random.choice(np.arange(1, LAST // 8), random.integers(4, 8), replace=False)
        own[joint] = np.unique(np.concatenate(((0.0, LAST), inner + random.integers(-2, 3, len(inner)))))
        keys = np.column_stack((np.ones(len(own[joint])), 0.2 * random.normal(size=(len(own[joint]), 3))))
        keys /= np.linalg.norm(keys, axis=1, keepdims=True)
        slopes = np.gradient(keys, own[joint], axis=0)
        rows = np.stack((slopes, keys, slopes), axis=1).reshape(-1, 4)
        values = shown("CUBICSPLINE", own[joint], rows, np.arange(LAST + 1), turns=False)
        values /= np.linalg.norm(values, axis=1, keepdims=True)
        made.channel(joint, "rotation", times, values[:, [1, 2, 3, 0]])
    return made, own


@pytest.mark.parametrize("seed", [0, 1])
def test_keys_that_were_set_by_hand_come_back_mostly_on_their_own_frames(tmp_path, seed):
    made, own = hand_made(seed=seed)
    before, after, report = both(made, tmp_path, TOLERANCE, curves=True)
    tracks = {node: (kind, times) for (node, _), (kind, times, _) in after.tracks(0).items()}
    keys = {node: np.round(times * RATE) for node, (_, times) in tracks.items()}
    count, true = sum(map(len, keys.values())), sum(map(len, own.values()))
    assert count <= 1.1 * true
    assert sum(np.isin(frames, own[node]).sum() for node, frames in keys.items()) > 0.6 * count
    assert {kind for kind, _ in tracks.values()} == {"CUBICSPLINE"}
    assert report.clips[0].lines > 3 * count
    assert error_at_frames(before, after) <= TOLERANCE + ROUNDING * report.size


@pytest.mark.parametrize("tolerance", [1e-3, 1e-2])
def test_no_point_around_any_joint_is_off_by_more_than_the_tolerance_at_frames(tmp_path, tolerance):
    before, after, report = both(walk(), tmp_path, tolerance, curves=True)
    error = error_at_frames(before, after)
    assert 0.1 * tolerance < error <= tolerance + ROUNDING * report.size
    assert error <= report.clips[0].error + ROUNDING * report.size
    assert report.clips[0].error <= report.clips[0].between
    assert after.moments(0)[[0, -1]].tolist() == before.moments(0)[[0, -1]].tolist()


def test_a_long_clip_is_searched_in_stretches_and_joined(tmp_path, monkeypatch):
    monkeypatch.setattr(curves, "STRETCH_FRAMES", 60)
    before, after, report = both(walk(joints=3, seconds=6.0), tmp_path, TOLERANCE, curves=True)
    assert error_at_frames(before, after) <= TOLERANCE + ROUNDING * report.size


def test_what_moves_in_lines_stays_lines(tmp_path):
    made = walk(joints=2)
    times = np.arange(61) / 30
    made.channel(
        1, "translation", made.times(times), np.interp(times, [0, 0.5, 1.5, 2], [0, 1, 1, 0])[:, None] * [1, 0, 0]
    )
    before, after, _ = both(made, tmp_path, TOLERANCE, curves=True)
    kind, times, _ = after.tracks(0)[1, "translation"]
    assert kind == "LINEAR"
    assert np.allclose(times, [0, 0.5, 1.5, 2])
    assert error_at_frames(before, after) <= TOLERANCE


def test_keys_that_are_far_apart_are_lines_that_count(tmp_path):
    """Three keys make no curve: the file has lines between them, and the result stays close to these."""
    made = Making()
    made.json["nodes"] = [{"translation": [0.0, 0.0, 0.0]}]
    made.channel(0, "rotation", made.times(np.arange(61) / 30), turns(np.arange(61) / 30, 0))
    made.channel(0, "translation", made.times([0.0, 1.0, 2.0]), np.array([[0.0, 0, 0], [1, 0, 0], [0, 0, 0]]))
    before, after, _ = both(made, tmp_path, TOLERANCE, curves=True)
    assert off(before, after, 0, RADIUS).error <= 2 * TOLERANCE


def test_so_many_key_poses_have_curves_between_them(tmp_path):
    errors = {}
    for is_curved in (True, False):
        path = walk().write(tmp_path / "clip.glb")
        report = reduce_file(path, tmp_path / "poses.glb", Options(None, RADIUS, count=8, curves=is_curved))
        tracks = File(tmp_path / "poses.glb").tracks(0)
        assert {len(times) for (_, path), (_, times, _) in tracks.items() if path == "rotation"} == {8}
        errors[is_curved] = report.clips[0].error
    assert errors[True] < 0.5 * errors[False]
