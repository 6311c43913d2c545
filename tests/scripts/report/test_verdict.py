"""Tests of the verdict: one true sentence with a number, for any outcome of a run."""

from collections.abc import Mapping, Sequence

import numpy as np
import pytest

from rigid_motion_batch.analysis.choices import Budget, Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.needed import RATES, KeysNeeded
from rigid_motion_batch.report.numbers import ERROR_AT, KEYS_AT, MEASURES, Numbers
from rigid_motion_batch.report.verdict import verdict

FIVE, TEN, TWENTY = map(Uniform, ("5", "10", "20"))


def numbers(choices: Sequence[Choice], *clips: Mapping[str, Sequence[float]]) -> Numbers:
    """Return a run with these clips' errors in mm (or keys per second within a tolerance), under each choice."""
    modes = tuple(clips[0])
    values = np.full((len(MEASURES), len(clips), len(choices), len(modes)), np.nan)
    for place, clip in enumerate(clips):
        for column, mode in enumerate(modes):
            for row, choice in enumerate(choices):
                values[KEYS_AT if isinstance(choice, Tolerance) else ERROR_AT, place, row, column] = clip[mode][row]
    groups = tuple((mode,) for mode in modes)
    names = tuple(f"clip{number}" for number in range(1, len(clips) + 1))
    return Numbers(names, tuple(choices), modes, values, (frozenset({groups}),) * len(clips))


def keys_needed(keys: Mapping[str, Sequence[float]], *, fitted: bool = False) -> KeysNeeded:
    """Return a clip of 10 s whose modes need these keys to match the reference with 201, one number per spacing."""
    groups = tuple((mode,) for mode in keys)
    ways = 3 if fitted else 2
    result = np.stack([np.repeat(np.array(keys[group[0]], float)[:, None], len(RATES), axis=1) for group in groups])
    assert result.shape[1] == ways
    asked = np.array([float(rate) for rate in RATES])
    return KeysNeeded(
        "clip1", groups, RATES, np.full(len(RATES), 10.0), 10.0 * asked + 1.0, np.full(len(RATES), 1e-3), result,
        np.full(result.shape, 1e-3), np.full((len(groups), len(RATES)), 1e-3),
    )  # fmt: skip


REF, SCREW, SMOOTH = "bezier", "dq_sclerp", "motor_spline"

