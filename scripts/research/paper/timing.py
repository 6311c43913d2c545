"""Running time per generated frame, with all engines compared in one run.

There are two measurements of the same work, a hand for each of `USER_COUNT` users at `FRAMES_PER_S`:

- `Case.filled_in`: this program's own forms, which compute a segment once and then evaluate its frames;
- `Case.in_the_algebra`: as in the paper, each frame is encoded, interpolated and extracted anew, all in one array.

All engines take turns in every round, and each is compared with the state of the art in the same round; the interval
is from a bootstrap over rounds. Seconds. Timings differ from run to run.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np

from research.in_betweens import Case
from research.studies import interleaved_seconds
from rigid_motion.motion import MODES, Poses, decimate
from rigid_motion.motion.quaternions import align_signs
from rigid_motion_batch.analysis.modes import STATE_OF_THE_ART as REFERENCE
from rigid_motion_batch.recordings.clips import Clip

from .table import PAPER_RATES_PER_S, UPDATES

FRAMES_PER_S = 90.0
USER_COUNT = 20
ROUND_COUNT = 25
BOOTSTRAP_RESAMPLES, BOOTSTRAP_SEED, CONFIDENCE_RATIO = 2000, 2021, 0.95  # of the bootstrap

WARM_UP_NUMBERS = 3 * 2**20
"""Numbers in an array that is allocated and freed before a race: Linux's C library then keeps memory freed by NumPy."""


def races(clip: Clip, needed: Mapping[str, Mapping[str, list[float]]], rounds: int = ROUND_COUNT) -> dict[str, Any]:
    """Race all engines on a clip, the fast ones at each rate of the paper's table.

    Parameters
    ----------
    clip : Clip
    needed : mapping
        By mode the updates needed to be as good as the state of the art: "updates" at each of the paper's rates.
    rounds : int

    Returns
    -------
    dict
        Results of `race` by mode and rate, for "equal" rates, "as good" ones and the "paper"'s. The same for the
        "algebra", for which the rate makes no difference: it starts anew with every frame.
    """
    exact = [mode for mode in MODES if not MODES[mode].is_smooth]
    result: dict[str, Any] = {}
    for place, rate in enumerate(UPDATES):
        paces = {
            "equal": dict.fromkeys(MODES, float(rate)),
            "as good": {mode: needed[mode]["updates"][place] for mode in MODES if mode in needed},
            "paper": dict.fromkeys(exact, float(PAPER_RATES_PER_S[rate])),
        }
        for pace, updates in paces.items():
            for mode, row in race(clip, Case.filled_in, updates | {REFERENCE: float(rate)}, rounds).items():
                result.setdefault(pace, {}).setdefault(mode, {})[rate] = row
    result["algebra"] = race(clip, Case.in_the_algebra, dict.fromkeys(exact, float(UPDATES[0])), rounds)
    return result


def race(
    clip: Clip, engine: Callable[[Case, str], object], updates: Mapping[str, float], rounds: int
) -> dict[str, dict[str, float]]:
    """Return the running time per frame of each mode, at its updates per second.

    "relative" is the median over rounds of its ratio to the state of the art's, "low" and "high" the bounds of the
    confidence interval, "processor" the mean processor time per frame in seconds.
    """
    # Otherwise it is random whose arrays are returned to the system, and fetched again page by page.
    np.zeros(WARM_UP_NUMBERS).fill(1.0)
    cases = {mode: case_of(clip, rate) for mode, rate in updates.items()}
    runs = {mode: partial(engine, case, mode) for mode, case in cases.items()}
    wall = {mode: np.array(of_mode) for mode, of_mode in interleaved_seconds(runs, rounds, warm=True).items()}
    processor = interleaved_seconds(runs, rounds, clock=time.process_time)
    a_frame = {mode: of_mode / cases[mode].in_betweens for mode, of_mode in wall.items()}
    return {
        mode: {
            "updates": updates[mode],
            **compared(a_frame[mode] / a_frame[REFERENCE]),
            "processor": float(np.mean(processor[mode])) / case.in_betweens,
        }
        for mode, case in cases.items()
    }


def compared(ratios: np.ndarray) -> dict[str, float]:
    """Return the median over rounds of ratios (n,), and the bounds of its confidence interval."""
    drawn = np.random.default_rng(BOOTSTRAP_SEED).integers(len(ratios), size=(BOOTSTRAP_RESAMPLES, len(ratios)))
    low, high = np.quantile(
        np.median(ratios[drawn], axis=1), ((1.0 - CONFIDENCE_RATIO) / 2.0, (1.0 + CONFIDENCE_RATIO) / 2.0)
    )
    return {"relative": float(np.median(ratios)), "low": float(low), "high": float(high)}


def case_of(clip: Clip, rate: float) -> Case:
    """Return the keys of a sender of that rate, the same for all users, and the times of frames."""
    keys = decimate(clip.times, rate)
    times, poses = clip.times[keys], clip.poses[keys]
    quaternions = np.tile(align_signs(poses.quaternions), (USER_COUNT, 1, 1))
    frames = np.arange(times[0], times[-1], 1.0 / FRAMES_PER_S)
    return Case(clip.name, times, Poses(np.tile(poses.positions, (USER_COUNT, 1, 1)), quaternions), frames)
