from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import shell_error
from rigid_motion_batch.analysis.choices import Radii, Uniform
from rigid_motion_batch.analysis.metrics import write_tables
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.analysis.results import clip_result, measured
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_source
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import compare_clip, swinging_clip
from tests.scripts.comparing import rows_of


def test_a_mode_for_every_segment_costs_a_byte_a_key_and_is_a_column_of_the_keys(tmp_path: Path) -> None:
    made = choose(swinging_clip(), Uniform("10"), ("lerp_slerp", "motor_spline", BEST_OF), 0.1)
    *single, best = measured(made).rows
    assert best.mode == BEST_OF
    assert [best.bytes_per_s] == pytest.approx([57 / 56 * row.bytes_per_s for row in single[:1]])
    write_tables(tmp_path, made)
    keys, all_keys = rows_of(tmp_path / "best_of.keys.csv"), rows_of(tmp_path / "keys.csv")
    assert [row.pop("mode") for row in keys] == [*made.segment_modes, ""]
    assert keys == all_keys
    filled = {mode: rows_of(tmp_path / f"{mode}.csv") for mode in made.keys}
    ends = [float(row["t"]) for row in keys]
    for first, last, mode in zip(ends[:-1], ends[1:], made.segment_modes, strict=True):
        for own, row in zip(filled[mode], filled[BEST_OF], strict=True):
            if first < float(row["t"]) < last:
                assert [float(word) for word in row.values()] == pytest.approx([float(word) for word in own.values()])


@pytest.mark.parametrize("body", [False, True])
def test_errors_are_those_between_what_is_shown(body: bool) -> None:
    clip = swinging_body() if body else read_source(str(ASSETS / "reach.csv"), "unity")[0][0]
    result = compare_clip(clip, Uniform("7"), ("lerp_slerp", "motor_spline"), Radii())
    truth = clip_result(clip, [result]).truth
    for motion in result.motions:
        there = truth[..., result.first : result.first + motion.errors.shape[1]]
        apart = np.linalg.norm(motion.poses.positions - there.positions, axis=-1)
        np.testing.assert_allclose(motion.errors[1], np.atleast_2d(apart).max(axis=0), atol=1e-6)
        assert motion.errors[0].max() == pytest.approx(motion.metrics[0].max_shell_m)
        if not body:
            np.testing.assert_allclose(motion.errors[0], shell_error(motion.poses, there, 0.1), atol=1e-12)
