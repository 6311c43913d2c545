"""Proportional Editing of keys on paths: neighbours of a moved key follow it, less with more frames between them.

It uses frames instead of distance, as the Dope Sheet does, and its settings. Where a path crosses itself or rests, keys
are side by side that have nothing to do with one another.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_

from ...blender import scene

RANGE_FACTOR = 1.2
"""Factor by which a step of the wheel multiplies or divides the range."""

LARGER, SMALLER = {"WHEELDOWNMOUSE", "PAGE_UP"}, {"WHEELUPMOUSE", "PAGE_DOWN"}
"""Events that change the range, as in Blender's own transforms."""

FALLOFFS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "SMOOTH": lambda near: near * near * (3.0 - 2.0 * near),
    "SPHERE": lambda near: np.sqrt(near * (2.0 - near)),
    "ROOT": np.sqrt,
    "INVERSE_SQUARE": lambda near: near * (2.0 - near),
    "SHARP": np.square,
    "LINEAR": np.asarray,
    "CONSTANT": np.ceil,
    "RANDOM": lambda near: near * np.random.default_rng(0).random(near.shape),
}
"""Weights by Blender's names of falloffs, from 1 at the moved keys to 0 at the end of the range."""


def settings() -> Any:
    """Return the settings of Proportional Editing."""
    return scene().tool_settings


def reach() -> float:
    """Return the range in frames, 0 if it is switched off."""
    return float(settings().proportional_size) if settings().use_proportional_action else 0.0


def falloff(away: np.ndarray, within: float) -> np.ndarray:
    """Return the weights (n,) of keys, by their distances in frames to moved keys: 1 for the moved ones."""
    near = np.clip(1.0 - away / within, 0.0, 1.0) if within > 0.0 else np.zeros(away.shape)
    return np.where(away > 0.0, FALLOFFS[settings().proportional_edit_falloff](near), 1.0)


def change(event: bpy.types.Event) -> bool:
    """Handle an event that toggles it or changes its range; return whether it was one."""
    tools = settings()
    if event.type == "O":
        tools.use_proportional_action = not tools.use_proportional_action
    elif tools.use_proportional_action and event.type in LARGER:
        tools.proportional_size *= RANGE_FACTOR
    elif tools.use_proportional_action and event.type in SMALLER:
        tools.proportional_size /= RANGE_FACTOR
    else:
        return False
    return True


def text() -> str:
    """Return the text for the header, empty if it is switched off."""
    if not reach():
        return ""
    tools = settings()
    name = tools.bl_rna.properties["proportional_edit_falloff"].enum_items[tools.proportional_edit_falloff].name
    return iface_("Proportional ({falloff}): {frames:.3g} frames").format(falloff=iface_(name), frames=reach())
