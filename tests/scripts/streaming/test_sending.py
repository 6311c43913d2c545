"""Tests of streaming recordings: bodies, and the radius around each joint within which the tolerance holds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion.streams.paths import KnotPath
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.bvh import _read_hierarchy
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.streaming.sending import body_of, found_held, hand_of, radii_of, samples_of
from tests.recordings import RECORDINGS
from tests.scripts.bvh_bodies import TIMES, write_body
from tests.streams import links


def file_end_error(path: Path, tolerance: float, delay: float = 0.1) -> float:
    """Return the largest error of the End Sites of a recording."""
    (clip,), _ = read_clips([str(path)])
    times, poses = samples_of(clip)
    sites = np.array([joint.end or (0.0, 0.0, 0.0) for joint in _read_hierarchy(path)[0]]) * clip.metres_per_unit
    ends = to_blender(Poses(sites, np.tile((1.0, 0.0, 0.0, 0.0), (len(sites), 1))), clip.axes).positions
    own, truth = body_of(clip, poses), KnotPath(times, poses)

    def at(local: Poses) -> np.ndarray:
        there = own.in_root_space(local)
        return there.positions + rotate(there.quaternions, ends)

    outcome = links.run([own], times, poses, tolerance=tolerance, delay=delay)
    away = [at(shown.poses[own.name]) - at(truth.pose(shown.moment)) for shown in outcome.shown]
    return float(np.linalg.norm(away, axis=-1).max())


@pytest.mark.parametrize("unit", [1.0, 100.0])
def test_the_ends_of_bones_are_within_the_tolerance(tmp_path: Path, unit: float) -> None:
    assert 0.001 < file_end_error(write_body(tmp_path / "walk.bvh", unit=unit), 0.002) <= 0.002


@pytest.mark.slow
@pytest.mark.recordings
@pytest.mark.parametrize("delay", [0.1, 0.2])
def test_the_ends_of_bones_of_a_recording_are_within_the_tolerance(delay: float) -> None:
    assert file_end_error(RECORDINGS / "beat_saber_body.bvh", 0.005, delay) <= 0.005 * 1.02


def test_what_is_held_all_the_time_is_found() -> None:
    clips, _ = read_clips([str(Path(__file__).parents[3] / "assets/hold.csv") + ":*"])
    assert found_held(clips) == [("hold-tool", ("hold-hand", None))]
    assert hand_of("dancer:mixamorig:RightHand") == ("dancer", "mixamorig:RightHand")


@pytest.mark.parametrize(("height", "metres"), [(1.7, 1.0), (0.08, 1.0), (170.0, 0.01), (6.0, 1.0)])
def test_balls_are_those_of_a_grown_up_in_proportion(tmp_path: Path, height: float, metres: float) -> None:
    (clip,), _ = read_clips([str(write_body(tmp_path / "walk.bvh", TIMES[:4]))])
    places = np.array(((0.0, 0.0, 0.0), (0.01, height, 0.0), (0.01, 0.5 * height, 0.0)))
    figure = replace(clip.rest_body, rest=Poses(places, clip.rest_body.rest.quaternions), ends=None)
    radii = radii_of(replace(clip, rest_body=figure, metres_per_unit=metres))
    np.testing.assert_allclose(radii, 0.03 / 1.7 * height * metres)
    far = replace(figure, ends=np.array((0.0, height, 0.0)))
    radii = radii_of(replace(clip, rest_body=far, metres_per_unit=metres))
    np.testing.assert_allclose(radii[1:], (height * metres, 0.03 / 1.7 * height * metres))
    nowhere = replace(figure, rest=Poses(0.0 * places, clip.rest_body.rest.quaternions))
    np.testing.assert_allclose(radii_of(replace(clip, rest_body=nowhere, metres_per_unit=metres)), 0.03)
