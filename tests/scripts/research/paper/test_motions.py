"""Tests of which recordings are used, decided by measuring."""

from pathlib import Path

import numpy as np
import pytest

from research.paper.motions import MAX_REST_RMS, read_motion
from rigid_motion_batch.recordings import TrajectoryError


def write(path: Path, positions: np.ndarray) -> None:
    rows = [f"{i / 50},{x},{y},{z},0,0,0,1" for i, (x, y, z) in enumerate(positions.tolist())]
    path.write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows, ""]), encoding="utf-8")


def swinging(amplitude: float) -> np.ndarray:
    return amplitude * np.sin(np.linspace(0.0, 9.0, 200))[:, None] * (1.0, 0.0, 0.0)


def test_a_body_that_stays_within_a_centimetre_of_its_mean_is_at_rest(tmp_path: Path):
    write(tmp_path / "rests.csv", swinging(MAX_REST_RMS))
    with pytest.raises(TrajectoryError, match="at rest"):
        read_motion(tmp_path / "rests.csv")
