from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigid_motion_batch.analysis.choices import Budget, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import measure_reconstruction
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import identical_modes
from rigid_motion_batch.analysis.reconstructions import reconstruct as fill_by
from rigid_motion_batch.comparison.report.findings import Summary, findings, summarise
from rigid_motion_batch.comparison.results import Result
from tests.scripts.comparison.recordings import reconstruct, swinging_clip

LABELS = {"lerp_slerp": "Line", "dq_sclerp": "Screw", "pga_slerp": "Motor", "pga_lerp": "Blend", BEST_OF: "Best"}


def summary(errors: object, modes: tuple[str, ...] = ("lerp_slerp", "dq_sclerp"), **fields: object) -> Summary:
    """A run in which the errors, (clips, rates, modes), came out so."""
    errors = np.array(errors, dtype=float)
    return Summary(
        clips=tuple("abcdefgh"[: errors.shape[0]]),
        modes=modes,
        **{
            "choices": tuple(Uniform(rate) for rate in ("5", "10", "20")[: errors.shape[1]]),
            "groups": tuple((mode,) for mode in modes),
            "errors": errors,
            **fields,
        },
    )


def said(run: Summary) -> str:
    return "\n".join(findings(run, LABELS)).replace("\u00a0", " ")


def test_the_modes_that_theory_calls_one_curve_are_found_to_be_one() -> None:
    runs = [reconstruct(swinging_clip(seed=seed), rate) for seed in (1, 2) for rate in ("5", "20")]
    assert identical_modes(runs) == (
        ("lerp_slerp",),
        ("dq_sclerp", "pga_slerp", "cga_slerp"),
        ("pga_lerp", "cga_lerp"),
        ("motor_spline",),
    )


def test_modes_that_part_on_a_single_clip_are_not_called_identical() -> None:
    same = reconstruct(swinging_clip(), "10", ("pga_lerp", "cga_lerp"))
    parted = reconstruct(swinging_clip(), "5", ("pga_lerp", "cga_lerp"))
    parted.poses["cga_lerp"].positions[7] += 1e-4
    assert identical_modes([same]) == (("pga_lerp", "cga_lerp"),)
    assert identical_modes([same, parted]) == (("pga_lerp",), ("cga_lerp",))


def test_the_summary_holds_every_error_at_its_place() -> None:
    runs = [reconstruct(swinging_clip(name, seed=seed), rate) for seed, name in enumerate("ab") for rate in ("20", "5")]
    rows = [row for run in runs for row in measure_reconstruction(run)]
    (run,) = summarise(map(Result.of, runs))
    assert run.clips == ("a", "b")
    assert run.amounts == ("5", "20")
    for row in rows:
        clip, rate = run.clips.index(row.clip), run.amounts.index(row.rate_hz)
        assert run.of(row.mode)[clip, rate] == row.rms_shell_m


def test_the_relative_error_is_the_geometric_mean_of_ratios_to_the_reference() -> None:
    run = summary([[[1.0, 2.0]], [[100.0, 50.0]], [[3.0, 3.0]]])
    np.testing.assert_allclose(run.relative, [[1.0, 1.0]])
    np.testing.assert_allclose(summary([[[1.0, 4.0]], [[10.0, 10.0]]]).relative, [[1.0, 2.0]])


def test_a_clip_that_has_not_every_rate_counts_where_it_has_one() -> None:
    run = summary([[[1.0, 2.0], [1.0, 2.0]], [[np.nan, np.nan], [1.0, 8.0]]])
    np.testing.assert_allclose(run.relative[:, 1], [2.0, 4.0])
    assert "Closest to the recording at 5 keys/s: Line on 1 of 1 clip." in said(run)


def test_without_the_state_of_the_art_the_first_mode_is_the_reference() -> None:
    assert summary([[[1.0, 2.0]]], ("pga_lerp", "dq_sclerp")).reference == "pga_lerp"


def test_who_was_closest_is_counted_over_the_clips() -> None:
    text = said(summary([[[2.0, 1.0]], [[2.0, 1.0]], [[1.0, 2.0]]]))
    assert "Closest to the recording at 5 keys/s: Screw on 2 of 3 clips, Line on 1." in text


@pytest.mark.parametrize(("error", "words"), [(0.9, "10 % lower"), (1.2, "20 % higher"), (1.001, "the same")])
def test_what_is_said_of_a_mode_follows_its_numbers(error: float, words: str) -> None:
    text = said(summary([[[1.0, error]], [[10.0, 10.0 * error]]]))
    assert f"Compared with Line, the error of Screw was {words} at 5 keys/s (geometric mean over 2 clips)." in text


def test_the_extremes_name_their_clip_and_rate() -> None:
    text = said(summary([[[1.0, 1.5], [1.0, 1.0]], [[1.0, 1.0], [1.0, 0.6]]]))
    assert "The largest gain over Line was that of Screw on b at 10 keys/s: an error 40 % lower." in text
    assert "The largest loss to Line was that of Screw on a at 5 keys/s: an error 50 % higher." in text


def test_a_mode_that_never_gains_is_not_said_to() -> None:
    text = said(summary([[[1.0, 1.5]], [[1.0, 1.2]]]))
    assert "gain" not in text
    assert "loss" in text


