"""F-curve modifiers: ours, which are the terms of in-betweens, and the animator's.

Terms are known by what they are, not by their names, which are the animator's to change: additive *Generators* of a
product of linear factors in a restricted range, of which the last factor is constant. Nothing in Blender makes such.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ..fcurves.keys import Cycles

CODES = {item.identifier: item.value for item in bpy.types.FModifier.bl_rna.properties["type"].enum_items}
"""The numbers of the types of modifiers."""


def has_type(fcurve: bpy.types.FCurve, kind: str) -> bool:
    """Return whether an F-curve has a modifier of a type, without a look at each of them."""
    types = np.empty(len(fcurve.modifiers), np.int32)
    fcurve.modifiers.foreach_get("type", types)
    return bool((types == CODES[kind]).any())


def is_term(modifier: bpy.types.FModifier) -> bool:
    """Return whether a modifier is one of ours."""
    return (
        modifier.type == "GENERATOR"
        and modifier.use_restricted_range
        and modifier.mode == "POLYNOMIAL_FACTORISED"
        and modifier.use_additive
        and modifier.coefficients[-2] == 0.0
    )


def terms_in(fcurve: bpy.types.FCurve) -> list[bpy.types.FModifierGenerator]:
    """Return the modifiers of an F-curve that are terms."""
    return [modifier for modifier in fcurve.modifiers if is_term(modifier)]


def has_terms(fcurve: bpy.types.FCurve) -> bool:
    """Return whether any of the modifiers of an F-curve is a term."""
    return any(map(is_term, fcurve.modifiers))


def on_top(fcurve: bpy.types.FCurve) -> Iterator[bpy.types.FModifier]:
    """Yield what comes on top of keys and terms: the animator's modifiers but for Cycles, as far as they have a say."""
    for modifier in fcurve.modifiers:
        if modifier.type != "CYCLES" and not modifier.mute and not is_term(modifier):
            yield modifier


def read_cycles(fcurve: bpy.types.FCurve) -> Cycles | None:
    """Return the Cycles of an F-curve: Blender has one only where it is the first of the modifiers."""
    modifiers = fcurve.modifiers
    if not modifiers or modifiers[0].type != "CYCLES" or modifiers[0].mute:
        return None
    first = modifiers[0]
    return Cycles(first.mode_before, first.mode_after, first.cycles_before, first.cycles_after)


def add_cycles(fcurve: bpy.types.FCurve, cycles: Cycles) -> None:
    """Give an F-curve Cycles like these, in front of all its other modifiers."""
    modifiers = fcurve.modifiers
    first = modifiers[0] if modifiers and modifiers[0].type == "CYCLES" else None
    if first is None:
        behind = list(modifiers)
        if not behind:
            first = modifiers.new("CYCLES")
        else:
            # Blender adds one behind others as no more than a wish, or not at all.
            copies = [(modifier.type, _settings_of(modifier)) for modifier in behind]
            for modifier in behind:
                modifiers.remove(modifier)
            first = modifiers.new("CYCLES")
            for kind, settings in copies:
                if kind != "CYCLES":
                    set_settings(modifiers.new(kind), settings)
    first.mute = False
    first.mode_before, first.mode_after = cycles.before, cycles.after
    first.cycles_before, first.cycles_after = cycles.before_count, cycles.after_count


def put_behind(fcurve: bpy.types.FCurve, modifier: bpy.types.FModifier) -> None:
    """Have one of the modifiers of an F-curve be the last. Blender has no way but to make it anew."""
    kind, settings = modifier.type, _settings_of(modifier)
    fcurve.modifiers.remove(modifier)
    set_settings(fcurve.modifiers.new(kind), settings)


def _settings_of(modifier: bpy.types.FModifier) -> dict[str, object]:
    """Return all plain properties of a modifier."""
    result = {}
    for prop in modifier.bl_rna.properties:
        if not prop.is_readonly and prop.type not in ("POINTER", "COLLECTION"):
            value = getattr(modifier, prop.identifier)
            result[prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return result


def set_settings(modifier: bpy.types.FModifier, settings: dict[str, object]) -> None:
    """Set properties of a modifier, those first that others depend on."""
    for name in sorted(settings, key=lambda name: (name != "mode", name != "poly_order", name != "frame_start")):
        setattr(modifier, name, settings[name])
