"""Components of a transform: their ten rows in arrays, and the numbers that stand for modes.

Components are location, rotation (a quaternion, three angles, or an angle and an axis) and scale.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ...motion import KEYFRAME_MODES

LOCATION, ROTATION, SCALE = "location", "rotation", "scale"
ROWS = {LOCATION: slice(0, 3), ROTATION: slice(3, 7), SCALE: slice(7, 10)}
"""The rows of each part in arrays with a row for each of the ten components. Euler angles leave row 6 unused."""

AXIS_ANGLE = "AXIS_ANGLE"
"""The order of rotations keyed as an angle about an axis, in rows 3 to 6."""

PART_OF = tuple(name for name, rows in ROWS.items() for _ in range(rows.start, rows.stop))
"""The part that each row is a component of."""

REST_COMPONENTS = np.array((0, 0, 0, 1, 0, 0, 0, 1, 1, 1), dtype=np.float64)
"""The components at rest. Rotations are quaternions unless they are channel values."""

MODE_NUMBERS = {"BLENDER": 0, **{name: mode.number for name, mode in KEYFRAME_MODES.items()}}
"""Mode names and their numbers, 0 for Blender's own in-betweens. The marks of keys store the number plus one."""

MODE_IDS = tuple(MODE_NUMBERS)
"""The names of the modes."""

MODE_NAMES = {number: name for name, number in MODE_NUMBERS.items()}
"""From the number of a mode to its name."""

DEPENDS_ON_KEYS = [MODE_NUMBERS[name] for name in ("pga_lerp", "cga_lerp", "motor_spline")]
"""The modes whose path changes if one more key is set on it."""

SMOOTH_MODES = [mode.number for mode in KEYFRAME_MODES.values() if mode.is_smooth]
"""The modes in which the keys next to a segment shape it."""

UNKNOWN_MODE = -1
"""The mode of keys in a damaged file, or one from a later version."""


def rows_left_to(driven: Collection[int]) -> set[int]:
    """Return the rows of components that no mode changes if these rows are driven or muted.

    A rotation or scale with any driven component is left alone as a whole.
    """
    parts = {PART_OF[row] for row in driven} - {LOCATION}
    return {row for row, part in enumerate(PART_OF) if row in driven or part in parts}
