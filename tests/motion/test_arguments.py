"""Tests of arguments in unusual forms: accepted if the meaning is clear, else refused by name with a way out."""

import numpy as np
import pytest

from rigid_motion.motion import (
    Poses,
    Skeleton,
    decimate,
    fit_keys,
    in_betweens,
    interpolate,
    measure,
    prepare,
    reduce_keys,
    reduce_skeleton_keys,
    repair,
    rms,
    shell_error,
    standing,
)
from tests.motion.cases import random_quaternions

COUNT = 12
TIMES = np.arange(COUNT) / 10.0
POSES = Poses(
    np.random.default_rng(0).normal(size=(COUNT, 3)).cumsum(axis=0), random_quaternions(np.random.default_rng(1), COUNT)
)
BODY = Poses(np.stack((POSES.positions,) * 2), np.stack((POSES.quaternions,) * 2))
GROWING = Poses(BODY.positions, BODY.quaternions, np.tile(1.0 + TIMES, (2, 1)))
KEYS = [0, 4, 11]
MASK = np.isin(np.arange(COUNT), KEYS)


@pytest.mark.parametrize(
    "keys",
    [tuple(KEYS), KEYS, np.array(KEYS, dtype=np.uint8), np.array(KEYS, dtype=np.uint64), MASK, MASK.tolist()],
    ids=["tuple", "list", "uint8", "uint64", "mask", "list of bool"],
)
def test_keys_are_samples_in_any_form_that_has_one_meaning(keys):
    expected = fit_keys(TIMES, POSES, np.array(KEYS))
    np.testing.assert_array_equal(fit_keys(TIMES, POSES, keys).positions, expected.positions)


ROWS = np.concatenate((POSES.positions, POSES.quaternions), axis=1)


@pytest.mark.parametrize(
    ("use", "name"),
    [
        (lambda given: interpolate(TIMES, given, TIMES), "keys"),
        (lambda given: in_betweens(TIMES, given, [1] * 11, [0.5] * 11), "keys"),
        (lambda given: prepare(TIMES, given), "keys"),
        (lambda given: fit_keys(TIMES, given, KEYS), "poses"),
        (lambda given: measure(TIMES, given, POSES), "poses"),
        (lambda given: measure(TIMES, POSES, given), "the true poses"),
        (lambda given: shell_error(given, POSES), "poses"),
        (lambda given: reduce_keys(TIMES, given, tolerance=0.1), "poses"),
        (lambda given: reduce_skeleton_keys(TIMES, given, [-1, 0], tolerance=0.1), "poses"),
        (lambda given: repair(TIMES, given), "poses"),
        (lambda given: Skeleton([-1, 0]).in_root_space(given), "poses"),
    ],
)
@pytest.mark.parametrize(
    "given", [ROWS, ROWS.tolist(), (POSES.positions, POSES.quaternions)], ids=lambda g: str(type(g))
)
def test_what_is_no_poses_is_refused_by_name(use, name, given):
    with pytest.raises(TypeError, match=rf"^{name} need to be Poses, not \w+: Poses\(positions, quaternions\)$"):
        use(given)


def reduced(**options):
    return reduce_keys(TIMES, POSES, **{"tolerance": 0.1, **options})


def body_reduced(poses=BODY, **options):
    return reduce_skeleton_keys(TIMES, poses, [-1, 0], **{"tolerance": 0.1, **options})


