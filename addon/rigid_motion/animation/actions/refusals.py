"""Refusals: every reason why rigid motion cannot act on something, and the way out of each."""

from __future__ import annotations

from collections.abc import Collection

import bpy
import numpy as np
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_n as n_

from ...blender import enum_value
from ..evaluation.components import UNKNOWN_MODE
from ..evaluation.sources import KeyedTransform
from ..fcurves.keys import MAX_NUMBER, Keys
from ..transforms import LINKED_REFUSAL, WIDTHS, Channel, Refused, Transform, channels_under, rotation_by
from .modifiers import on_top
from .slots import Binding

MOST_FRAMES = 250_000
"""The longest motion with in-betweens, in frames: two hours and a quarter at 30 frames a second."""

MOST_TURNS = 1000
"""The largest number of whole turns from one key to the next."""

ENVELOPE_MODIFIER = enum_value(bpy.types.FModifier, "type", "ENVELOPE")
"""The code of this modifier type."""

ENVELOPED_CHANNEL = n_(
    "{name}: {channel} has an Envelope modifier, which does not work with modes: mute or remove it, or bake the "
    "channel (Graph Editor, Channel)"
)
DIFFERENT_CYCLES = n_(
    "{name} repeats, but its channels differ: give all of them first and last keys on the same frames, and Cycles "
    "with Key > Rigid Motion > Add Cycles"
)
OTHER_ROUNDS = n_(
    "{name} ends with another rotation or scale than it begins with, and cannot continue from there in one mode: "
    "choose Repeat or Mirror"
)
CHANGED_BY_MODIFIERS = n_(
    "{name} has other F-curve modifiers: mute them while you reduce its keys, or bake them into the keys first"
)
MOVING_DELTA = n_(
    "{name}: {channel} is animated on top of the rotation of the in-betweens: move that animation to a parent"
)
DRIVEN_CHANNEL = n_("{name}: {channel} is driven: remove the driver, or bake it to keys")
SILENT_CHANNEL = n_(
    "{name}: {channel} is muted, or has samples instead of keys: unmute it, convert them to keys (Graph Editor, "
    "Channel > Samples to Keys), or delete it first"
)
TOO_LONG = n_(
    "{name} needs in-betweens on {frames:.0f} frames, and {most} is the limit: delete distant keys, or, if it "
    "continues beyond its keys, shorten the scene or choose constant extrapolation"
)
NOT_FINITE = n_(
    "{name}: a property or a delta transform is not a finite number: set it again (sidebar, Item, or Object "
    "Properties, Delta Transform)"
)
BAD_KEY = n_(
    "{name}: key {number} of {channel} has an invalid frame, value, handle or easing: delete it, or move it and "
    "back (Dope Sheet, X or G)"
)
LAYERED = n_("{name} has a layer: pose and key it, or merge it first (Merge Layer)")
NO_SUCH_MODE = n_("{name}: its keys have a mode that is unknown to this version: choose another one")
NO_SUCH_TURNS = n_(
    "{name}: key {number} of the channel Turns is not a number of turns up to {most}: delete it (Dope Sheet, X), or"
    " set the turns again"
)


def refuse_drivers(user: Transform, binding: Binding, driven: Collection[int]) -> None:
    """Raise `Refused` if any of these components of a user, given by rows, is driven, muted or sampled."""
    for channel in (user.channels[row] for row in sorted(driven)):
        fcurve = binding.curves.get(channel)
        is_silent = fcurve is not None and (fcurve.mute or len(fcurve.sampled_points))
        raise Refused(SILENT_CHANNEL if is_silent else DRIVEN_CHANNEL, name=user.name, channel=_label(*channel))


def refuse_layered(user: Transform) -> None:
    """Raise `Refused` if a user moves by an offset layer."""
    if user.motion.base is not None:
        raise Refused(LAYERED, name=user.name)


def refuse_linked(user: Transform, binding: Binding | None = None) -> None:
    """Raise `Refused` if the user, or the Action that moves it, belongs to another file."""
    if not user.animated.is_editable:
        raise Refused(LINKED_REFUSAL, name=user.animated.name)
    if binding is not None and not binding.slot.is_editable:
        raise Refused(LINKED_REFUSAL, name=binding.slot.action.name)


