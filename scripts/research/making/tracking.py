"""Simulated tracking: adds a hand's unsteadiness, noise and uneven timestamps to an ideal motion.

Seconds, metres, radians. The levels are those of hand-held controllers: a median step of 11.1 ms that varies between 7
and 17 ms; noise of a few tenths of a millimetre and hundredths of a degree, mostly slower than the frame rate (drift);
and the 8 to 12 Hz tremor of every outstretched hand (Elble and Randall, 1978).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply

HEADER = "t,x,y,z,qx,qy,qz,qw"

SAMPLES_PER_S = 90.0
SHORTEST_STEP, LONGEST_STEP = 0.007, 0.017

STAMP_ERROR = 0.3e-3
POSITION_WANDER, POSITION_WHITE = 0.25e-3, 0.12e-3
ROTATION_WANDER, ROTATION_WHITE = np.radians(0.06), np.radians(0.03)


def tick(rng: np.random.Generator, duration: float) -> np.ndarray:
    """Return the times at which a 90 Hz device reports, from 0 to about `duration`.

    Steps vary a little; one in fourteen is late by 2 to 6 ms, and the next step makes up for half of that.
    """
    count = round(duration * SAMPLES_PER_S)
    steps = 1.0 / SAMPLES_PER_S + 0.60e-3 * rng.standard_normal(count)
    lateness = rng.uniform(2e-3, 6e-3, count) * (rng.random(count) < 1.0 / 14.0)
    steps += lateness
    steps[1:] -= 0.5 * lateness[:-1]
    return np.concatenate(([0.0], np.cumsum(np.clip(steps, SHORTEST_STEP, LONGEST_STEP))))


def wander(
    rng: np.random.Generator, times: np.ndarray, channels: int, band: tuple[float, float], slope: float = 0.0
) -> np.ndarray:
    """Return independent random signals, shape (n, channels), with an expected root mean square of 1.

    Parameters
    ----------
    times : array, shape (n,)
        Need not be evenly spaced: the signal is a sum of sinusoids and has a value at any time.
    band : tuple of float
        The lowest and highest frequency in Hz.
    slope : float
        The power falls with the frequency to this power: 0 is flat, 1 is pink, 2 is brown.
    """
    low, high = band
    frequencies = np.arange(low, high, 1.0 / (times[-1] - times[0]))
    power = frequencies**-slope
    amplitudes = np.sqrt(power / power.sum())[:, None] * rng.standard_normal((2, len(frequencies), channels))
    phases = 2.0 * np.pi * times[:, None] * frequencies
    return np.einsum("nf,fc->nc", np.cos(phases), amplitudes[0]) + np.einsum("nf,fc->nc", np.sin(phases), amplitudes[1])


def unsteadiness(rng: np.random.Generator, times: np.ndarray, channels: int) -> np.ndarray:
    """Return the sway and tremor of a held hand, shape (n, channels), with a root mean square of about 1."""
    return wander(rng, times, channels, (0.3, 3.0), slope=2.0) + 0.10 * wander(rng, times, channels, (8.0, 12.0))


def track(
    rng: np.random.Generator, motion: Callable[[np.random.Generator, np.ndarray], Poses], times: np.ndarray
) -> Poses:
    """Return the poses of `motion` as a device would report them at `times`.

    Each pose has noise, and belongs to a moment slightly off its timestamp.
    """
    return noisy(rng, motion(rng, times + STAMP_ERROR * rng.standard_normal(len(times))), times)


def noisy(rng: np.random.Generator, poses: Poses, times: np.ndarray) -> Poses:
    """Return poses at `times` with slowly drifting noise, and noise that is independent in every frame."""
    count = len(times)
    position_noise = POSITION_WANDER * wander(rng, times, 3, (0.2, 12.0), slope=1.0)
    position_noise += POSITION_WHITE * rng.standard_normal((count, 3))
    rotation_noise = ROTATION_WANDER * wander(rng, times, 3, (0.2, 12.0), slope=1.0)
    rotation_noise += ROTATION_WHITE * rng.standard_normal((count, 3))
    return Poses(poses.positions + position_noise, multiply(poses.quaternions, turn(rotation_noise)))


def turn(rotation_vectors: np.ndarray) -> np.ndarray:
    """Return unit quaternions (..., 4) of rotation vectors (..., 3): the axis times the angle in radians."""
    angles = np.linalg.norm(rotation_vectors, axis=-1, keepdims=True)
    return np.concatenate((np.cos(0.5 * angles), 0.5 * np.sinc(angles / (2.0 * np.pi)) * rotation_vectors), axis=-1)


def table(times: np.ndarray, poses: Poses) -> str:
    """Return a clip as text: seconds (n,), metres, and quaternions with the scalar last."""
    return "\n".join([HEADER, *_rows(times, poses), ""])


def table_of_devices(times: np.ndarray, devices: Mapping[str, Poses]) -> str:
    """Return the recordings of several devices at the same times as one text: a row of each device in turn."""
    rows = zip(*(_rows(times, poses) for poses in devices.values()), strict=True)
    lines = (f"{name},{row}" for together in rows for name, row in zip(devices, together, strict=True))
    return "\n".join([f"device,{HEADER}", *lines, ""])


def _rows(times: np.ndarray, poses: Poses) -> list[str]:
    rows = np.column_stack((times, poses.positions, np.roll(poses.quaternions, -1, axis=1)))
    return [",".join(f"{value:.6f}" for value in row) for row in rows]
