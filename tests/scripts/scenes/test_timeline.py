from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import interpolate
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.scenes.timeline import ShownMotion, Timeline, peaks
from tests.scripts.clips.recordings import reconstruct, swinging_clip


@pytest.fixture(scope="module")
def swing():
    return reconstruct(swinging_clip(seconds=1.2), "10")


def test_the_film_runs_from_the_first_key_to_the_last(swing):
    timeline = Timeline.of(swing, 30, 1.0)
    times = timeline.times_of(timeline.frames)
    assert timeline.frames[0] == 1.0
    assert times[0] == swing.times[0]
    assert 0.0 <= swing.times[-1] - times[-1] < 1.0 / 30.0
    assert np.allclose(np.diff(times), 1.0 / 30.0)


def test_times_and_frames_lead_to_one_another(swing):
    timeline = Timeline.of(swing, 25, 2.5)
    assert np.allclose(timeline.frames_of(timeline.times_of(timeline.fine_frames)), timeline.fine_frames)
    assert np.array_equal(timeline.fine_frames[:: timeline.steps], timeline.frames)


def test_every_mode_has_its_own_in_betweens_and_meets_the_keys(swing):
    timeline = Timeline.of(swing, 30, 1.0)
    motion = ShownMotion.of(swing, timeline)
    clip, times = swing.clip, timeline.times_of(timeline.fine_frames)
    for mode, poses in motion.modes.items():
        kept = swing.keys[mode]
        expected = interpolate(clip.times[kept], clip.poses[kept], times, mode)
        assert np.allclose(poses.positions + motion.centre, expected.positions, atol=1e-12)
        assert np.allclose(poses.quaternions, expected.quaternions, atol=1e-12)
        assert np.allclose(timeline.times_of(motion.key_frames[mode]), clip.times[kept])
        assert np.allclose(motion.keys[mode].positions + motion.centre, clip.poses[kept].positions)


def test_the_best_of_each_segment_is_shown_by_the_mode_that_was_best_there():
    made = choose(swinging_clip(seconds=1.2), Uniform("8"), ("lerp_slerp", "motor_spline", BEST_OF), 0.1)
    assert len(set(made.segment_modes)) == 2
    timeline = Timeline.of(made, 30, 1.0)
    motion = ShownMotion.of(made, timeline)
    times, key_times = timeline.times_of(timeline.fine_frames), made.clip.times[made.keys[BEST_OF]]
    segment = np.clip(np.searchsorted(key_times, times, side="right") - 1, 0, len(key_times) - 2)
    for number, mode in enumerate(made.segment_modes):
        here = segment == number
        assert np.allclose(motion.modes[BEST_OF].positions[here], motion.modes[mode].positions[here], atol=1e-12)


def test_the_least_and_the_largest_of_each_column_are_kept():
    values = np.random.default_rng(5).normal(size=10_000)
    kept = peaks(values, 100)
    assert np.all(np.diff(kept) > 0)
    assert len(kept) <= 202
    for column in np.split(np.arange(10_000), 100):
        here = values[kept[(kept >= column[0]) & (kept <= column[-1])]]
        assert (here.min(), here.max()) == (values[column].min(), values[column].max())
    assert np.array_equal(peaks(values[:7], 100), np.arange(7))
