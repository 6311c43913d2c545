import re

import numpy as np
import pytest

from rigid_motion.motion import KEYFRAME_MODES, interpolate
from rigid_motion_batch.analysis.choices import Budget, Choice, Radii, Tolerance, Uniform, radius_in_metres, read_radii
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.recordings.clips import Clip
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import swinging_clip
from tests.scripts.comparing import shell_errors


def errors_of(clip: Clip, keys: np.ndarray, mode: str) -> np.ndarray:
    """Return the largest displacement of any point within 10 cm, in metres."""
    return shell_errors(interpolate(clip.times[keys], clip.poses[keys], clip.times, mode), clip.poses, 0.1)


@pytest.mark.parametrize("mode", KEYFRAME_MODES)
@pytest.mark.parametrize("written", ["2mm", "0.5cm", "0.03m", "0.01"])
def test_adaptive_keys_keep_to_the_tolerance(written: str, mode: str) -> None:
    clip = swinging_clip(seconds=1.5)
    (keys,) = Tolerance(written).keys(clip, mode, 0.1)
    metres = {"2mm": 0.002, "0.5cm": 0.005, "0.03m": 0.03, "0.01": 0.01}[written]
    assert errors_of(clip, keys, mode).max() <= metres * (1.0 + 1e-9)
    assert (keys[0], keys[-1]) == (0, len(clip.times) - 1)
    assert len(keys) < 0.6 * len(clip.times)


@pytest.mark.parametrize(("seconds", "rate", "count"), [(3.0, "10", 31), (1.0, "7.5", 8), (3.0, "500", 271)])
def test_a_budget_is_as_many_keys_as_a_sender_at_that_rate_has_and_better_ones(seconds, rate, count):
    clip = swinging_clip(seconds=seconds)
    (keys,) = Budget(rate).keys(clip, "lerp_slerp", 0.1)
    (evenly,) = Uniform(rate).keys(clip, "lerp_slerp", 0.1)
    assert len(keys) == len(evenly) == count
    adaptive, uniform = (np.mean(errors_of(clip, some, "lerp_slerp")[: evenly[-1] + 1] ** 2) for some in (keys, evenly))
    assert adaptive <= uniform


@pytest.mark.parametrize("choice", [Uniform("0.2"), Budget("0.2")])
def test_a_clip_too_short_for_two_keys_is_not_reconstructed(choice: Choice) -> None:
    assert reconstruct(swinging_clip(), choice, KEYFRAME_MODES, 0.1) is None


@pytest.mark.parametrize("written", ["0mm", "-5mm", "5in", "5 m m", "5,5mm", "nan", "", "mm", ".", ".e1", "../x"])
def test_what_is_no_length_is_refused_with_the_way_out(written: str) -> None:
    with pytest.raises(ValueError, match=r"is not a tolerance; give a length such as 5mm, 0.5cm or 0.005m"):
        Tolerance(written)


@pytest.mark.parametrize(
    ("written", "name"),
    [(".1mm", "0.1mm"), ("1.mm", "1mm"), (" 5 mm", "5mm"), ("5MM", "5mm"), (".5 Cm\n", "0.5cm"), ("1e-3", "0.001")],
)
def test_a_length_may_be_written_as_people_do_for_tolerances_and_radii(written: str, name: str) -> None:
    tolerance = Tolerance(written)
    assert tolerance.name == f"tolerance-{name}", "as a folder is called"
    assert tolerance.metres(1.0) == radius_in_metres(written) == Tolerance(name).metres(1.0)


@pytest.mark.parametrize("kind", [Uniform, Budget])
@pytest.mark.parametrize("written", ["0", "-1", "5mm", "1e3", "../../x", ""])
def test_what_is_no_rate_is_refused_with_the_way_out(kind: type[Choice], written: str) -> None:
    with pytest.raises(ValueError, match=r"is not a rate; give numbers such as 5,7\.5,10"):
        kind(written)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ("5", r"5 units of the recording, 5 m, is more than the whole motion, .* give it with its unit, as in 5mm"),
        ("90000mm", r"90000 mm, 90 m, is more than the whole motion, .* give a smaller one"),
    ],
)
def test_a_tolerance_larger_than_the_motion_is_refused_with_the_way_out(written: str, said: str) -> None:
    assert re.search(said, Tolerance(written).problem_with(swinging_clip(), 0.1))


@pytest.mark.parametrize("text", ["", "0", "-1", "nan", "inf", "10km", "-3cm", "radii.csv", "a\0b", "x" * 5000])
def test_what_is_no_radius_is_refused_with_the_way_out(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a length above 0, such as 3cm or 0\.03"):
        read_radii(text)


def test_joints_have_another_radius_than_rigid_bodies_unless_one_is_given() -> None:
    body, rigid = swinging_body(), swinging_clip()
    for radii, joint, of_rigid in ((Radii(0.1, 0.03), 0.03, 0.1), (read_radii(" 5e-2 "), 0.05, 0.05)):
        assert radii.of(body).tolist() == [joint] * len(body.whole_body.joints)
        assert radii.of(rigid).tolist() == [of_rigid]
