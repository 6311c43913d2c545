"""The panel *Held In* of the sidebar: the holder of an object, its passes to other holders, and warnings."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from ..animation import HoldFacts, hold_facts, reduction_of
from ..animation.actions.channels import key_points
from ..animation.actions.slots import active_fcurves
from ..animation.evaluation.components import SCALE
from ..animation.holds.dependencies import follows, node_of
from ..animation.holds.holders import Holder
from ..animation.holds.placing import unevenness_of
from ..animation.transforms import OWN_WORDS, Transform, prefix_of
from .holding import PASS_PROPERTY, RIGID_MOTION_MT_holders, has_been_held, icon_of, name_of, shown_prop
from .wording import degrees, draw_text, hold_lines, labelled, length

FAR_TURNED = math.radians(120)
"""Radians: a pass that turns by more than this is near a half turn, so its direction is hard to predict."""

MAX_TOUCHING_DISTANCE = 1e-5
"""Hands closer than this, in Blender's units, are at the same place in single precision."""

MAX_SCALE_ROUNDING = 1e-4
"""Scales that differ by less than this count as equal."""


UNEVEN = n_(
    "{holder} is scaled unevenly: what passes to it is sheared until it arrives. "
    "Apply that scale, or pass over 0 frames"
)


def draw(context: Any, layout: Any) -> None:
    """Draw the holder of the selection in a panel."""
    prop = shown_prop(context)
    if prop is None:
        return
    try:
        facts = hold_facts(prop)
    except ValueError as refusal:
        draw_text(context, layout, str(refusal), "ERROR")
        return
    row: Any = labelled(layout, prop.carrier.name)
    row.menu(RIGID_MOTION_MT_holders.__name__, text=name_of(facts.now), icon=icon_of(facts.now), translate=False)
    if has_been_held(prop):
        _draw_passing(context, layout, facts)
        row = layout.row(align=True)
        row.operator("rigid_motion.hold_in")
        row.operator("rigid_motion.match_grip")
        row.operator("rigid_motion.let_go")
    else:
        layout.operator("rigid_motion.hold_in")
    layout.operator("rigid_motion.reduce_into_holds")
    for line in hold_lines(reduction_of([prop])):
        layout.label(text=line, icon="CON_CHILDOF", translate=False)
    for caution in cautions(prop, facts):
        draw_text(context, layout, caution, "ERROR")


def _draw_passing(context: Any, layout: Any, facts: HoldFacts) -> None:
    if facts.switch is not None:
        row: Any = labelled(layout, iface_("Pass", OWN_WORDS))
        row.prop(context.scene, PASS_PROPERTY, text="")
        row.label(text=iface_("at {frame:g}").format(frame=facts.switch), translate=False)
    if apart := apart_text(context.scene, facts):
        labelled(layout).label(text=apart, translate=False)


def apart_text(scene: bpy.types.Scene, facts: HoldFacts) -> str:
    """Return how far apart both hands carry the object on the frame of a pass, "" on other frames."""
    if facts.apart is None or facts.turned is None or facts.switch is None:
        return ""
    apart = length(scene, facts.apart if facts.apart > MAX_TOUCHING_DISTANCE else 0.0, precision=2)
    return iface_("Hands {distance}, {angle} apart at {frame:g}").format(
        distance=apart, angle=degrees(facts.turned), frame=facts.switch
    )


def cautions(prop: Transform, facts: HoldFacts) -> Iterator[str]:
    """Yield warnings about a held object, and remedies."""
    if facts.turned is not None and facts.frames and facts.turned > FAR_TURNED:
        yield iface_("It rotates by {angle} while it passes, in either direction. Rotate a hand, or Match Grip").format(
            angle=degrees(facts.turned)
        )
    for holder in facts.holders:
        if holder.target is None:
            continue
        if follows((holder.target, holder.bone), node_of(prop)):
            yield iface_("{holder} now follows {name}, which it holds: a cycle. Remove that from {holder}").format(
                holder=holder.name, name=prop.name
            )
        if _has_scale_animation(holder):
            yield iface_("{holder} has keys of its scale: what it holds grows and shrinks with it").format(
                holder=holder.name
            )
        if facts.frames and unevenness_of(holder.offset) > MAX_SCALE_ROUNDING:
            yield iface_(UNEVEN).format(holder=holder.name)


def _has_scale_animation(holder: Holder) -> bool:
    """Return whether keys change the scale of a holder."""
    path = (prefix_of(holder.bone) if holder.bone else "") + SCALE
    curves = [] if holder.target is None else active_fcurves(holder.target)
    return any(
        fcurve.data_path == path
        and len(fcurve.keyframe_points) > 1
        and np.ptp(key_points(fcurve)[:, 1]) > MAX_SCALE_ROUNDING
        for fcurve in curves
    )
