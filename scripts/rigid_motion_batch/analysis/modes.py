"""The modes of a comparison: those of `rigid_motion.motion`, and `best_of`, made of them segment by segment."""

from __future__ import annotations

from collections.abc import Iterable

from rigid_motion.motion import MODES

REFERENCE = "lerp_slerp"
"""The state of the art in the paper: what the other modes are held against."""

BEST_OF = "best_of"
"""In each segment that mode of the run which comes closest to the recording there."""

BEST_OF_LABEL = "Best per Segment"

BEST_OF_DESCRIPTION = (
    "In every segment that mode of this run which turns out to be closest to the recording there; of adaptive keys it "
    "has those of the best single mode"
)


def label_of(mode: str) -> str:
    """What a mode is called."""
    if mode == BEST_OF:
        return BEST_OF_LABEL
    return MODES[mode].label if mode in MODES else mode


def description_of(mode: str) -> str:
    """What a mode does for the motion, in one sentence without a full stop."""
    return BEST_OF_DESCRIPTION if mode == BEST_OF else MODES[mode].description


def single_modes(modes: Iterable[str]) -> tuple[str, ...]:
    """Those that fill in all segments alike."""
    return tuple(mode for mode in modes if mode != BEST_OF)
