"""Problems with holding: why an object cannot be held as its keys say, in one sentence with the way out."""

from __future__ import annotations

from typing import cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ..actions.slots import Binding
from ..evaluation.components import REST_COMPONENTS
from ..evaluation.sources import KeyedTransform
from ..transforms import Refused, Transform
from .dependencies import follows, node_of
from .holders import channel_of, constraints_to, passings_in, spoken_of

MAX_VALUE_ROUNDING = 1e-5
"""Values that differ by less are equal except for rounding."""

ITSELF = n_("{name} cannot be held in itself: select its holder last, so that it is active")
CYCLE = n_("{name} cannot be held in {holder}, which follows it: {holder} would wait for itself")
REPEATS = n_("{name} repeats by Cycles, and cannot be held: bake the rounds to keys, or remove Cycles")
DELTAS = n_("{name} has delta transforms: apply them first (Object > Apply > All Deltas)")
ON_VERTICES = n_(
    "{name} hangs on vertices or the path of its parent: parent it to the object or a bone instead (Ctrl P)"
)
CONNECTED = n_("{name} is connected to its parent, which it cannot leave: disconnect it first (Alt P in Edit Mode)")
LACKS_HOLDER = n_(
    "The keys of {name} say that it is held from frame {frame:g} on, but not in what: hold it there again (Hold "
    "In), or undo the removal of its constraint"
)
GONE = n_("What held {name} is gone: choose a target in its constraint {constraint}, or hold it in something else")
MUTED = n_(
    "{name} is not held as its keys say, because its constraint {constraint} is muted: unmute it and its influence"
)


def refuse_holder(transform: Transform, target: bpy.types.Object, bone: str) -> None:
    """Raise `Refused` if a transform cannot be held in this object or bone."""
    if (target, bone) == node_of(transform):
        raise Refused(ITSELF, name=transform.name)
    if follows((target, bone), node_of(transform)):
        raise Refused(CYCLE, name=transform.name, holder=bone or target.name)


def refuse_motion(transform: Transform, source: KeyedTransform | None) -> None:
    """Raise `Refused` if a transform with these keys cannot be held in anything."""
    if source is not None and any(keys.cycles is not None for keys in source.curves):
        raise Refused(REPEATS, name=transform.name)
    refuse_space(transform)


def refuse_space(transform: Transform) -> None:
    """Raise `Refused` if constraints cannot reproduce a transform's channel space, or cannot move the transform."""
    if not np.allclose(transform.original(), REST_COMPONENTS, atol=MAX_VALUE_ROUNDING):
        raise Refused(DELTAS, name=transform.name)
    carrier, parent = transform.carrier, transform.animated.parent
    if isinstance(carrier, bpy.types.PoseBone):
        if carrier.bone.use_connect:
            raise Refused(CONNECTED, name=transform.name)
    elif parent is not None:
        goes_along_path = parent.type == "CURVE" and cast(bpy.types.Curve, parent.data).use_path
        if carrier.parent_type.startswith("VERTEX") or (carrier.parent_type != "BONE" and goes_along_path):
            raise Refused(ON_VERTICES, name=transform.name)


def refuse_holds(transform: Transform, binding: Binding, source: KeyedTransform) -> None:
    """Raise `Refused` if a transform is not held as its keys in a slot say."""
    held, passed = spoken_of(source)
    if not held:
        return
    refuse_motion(transform, source)
    holding, passings = constraints_to(transform), passings_in(transform, binding.slot.action)
    for number, frame in held.items():
        constraint = holding.get(number)
        if constraint is None:
            raise Refused(LACKS_HOLDER, name=transform.name, frame=frame)
        target, bone = constraint.target, constraint.subtarget
        if target is None or (bone and (target.pose is None or bone not in target.pose.bones)):
            raise Refused(GONE, name=transform.name, constraint=constraint.name)
        refuse_holder(transform, target, bone)
    ours = [*map(holding.get, held), *(item for number, item in passings.items() if number in passed)]
    for constraint in filter(None, ours):
        influence = binding.curves.get(channel_of(transform, constraint))
        if constraint.mute or (influence is not None and influence.mute):
            raise Refused(MUTED, name=transform.name, constraint=constraint.name)
