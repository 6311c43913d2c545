import csv
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.motion import KEYFRAME_MODES, Poses, decimate
from rigid_motion_batch.analysis import needed
from rigid_motion_batch.analysis.needed import (
    KeysNeeded,
    NeededRow,
    Ways,
    evenly_spaced,
    keys_needed,
    overall,
    part_of,
    rows_of,
)
from rigid_motion_batch.files import write_rows
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.analysis.test_choices import errors_of
from tests.scripts.clips.recordings import swinging_clip

RATES = ("30", "12", "8")

GROUPS = (("lerp_slerp",), ("dq_sclerp", "pga_slerp", "cga_slerp"), ("pga_lerp", "cga_lerp"), ("motor_spline",))


def rms(errors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


@pytest.fixture(autouse=True, scope="module")
def few_rates() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(needed, "RATES", RATES)
        yield


@pytest.fixture(scope="module")
def swing() -> Clip:
    return swinging_clip(seconds=2.05)


@pytest.fixture(scope="module")
def result(swing: Clip) -> KeysNeeded:
    return keys_needed(Ways(swing, 0.1), KEYFRAME_MODES, "lerp_slerp")


def test_the_error_to_reach_is_that_of_the_reference_at_its_rate(swing: Clip, result: KeysNeeded) -> None:
    assert result.groups == GROUPS
    for place, rate in enumerate(RATES):
        keys = decimate(swing.times, float(rate))
        covered = part_of(swing, 0, keys[-1])
        assert result.reference_keys[place] == len(keys)
        assert result.durations[place] == covered.times[-1] - covered.times[0]
        for row, (mode, *_) in enumerate(GROUPS):
            error = rms(errors_of(covered, keys, mode))
            assert result.uniform_errors[row, place] == pytest.approx(error, rel=1e-9)
        assert result.targets[place] == result.uniform_errors[0, place]


def test_evenly_spaced_keys_reach_it_and_one_segment_fewer_do_not(swing: Clip, result: KeysNeeded) -> None:
    for place, rate in enumerate(RATES):
        covered = part_of(swing, 0, decimate(swing.times, float(rate))[-1])
        for row, (mode, *_) in list(enumerate(GROUPS))[1:]:
            segments = int(result.keys[row, 0, place]) - 1
            enough, fewer = (
                rms(errors_of(covered, evenly_spaced(covered, count), mode)) for count in (segments, segments - 1)
            )
            assert enough <= result.targets[place] * (1.0 + 1e-9) < fewer
            assert result.reached[row, 0, place] == pytest.approx(enough, rel=1e-9)
            assert result.reached[row, 1, place] <= result.targets[place] * (1.0 + 1e-9)
            assert result.keys[row, 1, place] <= segments + 1


def test_fitted_keys_reach_it_and_are_fewer(swing: Clip, result: KeysNeeded) -> None:
    shaken = np.random.default_rng(3).normal(size=swing.poses.positions.shape)
    clip = replace(swing, poses=Poses(swing.poses.positions + 1e-3 * shaken, swing.poses.quaternions))
    with_fitted = keys_needed(Ways(clip, 0.1, fit=True), ["motor_spline"])
    assert with_fitted.keys.shape == (1, 3, len(RATES))
    assert (with_fitted.reached[:, 2] <= with_fitted.targets * (1.0 + 1e-9)).all()
    assert (with_fitted.keys[:, 2] <= with_fitted.keys[:, 1]).all()
    assert with_fitted.keys[:, 2].sum() < 0.97 * with_fitted.keys[:, 1].sum()
    assert overall([with_fitted, with_fitted]).shares == pytest.approx(with_fitted.shares)
    assert result.keys.shape[1] == 2


def test_where_the_reference_has_all_samples_or_no_two_there_is_nothing_to_reach() -> None:
    slow = keys_needed(Ways(swinging_clip(seconds=2.0, rate=15.0), 0.1), ["lerp_slerp", "motor_spline"], "lerp_slerp")
    assert np.isnan(slow.keys[:, :, 0]).all()
    assert np.isfinite(slow.keys[:, :, 1:]).all()
    short = keys_needed(Ways(swinging_clip(seconds=0.1), 0.1), ["lerp_slerp"], "lerp_slerp")
    assert np.isnan(short.keys[:, :, RATES.index("8")]).all()
    assert np.isfinite(short.keys[:, :, RATES.index("30")]).all()


def test_what_takes_every_sample_is_not_reached() -> None:
    random = np.random.default_rng(0)
    clip = swinging_clip(seconds=2.0, rate=30.5)
    shaken = replace(clip, poses=Poses(random.normal(size=(len(clip.times), 3)), clip.poses.quaternions))
    result = keys_needed(Ways(shaken, 0.1), ["lerp_slerp", "motor_spline"], "lerp_slerp")
    at = RATES.index("30")
    assert result.targets[at] > 0.1
    assert np.isinf(result.keys[1, 0, at])
    assert np.isnan(overall([result]).shares[1, 0, at])
    assert (overall([result]).clips[1, 0, at], overall([result]).asked[at]) == (0, 1)


def clip_of(name: str, keys: object, reference: float = 100.0) -> KeysNeeded:
    """Return the result for a clip of 10 s that needs these numbers of keys, (groups, decimations), at both rates."""
    keys = np.repeat(np.array(keys, dtype=float)[..., None], 2, axis=-1)
    return KeysNeeded(
        clip=name,
        groups=(("lerp_slerp",), ("dq_sclerp",)),
        rates=RATES[:2],
        durations=np.full(2, 10.0),
        reference_keys=np.full(2, reference),
        targets=np.full(2, 2e-3),
        keys=keys,
        reached=np.full(keys.shape, 1e-3),
        uniform_errors=np.full((len(keys), 2), 4e-3),
    )


def test_over_all_clips_shares_and_rates_are_geometric_means() -> None:
    together = overall([clip_of("a", [[101, 51], [101, 26]], 101), clip_of("b", [[201, 201], [201, 101]], 201)])
    assert together.keys_per_s[1, 1, 0] == pytest.approx(np.sqrt(2.5 * 10.0))
    assert together.shares[1, 1, 0] == pytest.approx(np.sqrt(26 / 101 * 101 / 201))
    assert together.reference_keys_per_s[0] == pytest.approx(np.sqrt(200.0))
    assert together.uniform_errors[0, 0] == pytest.approx(4e-3)


def test_over_all_clips_those_count_that_reached_the_error_and_it_is_known_how_many() -> None:
    keys = {"a": [[100, 50], [100, np.inf]], "b": [[100, 25], [100, 60]], "c": np.full((2, 2), np.nan)}
    together = overall([clip_of(name, own) for name, own in keys.items()])
    assert together.asked.tolist() == [2, 2]
    assert together.clips[:, 1, 0].tolist() == [2, 1]
    assert together.shares[:, 1, 0] == pytest.approx([np.sqrt(0.5 * 0.25), 0.6])


def test_the_table_as_a_file_has_a_row_for_every_mode_and_reads_back_exactly(tmp_path, result):
    never = clip_of("b", [[100, 50], [np.inf, np.nan]])
    write_rows(tmp_path / "keys_needed.csv", NeededRow, (row for clip in (result, never) for row in rows_of(clip)))
    with (tmp_path / "keys_needed.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(KEYFRAME_MODES) * 2 * len(RATES) + 6
    for row in rows[:-6]:
        group = next(place for place, modes in enumerate(GROUPS) if row["mode"] in modes)
        at = group, ("uniform", "adaptive").index(row["decimation"]), RATES.index(row["as_good_as_hz"])
        assert float(row["wanted_rms_shell_m"]) == result.targets[at[-1]]
        written = [float(row[name]) for name in ("keys", "keys_per_s", "share", "rms_shell_m")]
        assert written == [result.keys[at], result.keys_per_s[at], result.shares[at], result.reached[at]]
    assert [row["keys"] for row in rows[-6:]] == ["100", "100", "50", "50", "", ""]
    assert {row["share"] for row in rows[-2:]} == {""}
