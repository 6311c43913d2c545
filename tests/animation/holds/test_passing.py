"""Passing from holder to holder: the prop moves smoothly between the places where both would carry it, by an oracle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from mathutils import Euler

from rigid_motion.animation import hold_in, set_mode, write_channel
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import in_turn
from tests.animation.holds.hands import HOLDERS, PROPS, by_an_object, by_fk, free, pairs, place, take
from tests.animation.holds.oracle import Carrier, Held, Motion, apart, carried
from tests.animation.holds.runs import motion_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import new_object
from tests.thoroughness import THOROUGH

MOMENTS = np.arange(0.0, 84.0, 0.625)
"""Frames in steps through all eighths, at which the poses of passes are made, whole frames among them."""

LENGTHS = 0, 1, 3, 4, 10
MODES = "motor_spline", "dq_sclerp", "lerp_slerp", "BLENDER"
RESTING, MOVING = 2e-6, 1e-5
"""Tolerances in metres. While channels move, the error of terms is added."""


def keys_of(prop: Carrier, frames: Sequence[float], seed: int, reach: float = 0.1) -> None:
    """Key further random poses of a prop, in its space at that time."""
    for number, frame in enumerate(frames):
        place(prop, 10 * seed + number, reach, frame=frame)


def motions_of(prop: Carrier, holds: Sequence[Held], goes_on: bool = False) -> list[Motion]:
    """Return the motion of a prop in each hold, from the keys there."""
    ends = [*(hold.frame for hold in holds[1:]), np.inf]
    passes = [goes_on, *(hold.frames > 0 for hold in holds[1:]), goes_on]
    return [
        motion_of(prop, -np.inf if number == 0 else hold.frame, end, comes=passes[number], goes=passes[number + 1])
        for number, (hold, end) in enumerate(zip(holds, ends, strict=True))
    ]


def off(
    prop: Carrier, twin: Carrier, holds: Sequence[Held], frames: np.ndarray = MOMENTS, goes_on: bool = False
) -> float:
    """Return the largest distance from the expected place, in metres."""
    expected = carried(twin, holds, motions_of(prop, holds, goes_on), frames)
    (seen,) = shown_worlds([prop], frames)
    return apart(seen, expected)


def juggled(prop: Carrier, holders: Sequence[Carrier], frames: Sequence[int], *, moves: bool) -> list[Held]:
    """Have a prop picked up, passed on, let go, and held once more."""
    keys_of(prop, (1, 11) if moves else (1,), 1, 0.5)
    holds = [Held(1, None)]
    for at, holder, over in zip((20, 44, 66, 75), (*holders, None, holders[0]), frames, strict=True):
        take(prop, holder, at, frames=over, seed=at)
        holds.append(Held(at, holder, over))
        if moves:
            keys_of(prop, (at + 4, at + 8), at)
    return holds


@pytest.mark.parametrize(("length", "mode"), in_turn(LENGTHS, MODES))
def test_a_pass_is_the_formula(live_file, length, mode):
    for moves in (False, True) if THOROUGH else (length % 2 == MODES.index(mode) % 2,):
        prop, twin = free(("QUATERNION", "XYZ", "AXIS_ANGLE")[length % 3])
        holders = by_fk("First", 11), by_an_object("Second", 31)
        holds = juggled(prop, holders, 4 * (length,), moves=moves)
        set_mode(prop, mode)
        assert off(prop, twin, holds) < (MOVING if moves else RESTING)


@pytest.mark.parametrize(("by", "what"), pairs(HOLDERS, PROPS))
def test_all_things_rest_in_all_hands_and_pass_between_them(live_file, by, what):
    prop, twin = PROPS[what]()
    holders = HOLDERS[by]("First", 11), HOLDERS[by]("Second", 31)
    holds = juggled(prop, holders, (3, 4, 10, 3), moves=False)
    moved = [np.ptp(worlds[:, :3, 3], axis=0).max() for worlds in shown_worlds(holders, MOMENTS[::8])]
    assert min(moved) > 0.05, "the hands move, or this test says nothing"
    # A bone that inherits its location differently from its rotation has no space of its own in the world.
    in_hands = (MOMENTS >= 20.0) & (MOMENTS < 56.0)
    frames = MOMENTS[in_hands] if "without" in what else MOMENTS
    assert off(prop, twin, holds, frames) < RESTING


def test_a_hand_near_gimbal_lock_holds_as_well(live_file):
    """Blender's own Child Of uses Euler angles if it leaves out scale, which causes an error of 0.3 mm here."""
    hand, tool = new_object("Hand"), new_object("Tool")
    frames = np.arange(1.0, 121.0)
    turns = [
        Euler((0.5 + 0.005 * frame, np.pi / 2 - 2e-4 * (1.0 + 0.3 * np.sin(frame)), 0.3)).to_quaternion()
        for frame in frames
    ]
    write_channel(hand, "rotation_quaternion", frames, np.array(turns))
    hand.location = 0.5, 0.4, 1.2
    hold_in(tool, hand)
    place(tool, 3, 0.1, frame=1)
    held, moved = shown_worlds([hand, tool], frames)
    assert apart(moved, held @ np.linalg.inv(held[0]) @ moved[0]) < RESTING


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_all_modes_move_in_hands_as_they_do_in_the_world(live_file, mode):
    prop, twin = free("YXZ")
    holds = juggled(prop, (by_fk("First", 11), by_an_object("Second", 31)), (0, 4, 0, 3), moves=True)
    set_mode(prop, mode)
    assert off(prop, twin, holds) < MOVING
