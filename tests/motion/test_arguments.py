"""What callers give in the wrong form: taken where it has one meaning, else refused by name, with a way out."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import (
    Poses,
    Skeleton,
    best_modes,
    decimate,
    fit_keys,
    in_betweens,
    interpolate,
    interpolate_by_segments,
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
KEYS = [0, 4, 11]
MASK = np.isin(np.arange(COUNT), KEYS)

TAKING_KEYS = pytest.mark.parametrize(
    "use",
    [lambda keys: best_modes(TIMES, POSES, keys), lambda keys: fit_keys(TIMES, POSES, keys).positions.tolist()],
    ids=["best_modes", "fit_keys"],
)


@TAKING_KEYS
@pytest.mark.parametrize(
    "keys",
    [tuple(KEYS), KEYS, np.array(KEYS, dtype=np.uint8), np.array(KEYS, dtype=np.uint64), MASK, MASK.tolist()],
    ids=["tuple", "list", "uint8", "uint64", "mask", "list of bool"],
)
def test_keys_are_samples_in_any_form_that_has_one_meaning(use, keys):
    assert use(keys) == use(np.array(KEYS))


@TAKING_KEYS
@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ([0.0, 4.0, 11.0], r"keys are floats, .* np.searchsorted\(times, keys\)"),
        (MASK[:-1], "keys are a mask of 11 samples, and the recording has 12"),
        (~(MASK | ~MASK), "0 keys are too few"),
        ([], "0 keys are too few"),
        ([3], "1 keys are too few"),
        ([0, 12], "key 1 is sample 12, and the samples are those from 0 to 11"),
        ([-12, -1], "key 0 is sample -12"),
        ([0, 7, 7, 11], r"not rising: key 2 is sample 7, after sample 7; np.unique\(keys\)"),
        ([11, 0], "not rising: key 1 is sample 0, after sample 11"),
        ([[0, 11]], r"keys have the shape \(1, 2\)"),
        (([0], [0, 11]), "keys are rows of different lengths"),
        ("ab", r"keys have the shape \(\)"),
        (["a", "b"], "keys have the type .* give rising numbers of samples"),
        (slice(0, 12), r"keys have the shape \(\)"),
        (None, r"keys have the shape \(\)"),
    ],
)
def test_keys_that_could_mean_something_else_are_refused_with_a_way_out(use, keys, message):
    with pytest.raises(ValueError, match=message):
        use(keys)


ROWS = np.concatenate((POSES.positions, POSES.quaternions), axis=1)


@pytest.mark.parametrize(
    ("use", "name"),
    [
        (lambda given: interpolate(TIMES, given, TIMES), "keys"),
        (lambda given: in_betweens(TIMES, given, [1] * 11, [0.5] * 11), "keys"),
        (lambda given: prepare(TIMES, given), "keys"),
        (lambda given: interpolate_by_segments(TIMES, given, TIMES, ["dq_sclerp"] * 11), "keys"),
        (lambda given: best_modes(TIMES, given, KEYS), "poses"),
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


@pytest.mark.parametrize(
    "use",
    [
        lambda times: best_modes(times, POSES, KEYS),
        lambda times: interpolate_by_segments(times, POSES, times, ["dq_sclerp"] * 11).positions.tolist(),
        lambda times: decimate(times, 5.0).tolist(),
        lambda times: fit_keys(times, POSES, KEYS).positions.tolist(),
        lambda times: measure(times, POSES, POSES).velocity.tolist(),
        lambda times: reduce_keys(times, POSES, tolerance=0.5).tolist(),
        lambda times: repair(times, POSES)[0].tolist(),
        lambda times: standing(times, POSES.positions[None].tolist()).tolist(),
    ],
    ids=["best_modes", "by_segments", "decimate", "fit_keys", "measure", "reduce_keys", "repair", "standing"],
)
def test_times_may_be_a_list(use):
    assert use(TIMES.tolist()) == use(TIMES)


@pytest.mark.parametrize(
    ("use", "message"),
    [
        (lambda: interpolate(TIMES, POSES, 0.5), r"of a single one make a list, \[time\]"),
        (lambda: in_betweens([0.0], POSES[:1], [], []), "at least two keys"),
        (lambda: in_betweens([0.0, 1.0], POSES[:2], [1.0], [0.5]), "whole numbers from 0 on"),
        (lambda: in_betweens([0.0, 1.0, 2.0], POSES[:3], [2, -1], [0.5]), "whole numbers from 0 on"),
        (lambda: interpolate_by_segments(TIMES, POSES, TIMES, "dq_sclerp"), "'dq_sclerp' is a single mode"),
        (lambda: interpolate_by_segments([0.0], POSES[:1], TIMES, []), "at least two key times"),
        (
            lambda: interpolate_by_segments(TIMES, BODY, TIMES, ["dq_sclerp"] * 11),
            r"do not fit keys of shape \(2, 12\)",
        ),
        (lambda: best_modes(TIMES, POSES, KEYS, "dq_sclerp"), r"make a list, \['dq_sclerp'\]"),
        (lambda: best_modes(TIMES, POSES, KEYS, radius=-0.1), "a radius of -0.1"),
        (lambda: best_modes(TIMES[:-1], POSES, KEYS), "11 times do not fit"),
        (lambda: decimate([], 5.0), "no times"),
        (lambda: decimate([0.0, 2.0, 1.0], 5.0), "sample 2 is not later"),
        (lambda: decimate([0.0, np.nan, 1.0], 5.0), "sample 1 has a time that is not finite"),
        (lambda: measure(TIMES, POSES[:5], POSES), r"shape \(5,\) do not fit true ones of shape \(12,\)"),
        (lambda: measure(TIMES[:5], POSES, POSES), r"times of shape \(5,\) do not fit"),
        (lambda: measure(TIMES, POSES, POSES, radius=-1.0), "a radius of -1.0"),
        (lambda: measure(TIMES, BODY, BODY, radius=[[0.1], [-1.0]]), "a radius of -1.0"),
        (lambda: shell_error(POSES[:5], POSES), "do not fit true ones"),
        (lambda: reduce_keys(TIMES, POSES), "needs a tolerance or a budget of keys: give one of the two"),
        (lambda: reduce_keys(TIMES, POSES, tolerance=0.1, budget=3), "give one of the two, not both"),
        (lambda: reduce_keys(TIMES, BODY, tolerance=0.1), "one object has a row of each"),
        (
            lambda: reduce_skeleton_keys(TIMES, BODY, [-1, 0], tolerance=0.1, fixed=[0, 1]),
            "for each of 2 joints: np.isin",
        ),
        (lambda: reduce_skeleton_keys(TIMES, BODY, [-1, 0], tolerance=0.1, fixed=[True] * 3), "for each of 2 joints"),
        (lambda: repair(TIMES[:5], POSES), r"times of shape \(5,\) do not fit"),
        (lambda: standing(TIMES, POSES.positions), r"need the shape \(joints, 12, 3\)"),
        (lambda: Skeleton([-1]).in_root_space(BODY), "do not fit 1 joints, which come first"),
    ],
)
def test_what_makes_no_sense_is_refused_in_words(use, message):
    with pytest.raises(ValueError, match=message):
        use()


def test_a_body_may_have_a_radius_for_each_joint():
    shown = BODY[:, ::-1]
    of_joints = [measure(TIMES, shown[joint], BODY[joint], radius).shell for joint, radius in enumerate((0.1, 0.4))]
    assert measure(TIMES, shown, BODY, radius=[[0.1], [0.4]]).shell.tolist() == np.stack(of_joints).tolist()


def reduce_body(**options):
    return reduce_skeleton_keys(TIMES, BODY, [-1, 0], **options)


WITH_A_TOLERANCE = {
    "reduce_keys": lambda tolerance: reduce_keys(TIMES, POSES, tolerance=tolerance),
    "reduce_skeleton_keys": lambda tolerance: reduce_body(tolerance=tolerance),
    "best_modes": lambda tolerance: best_modes(TIMES, POSES, KEYS, tolerance=tolerance),
}
WITH_A_RADIUS = {
    "reduce_keys": lambda radius: reduce_keys(TIMES, POSES, tolerance=0.1, radius=radius),
    "best_modes": lambda radius: best_modes(TIMES, POSES, KEYS, radius=radius),
    "fit_keys": lambda radius: fit_keys(TIMES, POSES, KEYS, radius=radius),
    "measure": lambda radius: measure(TIMES, POSES, POSES, radius=radius),
}
WITH_LENGTHS = {
    "radius": lambda lengths: reduce_body(tolerance=0.1, radius=lengths),
    "weight": lambda lengths: reduce_body(tolerance=0.1, weights=lengths),
}
WITH_COUNTS = {
    "budget": lambda count: reduce_keys(TIMES, POSES, budget=count),
    "tries": lambda count: reduce_keys(TIMES, POSES, tolerance=0.1, tries=count),
    "budget of a body": lambda count: reduce_body(budget=count),
    "tries of a body": lambda count: reduce_body(tolerance=0.1, tries=count),
}
WITH_A_MODE = {
    "reduce_keys": lambda mode: reduce_keys(TIMES, POSES, mode, tolerance=0.1),
    "reduce_skeleton_keys": lambda mode: reduce_body(tolerance=0.1, mode=mode),
    "fit_keys": lambda mode: fit_keys(TIMES, POSES, KEYS, mode),
    "interpolate": lambda mode: interpolate(TIMES, POSES, TIMES, mode),
    "in_betweens": lambda mode: in_betweens([0.0, 1.0], POSES[:2], [1], [0.5], mode),
    "prepare": lambda mode: prepare(TIMES, POSES, mode),
    "best_modes": lambda mode: best_modes(TIMES, POSES, KEYS, [mode]),
    "interpolate_by_segments": lambda mode: interpolate_by_segments(TIMES, POSES, TIMES, [mode] * 11),
}
WITH_A_FLAG = {
    "rms": lambda flag: reduce_keys(TIMES, POSES, tolerance=0.1, rms=flag),
    "shared": lambda flag: reduce_body(tolerance=0.1, shared=flag),
    "extrapolate": lambda flag: interpolate(TIMES, POSES, TIMES, extrapolate=flag),
}
WITH_NUMBERS = {
    "times": [
        lambda rows: best_modes(rows, POSES, KEYS),
        lambda rows: decimate(rows, 5.0),
        lambda rows: fit_keys(rows, POSES, KEYS),
        lambda rows: interpolate(TIMES, POSES, rows),
        lambda rows: interpolate_by_segments(TIMES, POSES, rows, ["dq_sclerp"] * 11),
        lambda rows: measure(rows, POSES, POSES),
        lambda rows: reduce_keys(rows, POSES, tolerance=0.1),
        lambda rows: reduce_skeleton_keys(rows, BODY, [-1, 0], tolerance=0.1),
        lambda rows: repair(rows, POSES),
        lambda rows: standing(rows, BODY.positions),
    ],
    "key times": [
        lambda rows: interpolate(rows, POSES, TIMES),
        lambda rows: interpolate_by_segments(rows, POSES, TIMES, ["dq_sclerp"] * 11),
        lambda rows: prepare(rows, POSES),
        lambda rows: in_betweens(rows, POSES, [1] * 11, [0.5] * 11),
    ],
    "progress": [lambda rows: in_betweens([0.0, 1.0], POSES[:2], [12], rows)],
    "positions": [lambda rows: Poses(rows, POSES.quaternions), lambda rows: standing(TIMES, rows)],
    "quaternions": [lambda rows: Poses(POSES.positions, rows)],
    "scales": [lambda rows: Poses(POSES.positions, POSES.quaternions, rows)],
    "errors": [rms],
    "radii": [lambda rows: measure(TIMES, POSES, POSES, rows), lambda rows: shell_error(POSES, POSES, rows)],
    "weights": [lambda rows: reduce_body(tolerance=0.1, weights=rows)],
}


def rows_of(table):
    return [pytest.param(use, id=name) for name, use in table.items()]


@pytest.mark.parametrize("tolerance", ["0.005", "5mm", True, [0.1], (0.1,), 1j, b"1", np.array([0.1])], ids=repr)
@pytest.mark.parametrize("use", rows_of(WITH_A_TOLERANCE))
def test_a_tolerance_of_the_wrong_type_is_named(use, tolerance):
    with pytest.raises(TypeError, match=r"^a tolerance of .* is not a number: give a single one, without quotes"):
        use(tolerance)


@pytest.mark.parametrize("tolerance", [0.0, -0.1, 1e-170, 1e160, np.nan, np.inf, 10**200], ids=repr)
@pytest.mark.parametrize("use", rows_of(WITH_A_TOLERANCE))
def test_a_tolerance_that_is_no_length_is_named(use, tolerance):
    with pytest.raises(ValueError, match=r"^a tolerance of .* is not a positive number from 1e-40 to 1e\+40$"):
        use(tolerance)


@pytest.mark.parametrize("radius", ["0.1", True, None, 1j], ids=repr)
@pytest.mark.parametrize("use", rows_of(WITH_A_RADIUS))
def test_a_radius_of_the_wrong_type_is_named(use, radius):
    with pytest.raises(TypeError, match=r"^a radius of .* is not a number: give a single one"):
        use(radius)


@pytest.mark.parametrize("radius", [-0.1, 1e-170, 1e160, np.nan, np.inf], ids=repr)
@pytest.mark.parametrize("use", rows_of(WITH_A_RADIUS))
def test_a_radius_that_is_no_length_is_named(use, radius):
    with pytest.raises(ValueError, match=r"^a radius of .* give 0, or a number from 1e-40 to 1e\+40$"):
        use(radius)


@pytest.mark.parametrize("length", [-0.1, 1e-170, 1e160, np.nan])
@pytest.mark.parametrize("name", WITH_LENGTHS)
def test_a_radius_or_weight_of_a_joint_is_named(name, length):
    for given, joint in ((length, 0), ([1.0, length], 1)):
        with pytest.raises(ValueError, match=rf"^joint {joint} has a {name} of .*: give 0, or a number from 1e-40 to"):
            WITH_LENGTHS[name](given)


@pytest.mark.parametrize("count", [1.5, 3.0, "3", True, [3], np.float64(3.0)], ids=repr)
@pytest.mark.parametrize("name", WITH_COUNTS)
def test_a_count_that_is_no_whole_number_is_named(name, count):
    with pytest.raises(TypeError, match=rf"^{name.split()[0]} is .*: give a whole number"):
        WITH_COUNTS[name](count)


@pytest.mark.parametrize("use", rows_of(WITH_COUNTS))
def test_a_count_below_zero_is_named(use):
    with pytest.raises(ValueError, match=r"^a budget of -1 keys is too small|^tries is -1: give 0"):
        use(-1)


@pytest.mark.parametrize("mode", [["dq_sclerp"], None, 7, {"dq_sclerp": 1}], ids=repr)
@pytest.mark.parametrize("use", rows_of(WITH_A_MODE))
def test_a_mode_that_is_no_name_is_refused(use, mode):
    with pytest.raises(TypeError, match=r"^mode is .*: give the name of one, such as 'dq_sclerp'"):
        use(mode)


@pytest.mark.parametrize(
    "use", [lambda: best_modes(TIMES, POSES, KEYS, 7), lambda: interpolate_by_segments(TIMES, POSES, TIMES, 7)]
)
def test_modes_that_are_no_list_are_refused(use):
    with pytest.raises(TypeError, match=r"^modes .*7: give a list of names"):
        use()


@pytest.mark.parametrize("flag", [1, "yes", None, [True]], ids=repr)
@pytest.mark.parametrize("name", WITH_A_FLAG)
def test_a_flag_is_true_or_false(name, flag):
    with pytest.raises(TypeError, match=rf"^{name} is .*: give True or False"):
        WITH_A_FLAG[name](flag)


@pytest.mark.parametrize("rate", ["20/s", True, None], ids=repr)
def test_a_rate_of_the_wrong_type_is_named(rate):
    with pytest.raises(TypeError, match=r"^a rate of .* is not a number"):
        decimate(TIMES, rate)


@pytest.mark.parametrize(
    ("name", "use"),
    [pytest.param(name, use, id=f"{name} {n}") for name, uses in WITH_NUMBERS.items() for n, use in enumerate(uses)],
)
def test_rows_of_what_is_no_number_are_named(name, use):
    for rows in (["0.5"] * 12, [object()] * 12, np.full(12, 1j)):
        with pytest.raises(TypeError, match=rf"^{name} need to be numbers, not .*: give floats"):
            use(rows)
    with pytest.raises(ValueError, match=rf"^{name}: rows of different lengths"):
        use([[0.0], [0.0, 1.0]])
