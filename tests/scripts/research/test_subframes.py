"""The error between whole frames is bounded, falls as the motion gets slower, and goes where one bakes more finely."""

import numpy as np
import pytest

from research import subframes
from research.subframes import QUARTERS, Motion, between, deviation, keyed_object, measure
from rigid_motion import animation
from rigid_motion.animation.compute.differences import in_betweens
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.motion import KEYFRAME_MODES
from tests.scripts.research.keeping import written

BRISK = Motion("Brisk", turn=90.0, distance=1.0, frames=24)


@pytest.fixture
def live_file(empty_file):
    """A new file without objects, with the extension's data."""
    animation.register()
    yield empty_file
    animation.unregister()


def live(motion, mode="dq_sclerp", rotation_mode="QUATERNION", fractions=QUARTERS):
    obj = keyed_object(motion, rotation_mode)
    animation.set_mode(obj, mode)
    frames = between(motion, np.asarray(fractions))
    return deviation(obj, frames, in_betweens(source_of(obj), frames).desired, radius=0.1)


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XYZ"])
@pytest.mark.parametrize("mode", KEYFRAME_MODES)
def test_a_brisk_motion_is_within_millimetres_between_frames_and_exact_on_them(live_file, mode, rotation_mode):
    """Within 2, and within 2.5 where a smooth mode takes up speed between its keys."""
    result = live(BRISK, mode, rotation_mode)
    assert 1e-4 < result.largest < (2.5e-3 if KEYFRAME_MODES[mode].is_smooth else 2e-3)
    assert result.rotation < np.radians(0.2)
    assert live(BRISK, mode, rotation_mode, fractions=[0.0]).largest < 1e-5


@pytest.mark.parametrize("rotation_mode", ["QUATERNION", "XYZ"])
def test_baking_every_quarter_of_a_frame_leaves_a_tenth_of_the_error(live_file, rotation_mode):
    result, _, finely, whole = measure(BRISK, "dq_sclerp", rotation_mode, 0.1)
    assert finely.largest < 0.1 * result.largest
    assert whole.largest > 0.5 * result.largest, "baking whole frames does not help"


def test_the_study_writes_what_the_page_reads(empty_file, tmp_path, monkeypatch):
    monkeypatch.setattr(subframes, "SEGMENTS", 2)
    monkeypatch.setattr(subframes, "MOTIONS", subframes.MOTIONS[:1])
    assert subframes.main(["--root", str(tmp_path)]) == 0
    (motion,) = written(tmp_path, "subframes")["motions"]
    assert [(row["mode"], row["rotation"]) for row in motion["rows"]] == [
        (mode, rotation) for mode in KEYFRAME_MODES for rotation in subframes.ROTATION_MODES
    ]
