"""Why something does not move as its mode says, in words, and the way out."""

from __future__ import annotations

import bpy
from bpy.app.translations import pgettext_rpt as rpt_

from ..actions.mode_property import has_to_do_with_modes
from ..actions.reading import differing_users, sources_of_users
from ..actions.refusals import refuse_numbers
from ..actions.slots import Binding, bindings_of
from ..compute.differences import differences
from ..compute.sources import Source
from ..transforms import Refused, Transform, transform_of


def problem_of(target: bpy.types.Object | bpy.types.PoseBone | Transform) -> str:
    """Return why something does not move as its mode says, and the way out; "" where nothing is amiss."""
    transform = transform_of(target)
    bindings = bindings_of([transform])
    try:
        for binding, sources in zip(bindings, sources_of_users(bindings), strict=True):
            source = sources[binding.users.index(transform)]
            if isinstance(source, Refused):
                if not has_to_do_with_modes(binding):
                    continue
                raise source
            refuse_numbers(transform.name, source)
            if source.is_live:
                differences([source])
                _refuse_differing(transform, binding, sources)
    except Refused as problem:
        return str(problem)
    except ValueError as problem:
        return rpt_("{name} has keys too large to compute with ({problem}): delete them (Dope Sheet, X)").format(
            name=transform.name, problem=problem
        )
    return ""


def _refuse_differing(transform: Transform, binding: Binding, sources: list[Source | Refused]) -> None:
    """Raise `Refused` where the in-betweens of a slot are those of another user, which do not fit."""
    if transform in (differing := differing_users(binding, sources)):
        leader = next(user for user in binding.users if user not in differing)
        raise Refused(rpt_(transform.differing_text).format(name=transform.name, leader=leader.name))
