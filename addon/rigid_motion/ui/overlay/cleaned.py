"""Result of *Clean Motion* in the viewport while its redo panel is open: paths before and after, and the spikes."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import bpy
import numpy as np

from ...animation import Cleaning
from ...blender import persistent
from ...handlers import append_drawing, append_handlers, remove_drawing, remove_handlers
from .drawing import TICK_DIAMETER_PX, Pen, batch_of, blended, drawn

OPERATOR = "RIGID_MOTION_OT_clean_motion"

_cleanings: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
"""Paths before and after (t, m, 3), and True for their places that were bridged (t, m)."""


def show(cleanings: Iterable[Cleaning]) -> None:
    """Show these results instead of all others from the next redraw on.

    Of a rig, only bones without cleaned children are shown.
    """
    _cleanings.clear()
    for one in cleanings:
        above = {item.carrier.parent for item in one.transforms if item.is_part}
        ends = np.array([item.carrier not in above for item in one.transforms])
        _cleanings.append((one.before[ends], one.after[ends], one.bridged[ends]))


@drawn
def draw() -> None:
    operators = cast(Any, bpy.context.window_manager).operators
    if not _cleanings or not operators or operators[-1].bl_idname != OPERATOR:
        return
    pen = Pen(bpy.context)
    with blended():
        for before, after, bridged in _cleanings:
            for lines, color in ((before, pen.look.native_color), (after, pen.look.mode_color)):
                for line in lines:
                    pen.line(batch_of("LINE_STRIP", line), color, 0.6 * pen.look.line_width)
            pen.dot(batch_of("POINTS", before[bridged]), pen.look.key_color, TICK_DIAMETER_PX)


@persistent
def _forget(*_: object) -> None:
    _cleanings.clear()


HANDLERS = {"undo_post": _forget, "load_post": _forget}


def register() -> None:
    append_handlers(HANDLERS)
    append_drawing(bpy.types.SpaceView3D, draw)


def unregister() -> None:
    remove_drawing(bpy.types.SpaceView3D, draw)
    remove_handlers(HANDLERS)
    _cleanings.clear()
