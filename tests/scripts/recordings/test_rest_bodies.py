"""Tests of rest bodies: repairs that do not depend on the motion."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_motion_batch.recordings import Trajectory
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import Skin, repaired, size_of
from tests.scripts.clips.bodies import JOINTS, swinging_body


@pytest.fixture
def clip() -> Clip:
    """A clip with a skin of one triangle."""
    clip = swinging_body()
    skin = Skin(np.eye(3), np.array([[0, 1, 2]]), np.zeros((3, 4), dtype=int), np.eye(4)[[0, 0, 0]])
    return replace(clip, rest_body=replace(clip.rest_body, skin=skin))


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 1e38])
def test_a_joint_that_is_nowhere_at_rest_has_no_bone_and_is_told(clip: Clip, number: float) -> None:
    rest_body = clip.rest_body
    rest_body.tails[2, 1] = number
    rest_body.rest.positions[5, 0] = number
    rest_body.skin.vertices[1, 1] = number
    rest_body = replace(rest_body, ends=np.full(len(JOINTS), 0.1))
    sound, done = repaired(rest_body)
    assert sound.ends.tolist() == [0.0 if joint in (2, 5) else 0.1 for joint in range(len(JOINTS))]
    assert done == (
        "drew no bones for joints that are nowhere at rest (2: Head, Glove)",
        "left out a skin with numbers that are missing, not finite or too large",
    )
    assert sound.skin is None
    for joint in range(len(JOINTS)):
        for result, before in ((sound.tails, rest_body.tails), (sound.rest.positions, rest_body.rest.positions)):
            assert np.array_equal(result[joint], [0, 0, 0] if joint in (2, 5) else before[joint])
    trajectory = Trajectory("walk", clip.times, clip.poses, rest_body=rest_body)
    made = make_clip(trajectory, "walk.fbx", "walk", "blender")
    assert made.repairs == done
    assert np.isfinite(made.rest_body.tails).all()


def test_the_size_of_a_body_is_that_from_where_it_branches() -> None:
    # A reference on the ground, the root of the body as its child, and an arm and a leg.
    parents = np.array([-1, 0, 1, 1, 3])
    places = np.array([[0, 0, 0], [0, 50, 0], [0, 51, 0], [0, 49.5, 0], [0, 49.2, 0.4]])
    assert size_of(parents, places) == pytest.approx(1.8)
    chain = np.array([-1, 0, 1])
    assert size_of(chain, np.array([[0, 0, 0], [3.0, 0, 0], [3, 4, 0]])) == pytest.approx(4.0)
    assert size_of(np.array([-1]), np.zeros((1, 3))) == 0.0
