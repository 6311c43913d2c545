"""Tests of the viewer's data: JavaScript reads what Python packs, and both compute the same mathematics."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.results import ClipResult
from rigid_motion_batch.recordings import read_clips
from rigid_motion_batch.report import data
from rigid_motion_batch.report.data import MOST_TRIANGLES, Mesh, clip_data, drill
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.report.javascript import read_by_viewer
from tests.scripts.report.runs import result_of

BODIES = Path(__file__).parents[1] / "recordings" / "bodies"

TEN = (Uniform("10"),)


def read(clip: ClipResult, expression: str) -> Any:
    return read_by_viewer(clip_data(clip, str, drill()), expression)


def middle_of(clip: ClipResult) -> np.ndarray:
    """Return the centre of the box around the recording."""
    places = clip.truth.positions.reshape(-1, 3)
    return (places.min(axis=0) + places.max(axis=0)) / 2.0


def test_times_errors_and_keys_of_a_clip_are_those_of_the_analysis() -> None:
    clip = result_of(swinging_clip(), TEN)
    (result,) = clip.choices
    motion = result.motions[-1]
    matches = read(
        clip, "{ times: choice.times, errors: choice.motions.at(-1).errors, keys: choice.motions.at(-1).keys }"
    )
    times = clip.times[result.first : result.first + motion.errors.shape[1]] - clip.times[0]
    np.testing.assert_allclose(matches["times"], times, atol=1e-6)
    np.testing.assert_allclose(matches["keys"], clip.times[motion.keys] - clip.times[0], atol=1e-6)
    for row, factor in enumerate((1e3, 1e3, 1.0)):
        largest = motion.errors[row].max()
        np.testing.assert_allclose(matches["errors"][row], motion.errors[row] * factor, atol=4e-5 * largest * factor)


def test_the_view_has_a_body_where_its_mode_puts_it() -> None:
    clip = result_of(swinging_clip(), TEN)
    (result,) = clip.choices
    sample = 137
    moment = float(clip.times[result.first + sample] - clip.times[0])
    point, middle = np.array((0.03, -0.02, 0.1)), middle_of(clip)
    at = f"moved(matrixOf(poseAt(recording, choice, {moment!r}, motion, 1)), {point.tolist()})"
    for motion, seen in zip(result.motions, read(clip, f"choice.motions.map((motion) => {at})"), strict=True):
        pose = motion.poses[sample]
        np.testing.assert_allclose(seen, pose.positions - middle + rotate(pose.quaternions, point), atol=2e-4)


def test_a_magnified_body_is_so_many_times_as_far_off() -> None:
    clip = result_of(swinging_clip(), TEN)
    (result,) = clip.choices
    motion, sample = result.motions[0], 137
    moment = float(clip.times[result.first + sample] - clip.times[0])
    seen = read(clip, f"poseAt(recording, choice, {moment!r}, choice.motions[0], 4)")
    truth = clip.truth[result.first + sample]
    away = np.array(seen["places"]) + middle_of(clip) - truth.positions
    np.testing.assert_allclose(away, 4 * (motion.poses.positions[sample] - truth.positions), atol=1e-4)
    turned = 2.0 * np.degrees(np.arccos(abs(float(np.dot(seen["turn"], truth.quaternions)))))
    assert turned == pytest.approx(4.0 * motion.errors[2, sample], rel=1e-2)


def test_the_joints_of_a_whole_body_are_where_its_mode_puts_them() -> None:
    clip = result_of(swinging_body(), TEN)
    (result,) = clip.choices
    motion, sample = result.motions[0], 17
    moment = float(clip.times[result.first + sample] - clip.times[0])
    seen = read(clip, f"poseAt(recording, choice, {moment!r}, choice.motions[0], 1)")
    places = motion.poses.positions[:, sample] - middle_of(clip)
    np.testing.assert_allclose(np.reshape(seen["places"], (-1, 3)), places, atol=1e-4)
    largest = motion.joint_errors.max()
    np.testing.assert_allclose(seen["errors"], motion.joint_errors[:, sample], atol=largest / 200)


def test_a_long_recording_keeps_the_worst_moments_in_view_and_chart(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(data.MOST_SEEN, False, 8000)
    monkeypatch.setattr(data, "MOST_CHARTED", 100)
    clip = result_of(swinging_clip(seconds=20.0), TEN)
    shown = "about: choice.about, moments: choice.moments, times: choice.times"
    matches = read(clip, f"{{ {shown}, errors: choice.motions.map((motion) => motion.errors[0]) }}")
    (result,) = clip.choices
    assert len(matches["moments"]) < len(clip.times) / 4
    assert matches["about"].endswith("samples; fewer in the view; in the chart the largest of every 19")
    assert len(matches["times"]) == len(matches["errors"][0]) <= 100
    for motion, errors in zip(result.motions, matches["errors"], strict=True):
        worst = clip.times[result.first + motion.errors[0].argmax()] - clip.times[0]
        assert np.abs(np.array(matches["moments"]) - worst).min() < 1e-6
        assert max(errors) == pytest.approx(1e3 * motion.errors[0].max(), rel=1e-4)


@pytest.mark.parametrize("count", [0, MOST_TRIANGLES + 1])
def test_a_mesh_that_the_viewer_cannot_have_is_refused(count: int) -> None:
    with pytest.raises(ValueError, match=f"{count} triangles; give the viewer 1 to {MOST_TRIANGLES}"):
        Mesh(np.zeros((3, 3)), np.zeros((count, 3), dtype=int))


def test_a_body_is_in_the_middle_wherever_its_root_stands() -> None:
    (clip,), _ = read_clips([str(BODIES / "static_root.bvh")])
    result = clip_data(result_of(clip, TEN), str, drill())
    low, high = np.array(result["box"])
    np.testing.assert_allclose(low, -high, atol=1e-12)
    assert result["drawn"] == [1, 2, 3, 4, 5, 6, 7]
    assert result["size"] == pytest.approx(1.57, abs=0.02)
    # The body walks 3.5 m, more than 5 m from its resting root.
    assert np.ptp(result["box"], axis=0).max() == pytest.approx(3.9, abs=0.3)
