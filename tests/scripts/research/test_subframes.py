"""The error between whole frames is bounded, falls as the motion gets slower, and goes where one bakes more finely."""

import numpy as np
import pytest

from research import subframes
from research.subframes import Motion, measure
from rigid_motion import animation
from rigid_motion.motion import KEYFRAME_MODES
from tests.scripts.research.keeping import written
from tests.thoroughness import combined

BRISK = Motion("Brisk", degrees=90.0, metres=1.0, frames=24)


@pytest.fixture
def live_file(empty_file):
    """A new file without objects, with the extension's data."""
    animation.register()
    yield empty_file
    animation.unregister()


@pytest.mark.parametrize(("mode", "rotation_mode"), combined([*KEYFRAME_MODES], ["QUATERNION", "XYZ"]))
def test_a_brisk_motion_is_within_millimetres_between_frames_and_exact_on_them(
    live_file, monkeypatch, mode, rotation_mode
):
    """Within 2, and within 2.5 where a smooth mode takes up speed between its keys."""
    result = measure(BRISK, mode, rotation_mode, 0.1)
    assert 0.1 < result["live_mm"] < (2.5 if KEYFRAME_MODES[mode].is_smooth else 2.0)
    assert result["live_degrees"] < 0.2
    monkeypatch.setattr(subframes, "QUARTERS", np.zeros(1))
    assert measure(BRISK, mode, rotation_mode, 0.1)["live_mm"] < 1e-2


def test_the_study_writes_what_the_page_reads(empty_file, tmp_path, monkeypatch):
    monkeypatch.setattr(subframes, "SEGMENTS", 2)
    monkeypatch.setattr(subframes, "MOTIONS", subframes.MOTIONS[:1])
    assert subframes.main(["--root", str(tmp_path)]) == 0
    (motion,) = written(tmp_path, "subframes")["motions"]
    assert [(row["mode"], row["rotation"]) for row in motion["rows"]] == [
        (mode, rotation) for mode in KEYFRAME_MODES for rotation in subframes.ROTATION_MODES
    ]