def test_keys_for_the_same_error_are_read_off_between_the_rates_beside_the_papers() -> None:
    # Errors that fall with the square of the rate, and a mode that is a quarter as far off: half the rate will do.
    text = said(summary([[[16.0, 4.0], [4.0, 1.0], [1.0, 0.25]]]))
    assert "The error of Line at 20 keys/s was reached by Screw at 10 keys/s" in text
    assert "the paper's table has 10 instead of 20" in text


def test_keys_for_the_same_error_are_not_guessed_outside_the_rates_of_the_run() -> None:
    assert "was reached" not in said(summary([[[4.0, 8.0], [1.0, 2.0]]]))


def test_identical_modes_are_said_to_be_and_speak_with_one_voice() -> None:
    modes = ("lerp_slerp", "dq_sclerp", "pga_slerp")
    run = summary([[[1.0, 0.5, 0.5]], [[1.0, 0.5, 0.5]]], modes, groups=(modes[:1], modes[1:]))
    text = said(run)
    assert "Identical in-betweens came from Screw and Motor, on every clip at every rate." in text
    assert text.count("Motor") == 1


def test_where_errors_are_but_rounding_no_winner_is_named() -> None:
    text = said(summary([[[1.0, 0.5], [1e-17, 2e-17]]]))
    assert "At 10 keys/s no mode was off by more than rounding." in text
    assert "Closest to the recording at 5 keys/s: Screw." in text
    assert "at 10" not in text


def test_identical_modes_are_found_in_recordings_of_any_unit() -> None:
    run = reconstruct(replace(swinging_clip(), metres_per_unit=1e-4), "10", ("dq_sclerp", "pga_slerp"))
    in_metres = {mode: replace(errors, shell=errors.shell * 1e-4) for mode, errors in run.errors.items()}
    assert identical_modes([replace(run, errors=in_metres)]) == (("dq_sclerp", "pga_slerp"),)
    run.poses["pga_slerp"].positions[7] += 1e-3
    assert len(identical_modes([replace(run, errors=in_metres)])) == 2


def test_where_a_tolerance_decides_the_number_of_keys_is_compared() -> None:
    choices = (Tolerance("5mm"), Tolerance("2cm"))
    text = said(summary([[[20.0, 10.0], [10.0, 4.0]], [[30.0, 15.0], [6.0, 6.0]]], choices=choices))
    assert "the number of keys of Screw was 50 % lower within 5 mm and 37 % lower within 2 cm (geometric mean" in text
    assert "Fewest keys within 5 mm: Screw on 2 of 2 clips." in text
    assert "The largest gain over Line was that of Screw on a within 2 cm: a number of keys 60 % lower." in text
    assert "error" not in text


def test_with_a_budget_the_rates_are_said_to_be_averages() -> None:
    text = said(summary([[[4.0, 2.0], [2.0, 1.0]]], choices=(Budget("5"), Budget("10"))))
    assert "the error of Screw was 50 % lower at 5 and 50 % lower at 10 keys/s on average." in text
    assert "paper" not in text


def test_choices_of_different_kinds_are_summed_up_apart() -> None:
    clip = swinging_clip(seconds=1.0)
    choices = (Uniform("10"), Tolerance("1cm"), Uniform("5"))
    runs = [fill_by(clip, choice, tuple(LABELS), 0.1) for choice in choices]
    evenly, tolerated = summarise(map(Result.of, runs))
    assert evenly.choices == (Uniform("5"), Uniform("10"))
    assert tolerated.choices == (Tolerance("1cm"),)
    assert tolerated.errors[0, 0].tolist() == [row.keys_per_s for row in measure_reconstruction(runs[1])]


def test_what_choosing_gains_is_told_beside_the_best_single_mode_of_each_clip() -> None:
    modes = ("lerp_slerp", "dq_sclerp", BEST_OF)
    run = summary([[[1.0, 2.0, 0.9], [1.0, 2.0, 1.0]], [[4.0, 2.0, 1.0], [1.0, 2.0, 1.0]]], modes)
    assert (
        "Choosing the best mode of each segment made the error 33 % lower at 5 and the same at 10 keys/s compared with "
        "the best single mode of each clip (geometric mean over 2 clips). It gained most on b at 5 keys/s: 50 % lower "
        "than by Screw."
    ) in said(run)


def test_being_chosen_for_being_closest_is_no_finding() -> None:
    text = said(summary([[[1.0, 2.0, 0.5]], [[1.0, 0.9, 0.4]]], ("lerp_slerp", "dq_sclerp", BEST_OF)))
    assert "Closest to the recording at 5 keys/s: Line on 1 of 2 clips, Screw on 1." in text
    assert "The largest gain over Line was that of Screw on b at 5 keys/s: an error 10 % lower." in text


def test_nothing_is_said_to_be_gained_where_a_tolerance_decides_or_nothing_is_to_be_gained() -> None:
    modes = ("lerp_slerp", "dq_sclerp", BEST_OF)
    assert "Choosing" not in said(summary([[[1.0, 2.0, 0.5]]], modes, choices=(Tolerance("5mm"),)))
    assert "Choosing" not in said(summary([[[0.0, 0.0, 0.0]]], modes))
