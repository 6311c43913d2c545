"""The modes of a comparison, and the reference that they are compared with: Blender's own curves."""

from __future__ import annotations

from rigid_motion.motion import KEYFRAME_MODES, MODES
from rigid_motion_batch.recordings.clip_reading import folder_names

REFERENCE = "bezier"
"""The mode that others are compared with by default: Blender's own curves, which animators have anyway."""

STATE_OF_THE_ART = "lerp_slerp"
"""The mode that the paper compares its modes with; most game engines use it."""

COMPARED = (REFERENCE, *KEYFRAME_MODES)
"""The modes that are compared by default."""


OTHER_DESCRIPTION = "A motion that was given with --against, as its own samples have it; its keys are not known"


def label_of(mode: str) -> str:
    """Return the label of a mode."""
    return MODES[mode].label if mode in MODES else mode


def description_of(mode: str) -> str:
    """Return a description of a mode: one sentence without a full stop."""
    return MODES[mode].description if mode in MODES else OTHER_DESCRIPTION


def name_of_other(stem: str) -> str:
    """Return the name of a motion from --against, from its file name: safe and unique as the name of a table."""
    return folder_names([*MODES, "keys", stem.replace(".", "_")])[-1]
