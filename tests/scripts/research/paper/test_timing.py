"""Tests of the paper's races and bodies: all engines do the same work, and recordings at rest are not used."""

from pathlib import Path

import numpy as np
import pytest

from research.paper import bodies, timing
from research.paper.motions import MAX_REST_RMS, read_motion
from research.paper.table import PAPER_RATES_PER_S, UPDATES
from rigid_motion.motion import MODES, Poses
from rigid_motion_batch.analysis.metrics import write_poses
from rigid_motion_batch.recordings import TrajectoryError
from tests.motion.bodies import body_errors
from tests.scripts.clips.bodies import PARENTS, swinging_body
from tests.scripts.research.paper.clips import circling

CLIP = circling(turns=0.7, rate=90.0, seconds=1.0)
EXACT = [mode for mode in MODES if not MODES[mode].is_smooth]


@pytest.mark.parametrize("mode", EXACT)
def test_all_readings_generate_the_same_frames(mode: str):
    case = timing.case_of(CLIP, 10.0)
    fast, arrays = (engine(mode).positions for engine in (case.filled_in, case.in_the_algebra))
    assert case.in_betweens == timing.USER_COUNT * 90
    np.testing.assert_allclose(arrays, fast.reshape(-1, 3), atol=1e-12)


def test_the_races_have_every_mode_at_the_rates_that_were_asked_for(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(timing, "USER_COUNT", 2)
    needed = {"lerp_slerp": {"updates": [29.0, 19.0, 14.0, 11.0]}, "pga_lerp": {"updates": [25.0, 16.0, 13.0, 11.5]}}
    result = timing.races(CLIP, needed, 2)

    def updates(pace: str, rate: int) -> dict[str, float]:
        return {mode: own[rate]["updates"] for mode, own in result[pace].items()}

    for place, rate in enumerate(UPDATES):
        assert updates("equal", rate) == dict.fromkeys(MODES, rate)
        assert updates("paper", rate) == dict.fromkeys(EXACT, PAPER_RATES_PER_S[rate]) | {"lerp_slerp": rate}
        as_good = {"lerp_slerp": rate, "pga_lerp": needed["pga_lerp"]["updates"][place]}
        assert updates("as good", rate) == as_good
        assert result["equal"]["lerp_slerp"][rate]["relative"] == 1.0
    assert set(result["algebra"]) == set(EXACT)
    assert all(item["processor"] > 0.0 for item in result["algebra"].values())


NAMES = ("Hips", "Spine", "Head", "LeftArm", "LeftHand", "Glove", "RightLeg", "RightFoot")

BODY_CLIP = swinging_body("walk", seconds=2.0, rate=30.0, seed=3, joints=NAMES)

RADII = np.full(len(NAMES), 0.03)

METRES = Poses(BODY_CLIP.poses.positions * 0.01, BODY_CLIP.poses.quaternions)


def test_errors_of_the_body_are_those_of_matrices() -> None:
    rows = bodies.errors_of(BODY_CLIP)
    for mode in bodies.MODES:
        for rate in bodies.ERROR_RATES:
            keys = np.arange(0, 61, 30 // rate)
            errors = body_errors(BODY_CLIP.times, METRES, PARENTS, (keys,) * len(NAMES), mode, RADII)
            assert rows[mode][rate][0] == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-6)


def test_a_body_that_stays_within_a_centimetre_of_its_mean_is_at_rest(tmp_path: Path):
    times = np.arange(200) / 50.0
    swinging = MAX_REST_RMS * np.sin(np.linspace(0.0, 9.0, 200))[:, None] * (1.0, 0.0, 0.0)
    write_poses(tmp_path / "rests.csv", times, Poses(swinging, np.tile((1.0, 0.0, 0.0, 0.0), (200, 1))))
    with pytest.raises(TrajectoryError, match="at rest"):
        read_motion(tmp_path / "rests.csv")
