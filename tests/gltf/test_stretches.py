"""Long clips reduced in stretches: tolerance and standing feet hold across the borders, and memory stays low."""

import tracemalloc

import numpy as np
import pytest

from rigid_motion.gltf import Options, errors, read_document, reduce_file, reduced
from tests.gltf.making import Making, turns, walk
from tests.gltf.player import File, off
from tests.gltf.test_reducing import RADIUS, both

TOLERANCE = 3e-3

SINGLE = 1e-6
"""Rounding error of single precision, in metres."""

STRETCH = 40


@pytest.fixture(autouse=True)
def short_stretches(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(errors, "STRETCH_SAMPLES", STRETCH)


def test_all_that_moves_has_keys_where_stretches_meet_and_few_more_elsewhere(tmp_path, monkeypatch):
    document = read_document(walk(seconds=20.0).write(tmp_path / "walk.glb"))
    (result,) = reduced(document, Options(TOLERANCE, RADIUS)).clips
    meeting = np.float32(np.linspace(0, 600, 16).round() / 30.0)
    assert all(np.isin(meeting, track.times).all() for track in result.tracks if len(track.times) > 1)
    monkeypatch.setattr(errors, "STRETCH_SAMPLES", 10**6)
    (whole,) = reduced(document, Options(TOLERANCE, RADIUS)).clips
    assert result.after.keys <= 1.15 * whole.after.keys


def standing_body() -> tuple[Making, float, float]:
    """Return a body whose leg swings below moving hips, and the times between which its foot stands."""
    made = Making()
    begin, end, times = 1.0, 6.0, np.arange(241) / 30.0
    made.json["nodes"] = [
        {"children": [1, 3]},
        {"children": [2]},
        {"translation": [0.0, -1.0, 0.0]},
        {"translation": [0.0, 0.7, 0.0]},
    ]
    made.json["skins"] = [{"joints": [0, 1, 2, 3]}]
    angles = 0.3 * np.sin(2.0 * times) + 0.1 * np.sin(7.3 * times)
    walks = 0.3 * np.minimum(times - begin, 0.0) + 0.3 * np.maximum(times - end, 0.0)
    own, none = made.times(times), np.zeros_like(times)
    made.channel(0, "translation", own, np.column_stack((walks - np.sin(angles), np.cos(angles), none)))
    made.channel(1, "rotation", own, np.column_stack((none, none, np.sin(angles / 2), np.cos(angles / 2))))
    made.channel(3, "rotation", own, turns(times, 4))
    return made, begin, end


def slide(file: File, begin: float, end: float) -> float:
    """Return the largest distance of the foot from its first position, at the samples of a time range."""
    samples = np.arange(round(30 * begin) + 1, round(30 * end)) / 30.0
    places = file.worlds(0, samples)[2, :, :3, 3]
    return float(np.linalg.norm(places - places[0], axis=1).max())


@pytest.mark.parametrize("stretch", [STRETCH, 10**6], ids=["in stretches", "whole"])
@pytest.mark.parametrize("more", [{}, {"shared": True}, {"curves": True}, {"count": 60}], ids=str)
def test_feet_that_stand_across_borders_slide_by_no_more_than_a_millimetre(tmp_path, monkeypatch, more, stretch):
    monkeypatch.setattr(errors, "STRETCH_SAMPLES", stretch)
    made, begin, end = standing_body()
    before, after, report = both(made, tmp_path, None if "count" in more else 2e-2, **more)
    assert slide(before, begin, end) < SINGLE
    assert slide(after, begin, end) <= 1e-3 * report.size / 1.7 + SINGLE
    if "count" in more:
        assert len(after.moments(0)) == 60
    else:
        assert report.clips[0].tracks is not None
    if not {"count", "curves"} & more.keys():
        assert off(before, after, 0, RADIUS).error <= report.tolerance + SINGLE


@pytest.mark.slow
def test_memory_hardly_grows_with_the_length(tmp_path, monkeypatch):
    monkeypatch.setattr(errors, "STRETCH_SAMPLES", 300)

    def peak(seconds: float) -> int:
        path = walk(4, seconds).write(tmp_path / f"{seconds}.glb")
        tracemalloc.start()
        reduce_file(path, tmp_path / "out.glb", Options(2e-2, RADIUS))
        result = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return result

    # The file has 31 numbers per frame; in double precision, even these are never all in memory at once.
    assert peak(140.0) - peak(30.0) < 110 * 30 * 31 * 8
