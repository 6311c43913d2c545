"""Tests of reading sources: good bodies are kept, and the others are named."""

from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion_batch.recordings import Recording, Trajectory, TrajectoryError
from rigid_motion_batch.recordings import clip_reading as study


def body(name: str, sound: int, lost: int = 0) -> Trajectory:
    """Return a body with `sound` good samples, and `lost` samples that were not tracked."""
    positions = np.zeros((sound + lost, 3))
    positions[sound:] = np.nan
    quaternions = np.tile((1.0, 0.0, 0.0, 0.0), (sound + lost, 1))
    return Trajectory(name, np.arange(sound + lost, dtype=float), Poses(positions, quaternions))


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch):
    """Return a function that makes every source contain these bodies."""

    def hold(*bodies: Trajectory, named: str = "") -> None:
        recording = Recording(Path("take.csv"), bodies, body=named)
        monkeypatch.setattr(study, "read_trajectories", lambda source, options: recording)

    return hold


def test_a_body_without_two_poses_is_left_out_and_named(recorded):
    recorded(body("left", 5), body("tracker", 1, lost=7), body("right", 4))
    clips, note = study.read_source("take.csv:*", "blender")
    assert [clip.name for clip in clips] == ["take-left", "take-right"]
    assert note.startswith("'tracker' is left out: 1 usable poses are left")


@pytest.mark.parametrize("bodies", [("left",), ("left", "right")])
def test_a_source_without_any_good_body_is_refused(recorded, bodies):
    recorded(*(body(name, 1, lost=3) for name in bodies))
    with pytest.raises(TrajectoryError, match="1 usable poses are left"):
        study.read_source("take.csv:*", "blender")


@pytest.mark.parametrize(
    ("expected", "names"),
    [
        ([("log", "left")], ["log"]),
        ([("log", "left"), ("other", "left")], ["log", "other"]),
        ([("log", "left"), ("log", "right")], ["log-left", "log-right"]),
        ([("log", ""), ("Log", "right")], ["log", "Log-right"]),
        ([("log-left", ""), ("log-right", ""), ("log", "left")], ["log-left", "log-right", "log"]),
        ([("log", "left"), ("log", "left")], ["log-left", "log-left-2"]),
        ([("log", ""), ("log", "")], ["log", "log-2"]),
        ([("shot", "Rig/Hand"), ("shot", "Rig/Foot")], ["shot-Rig_Hand", "shot-Rig_Foot"]),
    ],
)
def test_the_body_is_part_of_the_name_only_where_files_have_the_same(expected, names):
    assert study.clip_names(expected) == names
