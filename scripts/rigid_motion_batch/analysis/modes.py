"""The modes of a comparison: those of `rigid_motion.motion`, and `best_of`, made of them segment by segment.

They are compared with what people have without them: Blender's own curves.
"""

from __future__ import annotations

from collections.abc import Iterable

from rigid_motion.motion import KEYFRAME_MODES, MODES
from rigid_motion_batch.recordings.clip_reading import folder_names

REFERENCE = "bezier"
"""What the modes are held against unless another is asked for: Blender's own curves, which animators have anyway."""

STATE_OF_THE_ART = "lerp_slerp"
"""What the paper holds its modes against, and most game engines do."""

COMPARED = (REFERENCE, *KEYFRAME_MODES)
"""The modes of a comparison where none are named."""

BEST_OF = "best_of"
"""In each segment that mode of the run which comes closest to the recording there."""

BEST_OF_LABEL = "Best per Segment"

BEST_OF_DESCRIPTION = (
    "In every segment that mode of this run which turns out to be closest to the recording there; of adaptive keys it "
    "has those of the best single mode"
)

OTHER_DESCRIPTION = "A motion that was given with --against, as its own samples have it; its keys are not known"


def label_of(mode: str) -> str:
    """Return what a mode is called."""
    if mode == BEST_OF:
        return BEST_OF_LABEL
    return MODES[mode].label if mode in MODES else mode


def description_of(mode: str) -> str:
    """Return what a mode does for the motion, in one sentence without a full stop."""
    if mode == BEST_OF:
        return BEST_OF_DESCRIPTION
    return MODES[mode].description if mode in MODES else OTHER_DESCRIPTION


def single_modes(modes: Iterable[str]) -> tuple[str, ...]:
    """Those that fill in all segments alike."""
    return tuple(mode for mode in modes if mode != BEST_OF)


def name_of_other(stem: str) -> str:
    """Return the name of somebody else's motion, by its file: safe as that of a table, and unlike any other there."""
    return folder_names([*MODES, BEST_OF, "keys", stem.replace(".", "_")])[-1]
