import numpy as np

from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.scenes.timeline import ShownMotion, Timeline, peaks
from tests.scripts.clips.recordings import swinging_clip


def test_the_best_of_each_segment_is_shown_by_the_mode_that_was_best_there():
    made = choose(swinging_clip(seconds=1.2), Uniform("8"), ("lerp_slerp", "motor_spline", BEST_OF), 0.1)
    assert len(set(made.segment_modes)) == 2
    timeline = Timeline.between(float(made.times[0]), float(made.times[-1]), 30, 1.0)
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
