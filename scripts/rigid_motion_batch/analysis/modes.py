"""The modes of a comparison, beside what people have without them: Blender's own curves."""

from __future__ import annotations

from rigid_motion.motion import KEYFRAME_MODES, MODES
from rigid_motion_batch.recordings.clip_reading import folder_names

REFERENCE = "bezier"
"""What the modes are held against unless another is asked for: Blender's own curves, which animators have anyway."""

STATE_OF_THE_ART = "lerp_slerp"
"""What the paper holds its modes against, and most game engines do."""

COMPARED = (REFERENCE, *KEYFRAME_MODES)
"""The modes of a comparison where none are named."""


OTHER_DESCRIPTION = "A motion that was given with --against, as its own samples have it; its keys are not known"


def label_of(mode: str) -> str:
    """Return what a mode is called."""
    return MODES[mode].label if mode in MODES else mode


def description_of(mode: str) -> str:
    """Return what a mode does for the motion, in one sentence without a full stop."""
    return MODES[mode].description if mode in MODES else OTHER_DESCRIPTION


def name_of_other(stem: str) -> str:
    """Return the name of somebody else's motion, by its file: safe as that of a table, and unlike any other there."""
    return folder_names([*MODES, "keys", stem.replace(".", "_")])[-1]
