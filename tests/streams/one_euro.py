"""The One Euro filter of a body, for comparison (Casiez, Roussel and Vogel, CHI 2012).

Positions (metres) and rotations (radians) share the parameters: a minimal cutoff in Hz, and what each metre or radian
per second adds to it.
"""

from __future__ import annotations

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import turned, turns_between

OF_SPEED = 1.0
"""The cutoff for speeds in Hz, the authors' value."""


def one_euro(times: np.ndarray, poses: Poses, least: float, beta: float) -> Poses:
    """Return the filtered poses (n,), each from the samples up to it."""

    def share(cutoff: np.ndarray | float, step: float) -> np.ndarray | float:
        return 1.0 / (1.0 + 1.0 / (2.0 * np.pi * cutoff * step))

    place, turn = poses.positions[0], poses.quaternions[0]
    velocity, spin = np.zeros((2, 3))
    places, turns = [place], [turn]
    for step, before, after in zip(np.diff(times).tolist(), poses[:-1], poses[1:], strict=True):
        velocity = velocity + share(OF_SPEED, step) * ((after.positions - before.positions) / step - velocity)
        spin = spin + share(OF_SPEED, step) * (turns_between(before.quaternions, after.quaternions) / step - spin)
        place = place + share(least + beta * np.abs(velocity), step) * (after.positions - place)
        amount = share(least + beta * np.linalg.norm(spin), step)
        turn = turned(turn, amount * turns_between(turn, after.quaternions))
        places.append(place)
        turns.append(turn)
    return Poses(np.array(places), np.array(turns))
