"""What is seen on the screen in the terms of what an animator keys: properties with the in-betweens worked in."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from mathutils import Quaternion

from ..compute.components import LOCATION, ROTATION, ROWS, SCALE
from ..transforms import Transform, rotation_of, set_rotation
from ..writers.table import writer_of


def shown_components(transform: Transform) -> np.ndarray | None:
    """Return how a transform is seen now, in the terms of what an animator keys.

    Returns
    -------
    array, shape (10,), or None
        What its properties would have to be for it to look as it does with its original difference alone: location,
        rotation as it turns (quaternion or Euler angles), scale. None where nothing is on top of them.

    Raises
    ------
    Refused
        Where it turns by axis and angle.
    """
    differences = writer_of(transform).shown_differences(transform)
    if not differences:
        return None
    seen = transform.components()
    for difference, parts in differences:
        seen = visible_components(seen, transform.original(), difference, transform.order, parts)
    return seen


def visible_components(
    components: np.ndarray, original: np.ndarray, difference: np.ndarray, order: str | None, parts: Collection[str]
) -> np.ndarray:
    """Return what the properties would have to be to look the same with the original difference alone.

    Parameters
    ----------
    components : array, shape (10,)
        What the properties are.
    original : array, shape (10,)
        The difference without in-betweens: rotation as a unit quaternion.
    difference : array, shape (10,)
        The one that there is: rotation as the properties have it.
    order : str or None
        Of Euler angles, or None for quaternions.
    parts : collection of str
        Which of location, rotation and scale in-betweens are in. The others stay what they are, to the last bit.

    Returns
    -------
    array, shape (10,)
    """
    seen = components.copy()
    location, scale = ROWS[LOCATION], ROWS[SCALE]
    if LOCATION in parts:
        seen[location] += difference[location] - original[location]
    if SCALE in parts:
        seen[scale] *= difference[scale] / np.where(original[scale] == 0.0, 1.0, original[scale])
    if ROTATION in parts:
        taken_off, added = Quaternion(original[ROWS[ROTATION]]).inverted(), rotation_of(difference, order).normalized()
        set_rotation(seen, order, taken_off @ added @ rotation_of(components, order), components)
    return seen
