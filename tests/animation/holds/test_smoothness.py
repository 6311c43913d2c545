"""Passes have no pops: between hands that people recorded, and beside Blender's own way from one pose to another."""

from __future__ import annotations

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from rigid_motion.animation import hold_in, set_mode, write_channel
from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.holds.hands import place, wander
from tests.animation.holds.oracle import Carrier, apart
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import new_object
from tests.recordings import RECORDINGS

FPS = 24.0
MOMENT = 1.0 / 256.0
"""The part of a frame over which velocities are looked at."""

STEP = 0.05
"""Metres per second: what people do not see of a tool that weighs something."""


def velocities(worlds: np.ndarray, seconds: float) -> np.ndarray:
    return np.diff(worlds[:, :3, 3], axis=0) / seconds


def recorded(name: str, moments: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Location (n, 3) and unit quaternion (n, 4) of a hand at moments in seconds, as its neighbours in time have it."""
    rows = np.loadtxt(RECORDINGS / name, delimiter=",", skiprows=1)
    times, where = np.unique(rows[:, 0], return_index=True)
    rows = rows[where]
    turns = rows[:, [7, 4, 5, 6]]
    for number in range(1, len(turns)):
        turns[number] *= 1.0 if turns[number] @ turns[number - 1] >= 0.0 else -1.0
    values = np.column_stack([np.interp(moments + times[0], times, column) for column in (*rows[:, 1:4].T, *turns.T)])
    return values[:, :3], values[:, 3:] / np.linalg.norm(values[:, 3:], axis=1, keepdims=True)


def recorded_hand(name: str, first: float, shift: np.ndarray | None = None) -> Carrier:
    """A hand with a key on each frame, from a second of a recording on."""
    frames = np.arange(1.0, 81.0)
    hand = new_object(name)
    places, turns = recorded(name, first + (frames - 1.0) / FPS)
    if shift is not None:
        places = places + shift
    write_channel(hand, "location", frames, places, interpolation="BEZIER")
    write_channel(hand, "rotation_quaternion", frames, turns, interpolation="BEZIER")
    return hand


@pytest.mark.recordings
@pytest.mark.parametrize("first", [5.0, 12.0, 20.0])
@pytest.mark.parametrize("frames", [4, 10])
def test_a_tool_that_goes_from_hand_to_hand_has_no_pop(live_file, first, frames):
    bpy.context.scene.render.fps = int(FPS)
    left = recorded_hand("aframe_left.csv", first)
    here, there = (
        recorded(name, np.array([first + 39 / FPS]))[0][0] for name in ("aframe_left.csv", "aframe_right.csv")
    )
    # Players did not hand anything over: so their hands are brought to 5 cm of each other.
    right = recorded_hand("aframe_right.csv", first, here - there + (0.03, 0.04, 0.0))
    tool = new_object("Tool")
    tool.location = here
    bpy.context.scene.frame_set(10)
    hold_in(tool, left)
    place(tool, 3, 0.02, frame=10)
    bpy.context.scene.frame_set(40)
    hold_in(tool, right, frames=frames)
    place(tool, 4, 0.02, frame=40)
    for seam, hand in ((40.0 - frames, left), (40.0, right)):
        near = seam + MOMENT * np.arange(-2, 3)
        moved, carried = (velocities(one, MOMENT / FPS) for one in shown_worlds([tool, hand], near))
        # What the hand's own keys bring is no fault of ours.
        pop = np.linalg.norm(moved[2] - moved[1]) - np.linalg.norm(carried[2] - carried[1])
        assert pop < STEP


@pytest.mark.parametrize("frames", [1, 3, 4, 10])
def test_between_parts_of_one_body_it_is_vector_and_quaternion_with_a_smoothstep(live_file, frames):
    rig = new_rig("Board", (Rest("Left", (-0.1, 0, 0), (-0.1, 0.2, 0.1)), Rest("Right", (0.1, 0, 0), (0.15, 0, 0.2))))
    wander(rig, 3)
    tool, other = new_object("Tool"), new_object("Other")
    tool.location = 0.1, 0.2, 0.3
    for frame, bone, over in ((20, "Left", 0), (40, "Right", frames)):
        bpy.context.scene.frame_set(frame)
        hold_in(tool, rig.pose.bones[bone], frames=over)
        place(tool, frame, 0.1, frame=frame)
    other.parent = rig
    ends = np.array([40.0 - frames, 40.0 - 1.0 / 64.0])
    for frame, grip in zip(ends, (30.0, 40.0), strict=True):
        # The board has the tool where both bones of it have it, which do not move in it.
        board, seen = shown_worlds([rig, tool], [grip])
        now = np.linalg.inv(board[0]) @ seen[0]
        turn = Matrix(now).to_quaternion()
        if frame == ends[1]:
            turn.make_compatible(other.rotation_quaternion)
        other.location, other.rotation_quaternion = now[:3, 3], turn
        for path in ("location", "rotation_quaternion"):
            other.keyframe_insert(path, frame=frame)
    set_mode(other, "lerp_slerp")
    quarters = np.arange(ends[0], ends[1] + 0.25, 0.25)
    assert apart(*shown_worlds([tool, other], quarters)) < 1e-6


@pytest.mark.parametrize("frames", [3, 5])
def test_a_catch_has_no_more_pop_than_the_flight_has(live_file, frames):
    """The flight goes on at its speed until the hand has what flies; so there is nothing at the seams."""
    hand, ball = new_object("Hand"), new_object("Ball")
    hand.location = 1.0, 0.0, 1.0
    hand.keyframe_insert("location", frame=1)
    at = np.arange(1.0, 38.0, 4.0)
    seconds = (at - 1.0) / FPS
    places = np.column_stack((0.6 * seconds, 0.0 * seconds, 1.0 + 4.0 * seconds - 4.9 * seconds**2))
    write_channel(ball, "location", at, places, interpolation="BEZIER")
    write_channel(ball, "rotation_quaternion", at[:1], np.array([(1.0, 0.0, 0.0, 0.0)]))
    bpy.context.scene.frame_set(40)
    hand.location = ball.location
    hand.keyframe_insert("location", frame=30)
    hold_in(ball, hand, frames=frames)
    flying = velocities(shown_worlds([ball], np.arange(20.0, 30.0, MOMENT))[0], MOMENT / FPS)
    flight = np.linalg.norm(np.diff(flying, axis=0), axis=1).max()
    for seam in (40.0 - frames, 40.0):
        moved = velocities(shown_worlds([ball], seam + MOMENT * np.arange(-2, 3))[0], MOMENT / FPS)
        assert np.linalg.norm(moved[2] - moved[1]) < flight + STEP
