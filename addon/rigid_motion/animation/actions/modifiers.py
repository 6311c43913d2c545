"""F-curve modifiers: the terms that this extension adds for in-betweens, and the animator's own modifiers.

Terms are recognised by their settings, not by their names, which the animator may change: additive *Generators* with a
product of linear factors in a restricted range, whose last factor is constant. Nothing in Blender creates any.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import dropwhile
from typing import Any, TypeGuard, cast

import bpy
import numpy as np

from ...blender import existing
from ..fcurves.keys import Cycles


def is_term(modifier: bpy.types.FModifier) -> TypeGuard[bpy.types.FModifierGenerator]:
    """Return whether a modifier is a term."""
    return (
        isinstance(modifier, bpy.types.FModifierGenerator)
        and modifier.use_restricted_range
        and modifier.mode == "POLYNOMIAL_FACTORISED"
        and modifier.use_additive
        and cast(Any, modifier.coefficients)[-2] == 0.0
    )


def terms_in(fcurve: bpy.types.FCurve) -> list[bpy.types.FModifierGenerator]:
    """Return the modifiers of an F-curve that are terms."""
    return [modifier for modifier in fcurve.modifiers if is_term(modifier)]


def has_terms(fcurve: bpy.types.FCurve) -> bool:
    """Return whether any of the modifiers of an F-curve is a term."""
    return any(map(is_term, fcurve.modifiers))


def on_top(fcurve: bpy.types.FCurve) -> Iterator[bpy.types.FModifier]:
    """Yield modifiers that act on top of keys and terms: the animator's unmuted modifiers other than Cycles."""
    for modifier in fcurve.modifiers:
        if modifier.type != "CYCLES" and not modifier.mute and not is_term(modifier):
            yield modifier


def longest_step(fcurve: bpy.types.FCurve) -> float:
    """Return the largest distance, in frames, at which the Stepped modifiers of an F-curve sample another frame."""
    stepped = (item for item in fcurve.modifiers if isinstance(item, bpy.types.FModifierStepped) and not item.mute)
    return float(sum(item.frame_step for item in stepped))


def misplaced(fcurve: bpy.types.FCurve) -> list[bpy.types.FModifier]:
    """Return the animator's modifiers that must come behind all terms to act on the visible motion, and any after them.

    Empty if no terms follow them. Modifiers that step time or add values work as well in front of terms.
    """
    behind = list(dropwhile(lambda item: is_term(item) or _commutes(item), fcurve.modifiers))
    return [item for item in behind if not is_term(item)] if any(map(is_term, behind)) else []


def settings_of_others(fcurve: bpy.types.FCurve) -> tuple[float, int]:
    """Return what terms depend on in the animator's modifiers: `longest_step`, and the number of `misplaced`."""
    kinds = np.empty(len(fcurve.modifiers), np.int32)
    fcurve.modifiers.foreach_get("type", kinds)
    # Inspecting each of many terms is slow.
    return (longest_step(fcurve), len(misplaced(fcurve))) if len(set(kinds.tolist())) > 1 else (0.0, 0)


def _commutes(modifier: bpy.types.FModifier) -> bool:
    if isinstance(modifier, bpy.types.FModifierNoise):
        return modifier.blend_type != "MULTIPLY"
    if isinstance(modifier, bpy.types.FModifierFunctionGenerator):
        return modifier.use_additive
    return modifier.type in ("CYCLES", "STEPPED")


def read_cycles(fcurve: bpy.types.FCurve) -> Cycles | None:
    """Return the Cycles of an F-curve: Blender honours it only as the first modifier."""
    first = fcurve.modifiers[0] if fcurve.modifiers else None
    return cycles_of(first) if isinstance(first, bpy.types.FModifierCycles) and not first.mute else None


def cycles_of(modifier: bpy.types.FModifierCycles) -> Cycles:
    return Cycles(modifier.mode_before, modifier.mode_after, modifier.cycles_before, modifier.cycles_after)


def add_cycles(fcurve: bpy.types.FCurve, cycles: Cycles) -> None:
    """Give an F-curve these Cycles, in front of all its other modifiers."""
    modifiers = fcurve.modifiers
    if not modifiers or modifiers[0].type != "CYCLES":
        # Behind other modifiers, Blender adds one that has no effect, or none at all.
        behind = [_settings_of(modifier) for modifier in modifiers if modifier.type != "CYCLES"]
        for modifier in list(modifiers):
            modifiers.remove(modifier)
        modifiers.new("CYCLES")
        for settings in behind:
            _add_modifier(fcurve, settings)
    modes = {"mode_before": cycles.before, "mode_after": cycles.after}
    counts = {"cycles_before": cycles.before_count, "cycles_after": cycles.after_count}
    set_settings(modifiers[0], {"mute": False, **modes, **counts})


def copy_modifier(modifier: bpy.types.FModifier, fcurve: bpy.types.FCurve) -> None:
    """Append a copy of a modifier to an F-curve."""
    _add_modifier(fcurve, _settings_of(modifier))


def put_behind(fcurve: bpy.types.FCurve, modifier: bpy.types.FModifier) -> None:
    """Move one of the modifiers of an F-curve to the end. Blender offers no way but to recreate it."""
    settings = _settings_of(modifier)
    fcurve.modifiers.remove(modifier)
    _add_modifier(fcurve, settings)


def _add_modifier(fcurve: bpy.types.FCurve, settings: Mapping[str, Any]) -> None:
    modifier = existing(fcurve.modifiers.new(settings["type"]))
    set_settings(modifier, settings)
    if isinstance(modifier, bpy.types.FModifierEnvelope):
        for point in settings["control_points"]:
            set_settings(existing(modifier.control_points.add(point["frame"])), point)


def _settings_of(modifier: bpy.types.FModifier) -> dict[str, Any]:
    settings = {"type": modifier.type, **settings_of(modifier)}
    if isinstance(modifier, bpy.types.FModifierEnvelope):
        settings["control_points"] = [settings_of(point) for point in modifier.control_points]
    return settings


def settings_of(item: bpy.types.bpy_struct) -> dict[str, Any]:
    """Return all writable plain properties of an F-curve or a modifier."""
    result = {}
    for prop in item.bl_rna.properties:
        if not prop.is_readonly and prop.type not in ("POINTER", "COLLECTION"):
            value = getattr(item, prop.identifier)
            result[prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return result


def set_settings(item: bpy.types.bpy_struct, settings: Mapping[str, Any]) -> None:
    """Set plain properties, beginning with those that others depend on."""
    names = (name for name in settings if name not in ("type", "control_points"))
    for name in sorted(names, key=lambda name: (name != "mode", name != "poly_order", name != "frame_start")):
        setattr(item, name, settings[name])
