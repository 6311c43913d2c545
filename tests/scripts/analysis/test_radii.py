"""Radii: lengths that are typed."""

import pytest

from rigid_motion_batch.analysis.choices import Radii, read_radii
from tests.scripts.clips.bodies import swinging_body
from tests.scripts.clips.recordings import swinging_clip


@pytest.mark.parametrize("text", ["0.05", " 0.05 ", "5e-2"])
def test_a_number_is_the_radius_of_everything(text: str) -> None:
    assert read_radii(text) == Radii(0.05, 0.05)


def test_joints_have_another_radius_than_rigid_bodies() -> None:
    radii, body = Radii(0.1, 0.03), swinging_body()
    assert radii.of(body).tolist() == [0.03] * len(body.whole_body.joints)
    assert radii.of(swinging_clip()).tolist() == [0.1]


@pytest.mark.parametrize("text", ["", "0", "-1", "nan", "inf", "10km", "-3cm", "radii.csv", "a\0b", "x" * 5000])
def test_what_is_no_length_is_told(text: str) -> None:
    with pytest.raises(ValueError, match=r"is not a length above 0, such as 3cm or 0\.03"):
        read_radii(text)


@pytest.mark.parametrize("text", ["0.03", "3cm", "3 cm", "30mm", "0.03m", "3e-2m"])
def test_a_radius_may_have_its_unit(text: str) -> None:
    assert read_radii(text).joint == pytest.approx(0.03)
