"""Tests of held bodies: which pairs are found, and how far the held body slips under each mode."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.analysis.held import Slip, common_times, find_held, is_held, mean_pose, slips
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.axes import from_blender
from rigid_motion_batch.recordings.clips import Clip
from tests.balls import largest_displacements
from tests.scripts.clips.recordings import swinging_clip

MODES = ("bezier", *KEYFRAME_MODES)
RADIUS = 0.1
FIVE = Uniform("5")

PLACE, TURN = np.array((0.05, 0.3, -0.1)), Rotation.from_euler("xyz", (20.0, -40.0, 100.0), degrees=True)
"""The pose of the tool in the hand."""

HAND = swinging_clip("hand")


def turns_of(poses: Poses) -> Rotation:
    return Rotation.from_quat(poses.quaternions, scalar_first=True)


def held_by(hand: Clip, places: np.ndarray = PLACE, turn: Rotation = TURN, name: str = "tool") -> Clip:
    """Return a body that a hand holds at these places in the hand."""
    turns = turns_of(hand.poses)
    poses = Poses(hand.poses.positions + turns.apply(places), (turns * turn).as_quat(scalar_first=True))
    return replace(hand, name=name, poses=poses)


def slip_of(hand: Clip, tool: Clip, choice: Uniform | Tolerance = FIVE) -> dict[str, Slip]:
    made = [reconstruct(clip, choice, MODES, RADIUS) for clip in (hand, tool)]
    return {row.mode: row for row in slips(*made)}


def displacements_by_matrices(hand: Poses, tool: Poses) -> np.ndarray:
    """Return the largest displacement of the ball around the tool from its place in the hand, by matrices."""
    back = turns_of(hand).inv()
    places, turns = back.apply(tool.positions - hand.positions), back * turns_of(tool)
    return largest_displacements(places - PLACE, RADIUS * (turns.as_matrix() - TURN.as_matrix()))


# -- slips ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", ["bezier", "lerp_slerp"])
def test_a_slip_is_the_largest_distance_of_any_point_of_the_ball(mode: str):
    tool = held_by(HAND)
    row, (keys,) = slip_of(HAND, tool)[mode], FIVE.keys(HAND, mode, RADIUS)
    times = HAND.times[keys[0] : keys[-1] + 1]
    off = displacements_by_matrices(
        *(interpolate(HAND.times[keys], clip.poses[keys], times, mode) for clip in (HAND, tool))
    )
    assert row.max_slip_m == pytest.approx(off.max(), rel=1e-9)
    assert row.rms_slip_m == pytest.approx(np.sqrt(np.mean(off**2)), rel=1e-9)
    assert (row.clip_a, row.clip_b, row.rate_hz, row.decimation, row.tolerance_m) == (
        *("hand", "tool", "5", "uniform"),
        None,
    )


def test_the_slip_of_the_recording_is_measured_from_the_mean_place():
    places = np.tile(PLACE, (len(HAND.times), 1))
    places[:, 0] += np.where(np.arange(len(places)) % 2, 0.002, -0.002)
    rows = slip_of(HAND, held_by(HAND, places), Uniform("10"))
    assert rows["bezier"].recorded_slip_m == pytest.approx(0.002, rel=0.02)


def test_a_slip_does_not_depend_on_axes_and_units():
    tool = held_by(HAND)
    hand_in_unity, tool_in_unity = (
        replace(clip, axes="unity", metres_per_unit=0.01, poses=Poses(100.0 * own.positions, own.quaternions))
        for clip in (HAND, tool)
        for own in [from_blender(clip.poses, "unity")]
    )
    here, there = slip_of(HAND, tool), slip_of(hand_in_unity, tool_in_unity)
    for mode in ("bezier", "lerp_slerp"):
        assert there[mode].max_slip_m == pytest.approx(here[mode].max_slip_m, rel=1e-9)


def test_bodies_with_keys_of_their_own_are_compared_at_the_times_of_both():
    tool = held_by(HAND)
    later = replace(tool, times=tool.times[40:-20:2], poses=tool.poses[40:-20:2])
    times = common_times(HAND.times, later.times)
    np.testing.assert_array_equal(times, HAND.times[40:-20])
    rows = slip_of(HAND, later)
    assert rows["dq_sclerp"].max_slip_m > 1e-3
    assert rows["dq_sclerp"].recorded_slip_m < 2e-3
    adaptive = slip_of(HAND, tool, Tolerance("5mm"))
    assert {row.tolerance_m for row in adaptive.values()} == {0.005}
    assert 1e-4 < adaptive["dq_sclerp"].max_slip_m < 0.03


def test_keys_without_a_common_time_have_no_slip():
    tool = held_by(HAND)
    assert slip_of(HAND, replace(tool, times=tool.times + 10.0)) == {}


def test_the_mean_rotation_takes_no_notice_of_signs():
    turned = TURN.as_quat(scalar_first=True)
    mean = mean_pose(Poses(np.zeros((4, 3)), turned * np.array((1.0, -1.0, 1.0, -1.0))[:, None]))
    assert abs(mean.quaternions[0] @ turned) == pytest.approx(1.0, abs=1e-12)


# -- pairs ------------------------------------------------------------------------------------------------------------


def slid(metres: float) -> Clip:
    """Return a tool that is displaced in the hand for a single sample."""
    places = np.tile(PLACE, (len(HAND.times), 1))
    places[101, 1] += metres
    return held_by(HAND, places)


def shrunk(clip: Clip, share: float) -> Clip:
    """Return a clip with its motion scaled to a fraction."""
    few = Rotation.from_rotvec(share * turns_of(clip.poses).as_rotvec())
    return replace(clip, poses=Poses(share * clip.poses.positions, few.as_quat(scalar_first=True)))


@pytest.mark.parametrize(
    ("clips", "found"),
    [
        ((HAND, held_by(HAND)), True),
        ((HAND, slid(0.0048)), True),
        ((HAND, slid(0.0053)), False),
        ((HAND, slid(0.012)), False),
        ((HAND, swinging_clip("other", seed=2)), False),
        ((shrunk(HAND, 0.1), held_by(shrunk(HAND, 0.1))), True),
        ((shrunk(HAND, 0.02), held_by(shrunk(HAND, 0.02))), False),
        ((HAND, replace(held_by(HAND), times=HAND.times + 10.0)), False),
    ],
    ids=["held", "nearly slipping", "slipping", "jumping", "free", "hardly moving", "at rest", "not at once"],
)
def test_a_pair_is_found_where_its_pose_stays_while_both_move(clips: tuple[Clip, Clip], found: bool):
    assert is_held(*clips, RADIUS) == found
    assert find_held(clips, RADIUS) == [(0, 1)] * found


def test_each_body_is_held_by_the_first_that_holds_it():
    free = swinging_clip("free", seed=2)
    assert find_held([HAND, free, held_by(HAND), held_by(HAND, 2.0 * PLACE)], RADIUS) == [(0, 2), (0, 3)]
