from itertools import combinations

import numpy as np
import pytest

from rigid_motion.motion import MODES
from rigid_motion_batch import palette

# Machado, Oliveira, Fernandes 2009, severity 1: the colours seen with one kind of cone missing, in linear RGB.
VISION = {
    "all cones": np.eye(3),
    "protanopia": np.array(
        ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998))
    ),
    "deuteranopia": np.array(
        ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881))
    ),
    "tritanopia": np.array(
        ((1.255528, -0.076749, -0.178779), (-0.078411, 0.930809, 0.147602), (0.004733, 0.691367, 0.303900))
    ),
}
XYZ = np.array(((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505)))


def lab(rgb: np.ndarray) -> np.ndarray:
    xyz = XYZ @ np.clip(rgb, 0.0, 1.0) / np.array((0.95047, 1.0, 1.08883))
    x, y, z = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16.0 / 116.0)
    return np.array((116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)))


@pytest.mark.parametrize("vision", VISION)
def test_people_of_any_colour_vision_can_tell_the_modes_apart(vision):
    seen = {mode: lab(VISION[vision] @ palette.linear(palette.colour_of(mode))) for mode in MODES}
    assert min(np.linalg.norm(seen[a] - seen[b]) for a, b in combinations(seen, 2)) > 15.0


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("theme", palette.THEMES)
def test_modes_stand_out_from_what_they_stand_before(mode, theme):
    colour = XYZ[1] @ palette.linear(palette.colour_on(palette.THEMES[theme], mode))
    card = XYZ[1] @ palette.linear(palette.THEMES[theme].card)
    assert (max(colour, card) + 0.05) / (min(colour, card) + 0.05) > 3.0


def test_colours_are_linear_for_blender():
    assert palette.linear("#FF8000") == pytest.approx((1.0, 0.21586, 0.0), abs=1e-5)