STRAIGHT = {"mode": "lerp_slerp"}
BROKEN = POSES.copy()
BROKEN.positions[7] = np.nan


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda: interpolate(TIMES, POSES, 0.5), r"of a single one make a list, \[time\]"),
        (lambda: interpolate(TIMES, POSES, [1.0, np.nan, 0.0]), "times"),
        (lambda: interpolate(TIMES, POSES, TIMES, "slerp"), "no mode 'slerp'; the modes are lerp_slerp, "),
        (lambda: in_betweens([0.0], POSES[:1], [], []), "at least two keys"),
        (lambda: in_betweens([0.0, 1.0], POSES[:2], [1.0], [0.5]), "whole numbers from 0 on"),
        (lambda: decimate([], 5.0), "no times"),
        (lambda: decimate([0.0, np.nan, 1.0], 5.0), "sample 1 has a time that is not finite"),
        (lambda: decimate(TIMES, 0.0), "rate"),
        (lambda: fit_keys(TIMES, POSES, [0.0, 4.0, 11.0]), r"keys are floats, .* np.searchsorted\(times, keys\)"),
        (lambda: fit_keys(TIMES, POSES, MASK[:-1]), "keys are a mask of 11 samples, and the recording has 12"),
        (lambda: fit_keys(TIMES, POSES, []), "0 keys are too few"),
        (lambda: fit_keys(TIMES, POSES, [0, 12]), "key 1 is sample 12, and the samples are those from 0 to 11"),
        (lambda: fit_keys(TIMES, POSES, [0, 7, 7, 11]), r"key 2 is sample 7, after sample 7; np.unique\(keys\)"),
        (lambda: fit_keys(TIMES, POSES, [[0, 11]]), r"keys have the shape \(1, 2\)"),
        (lambda: fit_keys(TIMES, POSES, ([0], [0, 11])), "keys are rows of different lengths"),
        (lambda: fit_keys(TIMES, POSES, ["a", "b"]), "keys have the type .* give rising numbers of samples"),
        (lambda: fit_keys(TIMES, POSES, None), r"keys have the shape \(\)"),
        (lambda: fit_keys(TIMES, POSES, KEYS, radius=0.0), "radius of 0.0"),
        (lambda: fit_keys(TIMES, BROKEN, KEYS), "sample 7 is not finite"),
        (lambda: measure(TIMES, POSES[:5], POSES), r"shape \(5,\) do not fit true ones of shape \(12,\)"),
        (lambda: measure(TIMES[:5], POSES, POSES), r"times of shape \(5,\) do not fit"),
        (lambda: measure(TIMES, POSES, POSES, radius=-1.0), "a radius of -1.0 .* give 0, or a number from 1e-40"),
        (lambda: reduced(tolerance=None), "needs a tolerance or a budget of keys: give one of the two"),
        (lambda: reduced(budget=3), "give one of the two, not both"),
        (lambda: reduced(tolerance=np.nan), "a tolerance of nan is not a positive number from 1e-40 to"),
        (lambda: reduced(tolerance=None, budget=1), "a budget of 1 keys is too small"),
        (lambda: reduced(tries=-1), "tries is -1: give 0"),
        (lambda: reduce_keys(TIMES, BODY, tolerance=0.1), "one object has a row of each"),
        (lambda: body_reduced(tolerance=None, budget=3), "a budget of 3 keys is too small for 2 joints"),
        (lambda: body_reduced(radius=[0.1, -0.1]), "joint 1 has a radius of -0.1: give 0, or a number from 1e-40"),
        (lambda: body_reduced(radius=[0.1] * 3), r"radius of shape \(3,\)"),
        (lambda: body_reduced(weights=[1.0, np.nan]), "joint 1 has a weight of nan"),
        (lambda: body_reduced(weights=[0.0, 0.0]), "every joint has a weight of 0"),
        (lambda: body_reduced(fixed=[0, 1]), "for each of 2 joints: np.isin"),
        (lambda: reduce_skeleton_keys(TIMES[:9], BODY, [-1, 0], tolerance=0.1), "do not fit 2 joints and 9 times"),
        (lambda: body_reduced(separate=True, mode="dq_sclerp"), "do not depend on one another, lerp_slerp, and"),
        (lambda: body_reduced(separate=True, shared=True, **STRAIGHT), "shared=True and separate=True, not both"),
        (lambda: body_reduced(stretch=5), "motor_spline is smooth, .* take one of lerp_slerp"),
        (lambda: body_reduced(stretch=5, shared=True, **STRAIGHT), "leave out shared and budget"),
        (lambda: body_reduced(stretch=1, **STRAIGHT), "a stretch of 1 samples is too short: give 2 or more"),
        (lambda: body_reduced(separate=True, poses=GROWING, **STRAIGHT), "the scale of joint [01] changes"),
        (lambda: interpolate(TIMES, Poses(ROWS[:, :3], 0.0 * ROWS[:, 3:]), TIMES), "key 0 has a quaternion of"),
        (lambda: interpolate(TIMES, Poses(ROWS[:, :3], ROWS[:, 3:], -np.ones(12)), TIMES), "key 0 has a scale"),
        (lambda: repair(TIMES[:5], POSES), r"times of shape \(5,\) do not fit"),
        (lambda: standing(TIMES, POSES.positions), r"need the shape \(joints, 12, 3\)"),
        (lambda: Skeleton([-1]).in_root_space(BODY), "do not fit 1 joints, which come first"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(use, message):
    with pytest.raises(ValueError, match=message):
        use()


@pytest.mark.parametrize(
    ("use", "message"),
    [
        *((lambda given=given: reduced(tolerance=given), "a tolerance of .* not a number") for given in ("5mm", True)),
        *((lambda given=given: reduced(radius=given), "a radius of .* not a number") for given in ("0.1", None)),
        *(
            (lambda given=given: reduced(tolerance=None, budget=given), "budget is .*: give a whole")
            for given in (1.5, "3", True, [3])
        ),
        (lambda: body_reduced(tries=1.0), "tries is 1.0: give a whole number"),
        (lambda: body_reduced(stretch=2.5, **STRAIGHT), "stretch is 2.5: give a whole number"),
        *((lambda given=given: reduced(mode=given), "mode is .*: give the name of one") for given in (None, 7, ["x"])),
        *((lambda given=given: reduced(rms=given), "rms is .*: give True or False") for given in (1, "yes", None)),
        (lambda: body_reduced(shared=1), "shared is .*: give True or False"),
        (lambda: interpolate(TIMES, POSES, TIMES, extrapolate=1), "extrapolate is .*: give True or False"),
        (lambda: decimate(TIMES, "20/s"), "a rate of .* is not a number"),
    ],
)
def test_what_has_the_wrong_type_is_refused_by_name(use, message):
    with pytest.raises(TypeError, match=message):
        use()


WITH_NUMBERS = [
    ("times", lambda rows: decimate(rows, 5.0)),
    ("times", lambda rows: interpolate(TIMES, POSES, rows)),
    ("times", lambda rows: reduce_skeleton_keys(rows, BODY, [-1, 0], tolerance=0.1)),
    ("times", lambda rows: repair(rows, POSES)),
    ("times", lambda rows: fit_keys(rows, POSES, KEYS)),
    ("times", lambda rows: measure(rows, POSES, POSES)),
    ("times", lambda rows: standing(rows, POSES.positions[None])),
    ("positions", lambda rows: standing(TIMES, rows)),
    ("key times", lambda rows: interpolate(rows, POSES, TIMES)),
    ("key times", lambda rows: prepare(rows, POSES)),
    ("progress", lambda rows: in_betweens([0.0, 1.0], POSES[:2], [12], rows)),
    ("positions", lambda rows: Poses(rows, POSES.quaternions)),
    ("quaternions", lambda rows: Poses(POSES.positions, rows)),
    ("scales", lambda rows: Poses(POSES.positions, POSES.quaternions, rows)),
    ("errors", rms),
    ("radii", lambda rows: measure(TIMES, POSES, POSES, rows)),
    ("weights", lambda rows: body_reduced(weights=rows)),
]


@pytest.mark.parametrize(("name", "use"), WITH_NUMBERS)
def test_rows_of_what_is_no_number_are_named(name, use):
    for rows in (["0.5"] * 12, [object()] * 12, np.full(12, 1j)):
        with pytest.raises(TypeError, match=rf"^{name} need to be numbers, not .*: give floats"):
            use(rows)
    with pytest.raises(ValueError, match=rf"^{name}: rows of different lengths"):
        use([[0.0], [0.0, 1.0]])