def refuse_moving_deltas(user: Transform, binding: Binding, drivers: Collection[Channel]) -> None:
    """Raise `Refused` if a delta rotation on top of a user's channels is animated: its pose is no rigid motion then."""
    path = f"delta_{user.rotation}"
    for index in range(0 if user.is_part else WIDTHS[user.rotation]):
        fcurve = binding.curves.get((path, index))
        if (path, index) in drivers or (fcurve is not None and not fcurve.mute and not fcurve.is_empty):
            raise Refused(MOVING_DELTA, name=user.name, channel=_label(path, index))


def refuse_envelope(name: str, fcurve: bpy.types.FCurve) -> None:
    """Raise `Refused` if a channel has an Envelope modifier, which terms cannot be put in front of."""
    types = np.empty(len(fcurve.modifiers), np.int32)
    # Inspecting each modifier would take longer than all else.
    fcurve.modifiers.foreach_get("type", types)
    if any(not fcurve.modifiers[number].mute for number in np.flatnonzero(types == ENVELOPE_MODIFIER).tolist()):
        raise Refused(ENVELOPED_CHANNEL, name=name, channel=_label(fcurve.data_path, fcurve.array_index))


def refuse_tolerance(tolerance: float) -> None:
    """Raise `Refused` unless a tolerance is a finite number above zero."""
    if not 0.0 < tolerance < np.inf:
        raise Refused(n_("the tolerance must be a number above zero, not {tolerance:g}"), tolerance=tolerance)


def refuse_modified(name: str, binding: Binding) -> None:
    """Raise `Refused` if modifiers or layers change the effect of keys, so that other keys would not give the same."""
    for user in binding.users:
        refuse_layered(user)
    if any(any(on_top(fcurve)) for fcurve in binding.curves.values()):
        raise Refused(CHANGED_BY_MODIFIERS, name=name)


def refuse_numbers(name: str, source: KeyedTransform) -> None:
    """Raise `Refused` if the numbers of a source give no motion, or one that is too long."""
    if np.any(source.modes_at(source.keyed_frames) == UNKNOWN_MODE) if source.channels else source.mode == UNKNOWN_MODE:
        raise Refused(NO_SUCH_MODE, name=name)
    if (turns := source.turns) is not None:
        usable = (np.abs(turns.values[0]) <= MOST_TURNS) & np.isfinite(turns.times)
        if not usable.all():
            raise Refused(NO_SUCH_TURNS, name=name, number=int(np.argmin(usable)) + 1, most=MOST_TURNS)
    if not source.channels:
        return
    if not np.all(np.isfinite((*source.original, *source.rest.values()))):
        raise Refused(NOT_FINITE, name=name)
    for rows, keys in source.channels:
        if not keys.is_sound:
            _refuse_damaged_key(name, source.order, rows, keys)
    frames = np.ptp((source.keyed_range, source.seen_range) if source.is_linear else source.keyed_range, axis=-1).max()
    if frames > MOST_FRAMES:
        raise Refused(TOO_LONG, name=name, frames=frames, most=MOST_FRAMES)
    if source.is_live and not source.is_repeatable:
        rounds = {(keys.cycles, *keys.times[[0, -1]].tolist()) for keys in source.curves}
        raise Refused(OTHER_ROUNDS if len(rounds) == 1 else DIFFERENT_CYCLES, name=name)


def _refuse_damaged_key(name: str, order: str | None, rows: list[int], keys: Keys) -> None:
    """Raise `Refused` for the first key with invalid numbers, or on an earlier frame than the key before it."""
    settings = None if keys.easing_settings is None else np.moveaxis(keys.easing_settings, 0, -1)
    parts = [part for part in (keys.points, keys.left, keys.right, settings) if part is not None]
    # Comparisons with NaN are false, so NaN counts as damage, too.
    damaged = ~(np.abs(np.concatenate(parts, axis=-1)) < MAX_NUMBER).all(axis=-1)
    damaged[:, 1:] |= np.diff(keys.times) < 0.0
    channel, key = np.argwhere(damaged)[0].tolist()
    label = _label(*channels_under("", rotation_by(order))[rows[channel]])
    raise Refused(BAD_KEY, name=name, number=key + 1, channel=label)


def _label(path: str, index: int) -> str:
    """Return the name of a channel in the Dope Sheet."""
    name = path.rpartition(".")[2]
    axes = "WXYZ" if WIDTHS.get(name.removeprefix("delta_")) == 4 else "XYZ"
    return f"{iface_(bpy.types.Object.bl_rna.properties[name].name)} {axes[index]}"