CASES = {
    "fewer keys, between the rates of the run": (
        numbers((FIVE, TEN, TWENTY), {REF: (16, 4, 1), SMOOTH: (4, 1, 0.25)}),
        "10 keys a second of Smooth Screw are as good as 20 of Blender's Curves: 50 % fewer for the same error.",
        TEN,
    ),
    "better at the lowest rate than the reference at the highest": (
        numbers((FIVE, TEN), {REF: (16, 4), SMOOTH: (3, 1)}),
        "At most 5 keys a second of Smooth Screw are as good as 10 of Blender's Curves: "
        "at least 50 % fewer for the same error.",
        FIVE,
    ),
    "an error that does not fall with the rate": (
        numbers((FIVE, TEN), {REF: (8, 9), SMOOTH: (4, 6)}),
        "Smooth Screw has 50 % less error than Blender's Curves with the same 5 keys a second.",
        FIVE,
    ),
    "one rate": (
        numbers((TEN,), {REF: (4,), SCREW: (5,), SMOOTH: (1,)}),
        "Smooth Screw has 75 % less error than Blender's Curves with the same 10 keys a second.",
    ),
    "the reference is the best": (
        numbers((FIVE, TEN), {REF: (4, 1), SCREW: (5, 1.25), SMOOTH: (8, 2)}),
        "Nothing comes closer than Blender's Curves: 4.00 mm off (RMS) at 5 keys/s; Screw is next, with 25 % more.",
        FIVE,
    ),
    "a run without the reference": (
        numbers((TEN,), {SCREW: (4,), SMOOTH: (1,), "pga_lerp": (5,)}),
        "Smooth Screw has 75 % less error than Screw with the same 10 keys a second.",
    ),
    "a clip too short for the higher rate": (
        numbers((FIVE, TEN), {REF: (16, 4), SMOOTH: (4, 1)}, {REF: (2, np.nan), SMOOTH: (1, np.nan)}),
        "5 keys a second of Smooth Screw are as good as 10 of Blender's Curves: 50 % fewer for the same error.",
    ),
    "a tolerance": (
        numbers((Tolerance("5mm"),), {REF: (8,), SMOOTH: (6,)}),
        "Within 5 mm, Smooth Screw takes 25 % fewer keys than Blender's Curves: 6 a second to 8.",
        Tolerance("5mm"),
    ),
    "a tolerance, and the reference needs the fewest keys": (
        numbers((Tolerance("5mm"), Tolerance("10mm")), {REF: (6, 4), SMOOTH: (8, 5)}),
        "Nothing needs fewer keys than Blender's Curves: 4.00 keys a second within 10 mm; "
        "Smooth Screw is next, with 25 % more.",
        Tolerance("10mm"),
    ),
    "a draw": (
        numbers((Tolerance("5mm"),), {REF: (6,), SMOOTH: (6,), SCREW: (7,)}),
        "Nothing needs fewer keys than Blender's Curves: 6.00 keys a second within 5 mm; Smooth Screw is as good.",
        Tolerance("5mm"),
    ),
    "a winner at each end": (
        numbers((FIVE, TEN, TWENTY), {REF: (4, 2, 1), SMOOTH: (9, 2, 0.9)}, {REF: (4, 2, 1), SMOOTH: (9, 2, 0.9)}),
        "What is closest depends on the keys: Blender's Curves at 5 keys/s and at 10 keys/s; "
        "Smooth Screw at 20 keys/s (geometric mean over 2 clips).",
        FIVE,
    ),
    "budgets that cross": (
        numbers((Budget("5"), Budget("10")), {REF: (16, 4), SMOOTH: (8, 2)}),
        "7.07 keys a second on average of Smooth Screw are as good as 10 of Blender's Curves: "
        "29 % fewer for the same error.",
    ),
    "somebody else's motion is not a mode that wins": (
        numbers((TEN,), {REF: (4,), SMOOTH: (2,), "mine": (0.1,)}),
        "Smooth Screw has 50 % less error than Blender's Curves with the same 10 keys a second.",
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_the_sentence_says_what_the_numbers_say_and_of_which_keys(case: str) -> None:
    run, expected, *choice = CASES[case]
    said = verdict(run)
    assert said.sentence == expected
    assert [said.choice] == (choice or [said.choice])


TWO = numbers((TEN,), {REF: (4,), SMOOTH: (1,)})


@pytest.mark.parametrize(
    ("needed", "expected"),
    [
        (
            keys_needed({REF: (201, 101), SMOOTH: (151, 51)}),
            "As good as 20 evenly spaced keys a second of Blender's Curves are 5 a second of Smooth Screw, where the "
            "motion needs them, or 10 a second of Blender's Curves.",
        ),
        (
            keys_needed({REF: (201, 101, 91), SMOOTH: (151, 51, 31)}, fitted=True),
            "As good as 20 evenly spaced keys a second of Blender's Curves are 3 a second of Smooth Screw, where "
            "needed, and fitted, or 9 a second of Blender's Curves.",
        ),
        (
            keys_needed({REF: (201, 101), SMOOTH: (251, 151)}),
            "As good as 20 evenly spaced keys a second of Blender's Curves are 10 a second of Blender's Curves, where "
            "the motion needs them.",
        ),
        (
            keys_needed({REF: (201, np.inf), SMOOTH: (np.inf, np.inf)}),
            "Nothing needs fewer keys than Blender's Curves, 20 a second and evenly spaced.",
        ),
    ],
)
def test_the_keys_needed_come_first_where_they_were_looked_for(needed: KeysNeeded, expected: str) -> None:
    assert verdict(TWO, [needed]).sentence == expected


def test_of_keys_needed_it_is_the_nearest_of_the_run_that_are_placed_so() -> None:
    needed = keys_needed({REF: (201, 101), SMOOTH: (151, 51)})
    choices = (FIVE, TWENTY, Budget("4"), Budget("20"))
    run = numbers(choices, {REF: (9, 4, 5, 2), SMOOTH: (4, 2, 3, 1)})
    assert verdict(run, [needed]).choice == Budget("4")
    assert verdict(TWO, [needed]).choice == TEN
    none = keys_needed({REF: (201, np.inf), SMOOTH: (np.inf, np.inf)})
    assert verdict(run, [none]).choice == TWENTY


def test_the_wins_are_those_of_what_it_speaks_of() -> None:
    run = numbers((TEN, Tolerance("5mm"), Tolerance("10mm")), {REF: (1, 8, 6), SMOOTH: (4, 6, 5)})
    assert verdict(run).wins == "Fewest keys in 2 of 2 cases"


def test_the_cases_that_the_best_mode_won_are_beside_the_sentence() -> None:
    run = numbers(
        (FIVE, TEN), {REF: (16, 4), SCREW: (17, 4.1), SMOOTH: (8, 1)}, {REF: (8, 4), SCREW: (8.5, 4.1), SMOOTH: (10, 2)}
    )
    assert verdict(run).wins == "Closest in 3 of 4 cases"
    every = numbers((FIVE, TEN), {REF: (16, 4), SMOOTH: (8, 1)})
    assert verdict(every).wins == "Closest in 2 of 2 cases"
    within = numbers((Tolerance("5mm"),), {REF: (8,), SMOOTH: (6,)}, {REF: (6,), SMOOTH: (5,)})
    assert verdict(within).wins == "Fewest keys in 2 of 2 cases"


def test_of_a_single_case_or_without_any_error_nothing_is_said_of_wins() -> None:
    assert verdict(numbers((TEN,), {REF: (4,), SMOOTH: (2,)})).wins == ""
    nothing = verdict(numbers((TEN,), {REF: (0,), SMOOTH: (0,)}))
    assert (nothing.wins, nothing.choice) == ("", None)
