"""The frame of every edit: many targets at once, slots read once, one refresh.

Every target is planned first. If one refuses, `Refused` is raised and nothing changes. With a list `refused`, refusals
are added to it instead, and all other targets are edited.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

import bpy
from bpy.app.translations import pgettext_n as n_

from ...blender import view_layer
from ..actions.channels import KeyFields, key_fields, set_key_fields
from ..actions.reading import sources_of_users
from ..actions.refusals import refuse_linked, refuse_numbers
from ..actions.slots import Binding, bindings_of
from ..evaluation.components import ROWS
from ..evaluation.sources import KeyedTransform
from ..following import follower
from ..queries.keyed import active_binding
from ..transforms import WIDTHS, Channel, Refused, Transform, transform_of

Target = bpy.types.Object | bpy.types.PoseBone | Transform
"""One target of an edit."""

Targets = Target | Iterable[Target]
"""One or several targets."""

Readings = list[tuple[Binding, KeyedTransform | Refused]]
"""The bindings that move a target, each with its source, or the reason why there can be no in-betweens in it."""

Plan = TypeVar("Plan")
Result = TypeVar("Result")


def transforms_of(targets: Targets) -> list[Transform]:
    """Return the transforms of targets, each once."""
    return list(dict.fromkeys(map(transform_of, (targets,) if isinstance(targets, Target) else targets)))


def apply_edit(
    targets: Targets,
    plan: Callable[[Transform, Readings], Plan],
    act: Callable[[Transform, Plan], Result],
    refused: list[Refused] | None,
) -> dict[Transform, Result]:
    """Edit each target, and return the results of `act` for those that did not refuse.

    `plan` returns what to do for one target, without changing anything, and may raise `Refused`; `act` does it.
    """

    def plans(readings: Mapping[Transform, Readings]) -> dict[Transform, Plan | Refused]:
        result: dict[Transform, Plan | Refused] = {}
        for transform, reading in readings.items():
            try:
                result[transform] = plan(transform, reading)
            except Refused as refusal:
                result[transform] = refusal
        return result

    return apply_together(targets, plans, act, refused)


def apply_together(
    targets: Targets,
    plan: Callable[[Mapping[Transform, Readings]], Mapping[Transform, Plan | Refused]],
    act: Callable[[Transform, Plan], Result],
    refused: list[Refused] | None,
) -> dict[Transform, Result]:
    """Edit targets as `apply_edit` does, if the plan for one target depends on the others.

    `plan` returns for all of them what to do, or why they refuse.
    """
    readings: dict[Transform, Readings] = {transform: [] for transform in transforms_of(targets)}
    bindings = bindings_of(readings)
    for binding, sources in zip(bindings, sources_of_users(bindings), strict=True):
        for user, source in zip(binding.users, sources, strict=True):
            if user in readings:
                readings[user].append((binding, source))
    plans, refusals = [], []
    for transform, planned in plan(readings).items():
        if isinstance(planned, Refused):
            refusals.append(planned)
        else:
            plans.append((transform, planned))
    if refusals and refused is None:
        raise refusals[0] if len(refusals) == 1 else Refused("\n".join(map(str, refusals)))
    if refused is not None:
        refused.extend(refusals)
    with follower.follower.own_edits():
        results = {transform: act(transform, planned) for transform, planned in plans}
    follower.refresh(transform for transform, _ in plans)
    return results


def readable(transform: Transform, readings: Readings) -> list[tuple[Binding, KeyedTransform]]:
    """Return a transform's sources in all of its bindings. Raise `Refused` if one of them can have no in-betweens."""
    result = []
    for binding, source in readings:
        if isinstance(source, Refused):
            raise source
        refuse_numbers(transform.name, source)
        result.append((binding, source))
    return result


def editable_binding(transform: Transform, bindings: Iterable[Binding]) -> Binding:
    """Return the slot whose keys the editors show. Raise `Refused` if there is none, or it belongs to another file."""
    binding = active_binding(transform, bindings)
    if binding is None:
        text = n_("{name} has no Action with keys: key it first, or enter a strip (NLA Editor, Tab)")
        raise Refused(text, name=transform.name)
    refuse_linked(transform, binding)
    return binding


def editable_keys(transform: Transform, readings: Readings) -> tuple[Binding, KeyedTransform]:
    """Return the slot whose keys the editors show, and its source. Raise `Refused` if the slot cannot be edited or can
    have no in-betweens.
    """
    binding = editable_binding(transform, [binding for binding, _ in readings])
    return binding, next(source for one, source in readable(transform, readings) if one is binding)


class TriedEdit:
    """A transform whose keys are edited repeatedly, each time starting from its original keys."""

    def __init__(self, transform: Transform, binding: Binding, channels: Iterable[Channel]) -> None:
        self.transform, self.binding = transform, binding
        self.posed = transform.components()
        curves = {channel: binding.curves.get(channel) for channel in channels}
        self.keys: dict[Channel, KeyFields | None] = {
            channel: key_fields(curve.keyframe_points) if curve else None for channel, curve in curves.items()
        }
        """The original keys of these channels; None for channels that did not exist."""

    def put_back(self) -> None:
        """Restore the original keys of its channels."""
        for channel, fields in self.keys.items():
            if fields is not None:
                set_key_fields(self.binding.ensure_curve(channel), fields)
            else:
                self.binding.remove_curve(channel)


class TriedEdits:
    """Edits of several transforms, tried repeatedly until the user accepts one.

    The class is not generic: `typing` caches the parameters of generic classes, and Blender 4.5 never ends while it
    does.
    """

    def __init__(
        self, targets: Targets, plan: Callable[[Transform, Readings], Any], refused: list[Refused] | None
    ) -> None:
        self.tried = list(apply_edit(targets, plan, lambda _, tried: tried, refused).values())
        """The `TriedEdit` that `plan` returned for each target that did not refuse."""

    def __len__(self) -> int:
        return len(self.tried)

    def cancel(self) -> None:
        """Restore the original keys and poses, including poses without keys."""
        with self.edit():
            pass
        for one in self.tried:
            for part, prop in one.transform.properties.items():
                setattr(one.transform.carrier, prop, one.posed[ROWS[part]][: WIDTHS[prop]])

    @contextmanager
    def edit(self) -> Iterator[None]:
        """Restore all original keys, let the caller edit them, then refresh."""
        with follower.follower.own_edits():
            for one in self.tried:
                one.put_back()
            yield
            follower.refresh([one.transform for one in self.tried])
            for one in self.tried:
                one.binding.slot.action.update_tag()
            # Everything is up to date, so this keeps the follower from checking all data of these Actions.
            view_layer().update()
