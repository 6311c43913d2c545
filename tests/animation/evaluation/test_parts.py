"""Location, rotation and scale with keys of their own: each segment goes by the channels of all that have it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.evaluation.components import LOCATION, MODE_NUMBERS, PART_OF, ROTATION, SCALE
from rigid_motion.animation.evaluation.sources import Source
from rigid_motion.animation.fcurves.keys import BEZIER
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import in_turn
from tests.animation.evaluation.by_frame import Track, channels, inside, source_of, tracks_of, value
from tests.animation.evaluation.test_channel_differences import ORDERS, rotations
from tests.animation.keyed import curves_of, rotation_path
from tests.animation.oracle import assert_shown
from tests.animation.scenes import new_object, random_values, write_channel

FRAMES = (1.0, 11.0, 24.0, 40.0, 52.0, 60.0, 75.0)
INSERTED = 32.0


def tracks(order: str | None, seed: int) -> dict[int, Track]:
    random = np.random.default_rng(seed)
    sizes = np.tile(np.exp(0.3 * random.normal(size=len(FRAMES))), (3, 1))
    return (
        tracks_of(LOCATION, FRAMES, random.normal(size=(3, len(FRAMES))))
        | tracks_of(ROTATION, FRAMES, rotations(order, len(FRAMES), seed))
        | tracks_of(SCALE, FRAMES, sizes)
    )


def shaped(keyed: dict[int, Track], order: str | None, mode: str, seed: int) -> Source:
    """A source with handles of its own, and breakdowns on the second key and the last but one."""
    source, slopes = source_of(keyed, order, mode=MODE_NUMBERS[mode]), np.random.default_rng(seed).normal(size=7)
    shaped = []
    for rows, keys in source.channels:
        arms = np.stack((np.full(keys.times.shape, 1.5), 0.05 * np.interp(keys.times, FRAMES, slopes)), axis=1)
        handles = {"left": keys.points - np.float32(arms), "right": keys.points + np.float32(arms)}
        codes = np.full_like(keys.interpolation, BEZIER)
        breakdowns = np.isin(keys.times, (FRAMES[1], FRAMES[-2]))
        shaped.append((rows, replace(keys, interpolation=codes, breakdowns=breakdowns, **handles)))
    return replace(source, channels=tuple(shaped))


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ORDERS))
@pytest.mark.parametrize("part", [LOCATION, ROTATION, SCALE])
def test_a_key_in_one_part_changes_nothing_outside_of_its_segment(part, mode, order):
    """Smooth modes look at the keys beside a segment: there its neighbours change, too."""
    keyed = tracks(order, 5)
    more = {
        row: sorted([*track, (INSERTED, 1.3 if part == SCALE else value(track, INSERTED) + 0.1)])
        for row, track in keyed.items()
        if PART_OF[row] == part
    }
    even, uneven = (shaped(of_source, order, mode, 3) for of_source in (keyed, keyed | more))
    assert uneven.is_uneven
    assert not even.is_uneven
    frames = inside(even, 9)
    first, last = (11.0, 52.0) if KEYFRAME_MODES[mode].is_smooth else (24.0, 40.0)
    # Where a breakdown passes a key the segment of its path is one.
    first, last = (1.0, 60.0) if mode == "motor_spline" else (first, last)
    outside = frames[(frames < first) | (frames > last)]
    np.testing.assert_allclose(channels(uneven, outside), channels(even, outside), atol=1e-12)
    changed = channels(uneven, frames) - channels(even, frames)
    assert np.abs(changed).max() > 1e-3


@pytest.mark.parametrize(("mode", "order"), in_turn(KEYFRAME_MODES, ("QUATERNION", "XYZ", "AXIS_ANGLE")))
@pytest.mark.parametrize("seed", range(2))
def test_parts_with_some_keys_of_their_own_move_as_the_rule_says(live_file, mode, order, seed):
    random, obj = np.random.default_rng(seed), new_object("Tool", order)
    for path in ("location", rotation_path(obj), "scale"):
        some = np.array([frame for frame in FRAMES if random.random() < 0.75])
        values = random_values(obj, path, len(some), seed, True)
        write_channel(obj, path, some, values, interpolation=("BEZIER", "SINE")[seed])
    on = random.choice(FRAMES[1:-1], 2)
    for fcurve in curves_of(obj).values():
        for point in fcurve.keyframe_points:
            point.type = "BREAKDOWN" if seed and point.co.x in on else "KEYFRAME"
    set_mode(obj, mode)
    assert_shown([obj], np.arange(0.0, 77.0, 2.25))


@pytest.mark.parametrize(("mode", "order"), in_turn(("dq_sclerp", "motor_spline"), ("QUATERNION", "XYZ", "AXIS_ANGLE")))
@pytest.mark.parametrize("extrapolation", ["CONSTANT", "LINEAR"])
def test_so_do_parts_with_muted_channels_and_keys_behind_those_of_others(live_file, mode, order, extrapolation):
    random, obj = np.random.default_rng(len(mode) + len(order)), new_object("Tool", order)
    for path, last in (("location", 60.0), (rotation_path(obj), 75.0), ("scale", 75.0)):
        some = np.array([frame for frame in FRAMES if frame <= last and random.random() < 0.8])
        write_channel(obj, path, some, random_values(obj, path, len(some), 3, True))
    curves = list(curves_of(obj).values())
    curves[random.integers(len(curves))].mute = True
    for fcurve in curves:
        fcurve.extrapolation = extrapolation
    set_mode(obj, mode)
    assert_shown([obj], np.arange(1.0, 80.0, 2.25))
