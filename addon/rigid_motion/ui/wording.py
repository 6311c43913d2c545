"""Texts of the interface: names of modes, lengths and angles, summaries, and aligned lines of a panel.

A line has a narrow label on the left and its value on the right. Blender's own split gives labels two fifths of the
width, and would cut off names of modes in a sidebar of default width.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import blf
import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_

from ..animation import Reduction
from ..animation.properties import MODE_ITEMS
from ..animation.queries.segments import SegmentFacts
from ..animation.transforms import OWN_WORDS, Transform
from ..blender import existing
from ..motion import KEYFRAME_MODES

LABELS = {name: label for name, label, *_ in MODE_ITEMS}
"""The label of each mode in menus. Translated in the context `OWN_WORDS`: Blender has another Screw."""

NATIVE_LABEL = "Native Curves"
"""The label used in place of a mode when keys are reduced without one. Same translation context."""

DESCRIPTIONS = {name: description for name, _, description, _ in MODE_ITEMS}
"""The effect of each mode on the motion, in one sentence without a full stop."""

LABEL_WIDTH_RATIO = 0.28
"""The labels' fraction of the width."""

SIDEBAR_MARGIN_PX = 84
"""The width of a sidebar that text cannot use, in pixels at a resolution scale of 1: tabs, an icon and margins."""


def twin_of(mode: str, *, grows: bool) -> str:
    """Return the mode that gives the same motion and replaces this one in lists, "" if there is none."""
    one = KEYFRAME_MODES.get(mode)
    if one is None or not one.twin or (grows and one.curves is not KEYFRAME_MODES[one.twin].curves):
        return ""
    return one.twin


def degrees(angle: float) -> str:
    """Return an angle in radians as text in degrees."""
    return f"{math.degrees(angle):.1f}°"


def turn_text(segment: SegmentFacts) -> str:
    """Return the rotation of a segment as text: in turns if it has whole turns, else in degrees."""
    if not segment.turns:
        return degrees(segment.turn)
    return iface_("{turns} turns").format(turns=f"{segment.turn / math.tau:.3g}")


def length(scene: bpy.types.Scene, units: float, precision: int = 4) -> str:
    """Return a length in Blender's units as text in the units of the scene."""
    settings = scene.unit_settings
    if settings.system == "NONE":
        return f"{units:.{precision}g}"
    return bpy.utils.units.to_string(settings.system, "LENGTH", units * settings.scale_length, precision=precision)


def reduction_summary(scene: bpy.types.Scene, reduction: Reduction) -> str:
    """Return a summary of a reduction."""
    error = length(scene, reduction.largest_error, precision=3)
    text = rpt_("{before} keys became {after}, largest error {error}")
    _, _, *rows = reduction_rows(scene, reduction)
    more = (f"{label}: {text}" for label, text in rows)
    return "; ".join((text.format(before=reduction.before, after=reduction.after, error=error), *more))


def reduced_to(scene: bpy.types.Scene, reduction: Reduction) -> str:
    """Return the number of keys before and after a reduction, and its error, for a line of a panel."""
    became = f"{reduction.before} \N{RIGHTWARDS ARROW} {reduction.after}"
    error = length(scene, reduction.largest_error, precision=3)
    return iface_("{keys}, {error} off").format(keys=became, error=error)


def hold_lines(reduction: Reduction | None) -> list[str]:
    """Return a line for each hold found by a reduction, in the user's language."""
    text = iface_("{holder} from {first:g} to {last:g}: {before} keys became 1")
    return [
        text.format(holder=holder, first=first, last=last, before=before)
        for holder, first, last, before in (() if reduction is None else reduction.held)
    ]


def reduction_rows(scene: bpy.types.Scene, reduction: Reduction | None) -> list[tuple[str, str]]:
    """Return the results of a reduction, also those of a rig, as pairs of label and text."""
    if reduction is None:
        return []
    error, between = (length(scene, off, precision=3) for off in (reduction.largest_error, reduction.between))
    text = iface_("{error} on frames") if reduction.between else iface_("{error} at most")
    rows = [
        (iface_("Keys", OWN_WORDS), f"{reduction.before} \N{RIGHTWARDS ARROW} {reduction.after}"),
        (iface_("Off By", OWN_WORDS), text.format(error=error)),
    ]
    if reduction.between:
        rows.append((iface_("Between", OWN_WORDS), iface_("{error} at most").format(error=between)))
    text = iface_("{count} keys with {mode}")
    others = [
        text.format(count=count, mode=iface_(LABELS.get(mode, NATIVE_LABEL), OWN_WORDS))
        for mode, count in reduction.needed.items()
        if mode != reduction.mode
    ]
    if others:
        rows.append((iface_("Instead", OWN_WORDS), ", ".join(others)))
    before, after = reduction.channel_keys
    if after > before:
        rows.append(
            (iface_("Channels", OWN_WORDS), iface_("{before} to {after} keys").format(before=before, after=after))
        )
    if reduction.rig is not None:
        rows.append((iface_("Frames", OWN_WORDS), iface_("{frames} with keys").format(frames=reduction.rig.frames)))
        if reduction.rig.slide_before > 0.0:
            slides = reduction.rig.slide_before, reduction.rig.slide_after
            before_slide, after_slide = (length(scene, slide, precision=2) for slide in slides)
            text = iface_("slide {after}, recorded {before}")
            rows.append((iface_("Feet", OWN_WORDS), text.format(after=after_slide, before=before_slide)))
        if bones := reduction.rig.not_promised:
            # Constraints or drivers move these bones away from their keys.
            rows.append((iface_("Not Promised", OWN_WORDS), listed(bones)))
    return rows


def listed(items: Sequence[str], most: int = 3) -> str:
    """Join items into a list short enough for one line."""
    rest = len(items) - most
    return ", ".join(items[:most]) + (rpt_(" and {count} more").format(count=rest) if rest > 0 else "")


def names_of(targets: Sequence[Transform]) -> str:
    """Return the name of a single target, or the number of several."""
    if len(targets) == 1:
        return targets[0].name
    are_parts = {target.is_part for target in targets}
    text = n_("{count} bones") if are_parts == {True} else n_("{count} objects")
    return rpt_(text if len(are_parts) == 1 else n_("{count} objects and bones")).format(count=len(targets))


def wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Break a text into lines between words. A word that does not fit gets a line of its own."""
    lines: list[str] = []
    for word in text.split():
        if lines and fits(f"{lines[-1]} {word}"):
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def split(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Give the layout labels to the left of properties and no keyframe buttons, and return it."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def labelled(layout: bpy.types.UILayout, label: str = "") -> bpy.types.UILayout:
    """Draw a label, already translated, and return the part of the row to the right of it."""
    split = layout.split(factor=LABEL_WIDTH_RATIO)
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=label, translate=False)
    return split.row()


def draw_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: Any) -> None:
    """Draw a text, broken into lines that fit the width of the region."""
    system = existing(context.preferences).system
    width = existing(context.region).width - SIDEBAR_MARGIN_PX * system.ui_scale
    blf.size(0, existing(context.preferences).ui_styles[0].widget.points * system.ui_scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in wrapped(iface_(text), lambda line: blf.dimensions(0, line)[0] <= width):
        column.label(text=line, icon=icon, translate=False)
        icon = "BLANK1"
