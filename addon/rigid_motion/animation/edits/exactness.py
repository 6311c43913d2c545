"""Objects that are exact between frames: their differences move from delta transforms to a constraint, and back."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_rpt as rpt_

from ..actions.records import recorded, recorded_digest
from ..actions.refusals import refuse_linked
from ..actions.slots import bindings_for, bindings_of
from ..live import follower
from ..transforms import Refused, Transform, transform_of
from ..transforms.reaches import metres_per_channel_unit
from ..writers.filling import clear
from .apply import Targets, transforms_of


def set_exact(targets: Targets, is_exact: bool = True, *, refused: list[Refused] | None = None) -> None:
    """Have objects be exact between frames as well, by a constraint; or by delta transforms on whole frames alone.

    What moves by the same Action slot comes along.

    Parameters
    ----------
    targets : bpy.types.Object, or several of them
    is_exact : bool
    refused : list, optional
        Takes the refusals, and all others are changed.

    Raises
    ------
    Refused
        For what cannot be edited, where there is no list to take that. Nothing is changed then. Bones are exact anyway.
    """
    chosen, refusals = [], []
    for transform in transforms_of(targets):
        try:
            refuse_linked(transform)
            if transform.is_part:
                raise Refused(rpt_("{name} is a bone, and exact between frames anyway").format(name=transform.name))
            chosen.append(transform)
        except Refused as refusal:
            refusals.append(refusal)
    if refusals and refused is None:
        raise Refused("\n".join(map(str, refusals)))
    if refused is not None:
        refused.extend(refusals)
    bindings = bindings_of(chosen)
    users = dict.fromkeys((*chosen, *(user for binding in bindings for user in binding.users)))
    changed = [user for user in users if user.animated.is_editable and user.motion.is_exact != is_exact]
    if not changed:
        return
    with follower.paused():
        clear([binding for binding in bindings if binding.slot.action.is_editable])
        for user in changed:
            user.motion.is_exact = is_exact
    follower.refresh([transform_of(user.carrier) for user in changed])


def error_between_frames(target: bpy.types.Object | bpy.types.PoseBone | Transform) -> float:
    """Return how far something is off between frames at most, as estimated when it was filled in, in metres."""
    transform = transform_of(target)
    errors = [recorded(binding).error for binding in bindings_for(transform) if recorded_digest(binding)]
    return max(errors, default=0.0) * metres_per_channel_unit(transform)
