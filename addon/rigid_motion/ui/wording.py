"""The words of the interface: names of modes, notes on a segment, summaries, and lines of a panel.

Lines are aligned with one another: a narrow label, and to the right of it what belongs to it. Blender's own split gives
labels two fifths of the width, and cuts the names of modes off in a sidebar as it opens.
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
"""Each mode as menus show it. Translated as `OWN_WORDS`: Blender has another Screw."""

NATIVE_LABEL = "Native Curves"
"""What is in place of a mode where keys are reduced without any. Translated as these."""

DESCRIPTIONS = {name: description for name, _, description, _ in MODE_ITEMS}
"""The effect of each mode on the motion, in one sentence without a full stop."""

LABEL_WIDTH_RATIO = 0.28
"""The part of the width that labels have."""

SIDEBAR_MARGIN_PX = 84
"""Pixels of a sidebar that text cannot have, at a resolution scale of 1: tabs, an icon, and the panel's edges."""


def twin_of(mode: str, *, grows: bool) -> str:
    """Return the mode that makes the same motion and that lists show in its place, "" for one that is its own."""
    one = KEYFRAME_MODES.get(mode)
    if one is None or not one.twin or (grows and one.curves is not KEYFRAME_MODES[one.twin].curves):
        return ""
    return one.twin


def degrees(angle: float) -> str:
    """Return an angle in radians, to be read."""
    return f"{math.degrees(angle):.1f}°"


def turn_text(segment: SegmentFacts) -> str:
    """Return by how much a segment turns, to be read: in turns where there are whole ones, else in degrees."""
    if not segment.turns:
        return degrees(segment.turn)
    return iface_("{turns} turns").format(turns=f"{segment.turn / math.tau:.3g}")


def length(scene: bpy.types.Scene, units: float, precision: int = 4) -> str:
    """Return a length in Blender's units, to be read in those of the scene."""
    settings = scene.unit_settings
    if settings.system == "NONE":
        return f"{units:.{precision}g}"
    return bpy.utils.units.to_string(settings.system, "LENGTH", units * settings.scale_length, precision=precision)


def reduction_summary(scene: bpy.types.Scene, reduction: Reduction) -> str:
    """Return what became of the keys of a target."""
    error = length(scene, reduction.largest_error, precision=3)
    text = rpt_("{before} keys became {after}, largest error {error}")
    _, _, *rows = reduction_rows(scene, reduction)
    more = (f"{label}: {text}" for label, text in rows)
    return "; ".join((text.format(before=reduction.before, after=reduction.after, error=error), *more))


def reduced_to(scene: bpy.types.Scene, reduction: Reduction) -> str:
    """Return how many keys became how many, and how far off the motion is, for a line of a panel."""
    became = f"{reduction.before} \N{RIGHTWARDS ARROW} {reduction.after}"
    error = length(scene, reduction.largest_error, precision=3)
    return iface_("{keys}, {error} off").format(keys=became, error=error)


def hold_lines(reduction: Reduction | None) -> list[str]:
    """Return in what something is held since its keys were reduced, a line for each time, in the user's language."""
    text = iface_("{holder} from {first:g} to {last:g}: {before} keys became 1")
    return [
        text.format(holder=holder, first=first, last=last, before=before)
        for holder, first, last, before in (() if reduction is None else reduction.held)
    ]


def reduction_rows(scene: bpy.types.Scene, reduction: Reduction | None) -> list[tuple[str, str]]:
    """Return what became of keys, and of the rig where it is one, as labels and what belongs to them."""
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
            # What follows constraints or drivers is somewhere else than its keys say.
            rows.append((iface_("Not Promised", OWN_WORDS), listed(bones)))
    return rows


def listed(items: Sequence[str], most: int = 3) -> str:
    """Return a list that fits into a line."""
    rest = len(items) - most
    return ", ".join(items[:most]) + (rpt_(" and {count} more").format(count=rest) if rest > 0 else "")


def names_of(targets: Sequence[Transform]) -> str:
    """Return one target by its name, several by their number."""
    if len(targets) == 1:
        return targets[0].name
    are_parts = {target.is_part for target in targets}
    text = n_("{count} bones") if are_parts == {True} else n_("{count} objects")
    return rpt_(text if len(are_parts) == 1 else n_("{count} objects and bones")).format(count=len(targets))


def wrapped(text: str, fits: Callable[[str], bool]) -> list[str]:
    """Return the lines of a text, broken between words. A word that does not fit gets a line of its own."""
    lines: list[str] = []
    for word in text.split():
        if lines and fits(f"{lines[-1]} {word}"):
            lines[-1] += f" {word}"
        else:
            lines.append(word)
    return lines


def split(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Return the layout, which then has labels to the left of properties, and no dots to animate them by."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    return layout


def labelled(layout: bpy.types.UILayout, label: str = "") -> bpy.types.UILayout:
    """Return the right-hand part of a row, with a label on the left, in the user's language."""
    split = layout.split(factor=LABEL_WIDTH_RATIO)
    left = split.row()
    left.alignment = "RIGHT"
    left.label(text=label, translate=False)
    return split.row()


def draw_text(context: bpy.types.Context, layout: bpy.types.UILayout, text: str, icon: Any) -> None:
    """Draw a text that is broken into as many lines as the region's width asks for."""
    system = existing(context.preferences).system
    width = existing(context.region).width - SIDEBAR_MARGIN_PX * system.ui_scale
    blf.size(0, existing(context.preferences).ui_styles[0].widget.points * system.ui_scale)
    column = layout.column(align=True)
    column.scale_y = 0.8
    for line in wrapped(iface_(text), lambda line: blf.dimensions(0, line)[0] <= width):
        column.label(text=line, icon=icon, translate=False)
        icon = "BLANK1"
