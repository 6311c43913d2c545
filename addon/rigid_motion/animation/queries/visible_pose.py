"""What is seen on the screen in the terms of what an animator keys: properties with the in-betweens worked in."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from mathutils import Euler, Quaternion

from ..compute.components import LOCATION, ROTATION, ROWS, SCALE
from ..transforms import Transform
from ..writers.table import shown_differences


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
    differences = shown_differences(transform)
    if not differences:
        return None
    seen = transform.components()
    order = None if transform.rotation == "rotation_quaternion" else transform.carrier.rotation_mode
    for difference, parts in differences:
        seen = visible_components(seen, transform.original(), difference, order, parts)
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
    location, rotation, scale = ROWS[LOCATION], ROWS[ROTATION], ROWS[SCALE]
    if LOCATION in parts:
        seen[location] += difference[location] - original[location]
    if SCALE in parts:
        seen[scale] *= difference[scale] / np.where(original[scale] == 0.0, 1.0, original[scale])
    if ROTATION in parts:
        taken_off = Quaternion(original[rotation]).inverted()
        if order is None:
            turned = Quaternion(components[rotation])
            quaternion = taken_off @ Quaternion(difference[rotation]).normalized() @ turned
            seen[rotation] = -quaternion if quaternion.dot(turned) < 0.0 else quaternion
        else:
            angles = Euler(components[3:6], order)
            added = Euler(difference[3:6], order).to_quaternion()
            seen[3:6] = (taken_off @ added @ angles.to_quaternion()).to_euler(order, angles)
    return seen
