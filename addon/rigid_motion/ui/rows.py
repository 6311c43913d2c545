"""Rows of a panel that are aligned with one another: a narrow label, and to the right of it what belongs to it.

Blender's own split gives labels two fifths of the width, and cuts the names of modes off in a sidebar as it opens.
"""

from __future__ import annotations

import blf
import bpy
from bpy.app.translations import pgettext_iface as iface_

from .wording import wrapped

LABEL = 0.28
"""The part of the width that labels have."""

MARGIN = 84
"""Pixels of a sidebar that text cannot have, at a resolution scale of 1: tabs, an icon, and the panel's edges."""


def labelled(layout: bpy.types.UILayout, label: str = "") -> bpy.types.UILayout:
    """Return the right-hand part of a row, with a label on the left, in the user's language."""
    split = layout.split(factor=LABEL)
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=label, translate=False)
    return split.row()


def draw_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: str) -> None:
    """Draw a text that is broken into as many lines as the region's width asks for."""
    system = context.preferences.system
    width = context.region.width - MARGIN * system.ui_scale
    blf.size(0, context.preferences.ui_styles[0].widget.points * system.ui_scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in wrapped(iface_(text), lambda line: blf.dimensions(0, line)[0] <= width):
        column.label(text=line, icon=icon, translate=False)
        icon = "BLANK1"
