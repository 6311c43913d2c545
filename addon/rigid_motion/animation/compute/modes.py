"""The numbers that modes have in channels and files, and their names."""

from __future__ import annotations

from ...motion import KEYFRAME_MODES

MODE_NUMBERS = {"BLENDER": 0, **{name: mode.number for name, mode in KEYFRAME_MODES.items()}}
"""The modes, and what the mode channel and saved files have for each. 0 is Blender's own in-betweens."""

MODE_IDS = tuple(MODE_NUMBERS)
"""The names of the modes."""

MODE_NAMES = {number: name for name, number in MODE_NUMBERS.items()}
"""From the number of a mode to its name."""

DEPENDS_ON_KEYS = [MODE_NUMBERS[name] for name in ("pga_lerp", "cga_lerp", "motor_spline")]
"""The modes whose path would be another one with a key more on it."""

UNKNOWN = -1
"""The mode of something from a file that is damaged, or of a later version."""
