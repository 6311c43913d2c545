"""Targets of operators: the transforms and keys that an editor's context selects, and the operators' base classes.

In a Dope Sheet or Graph Editor the targets are the transforms whose channels are shown. Elsewhere they are the selected
objects, or in Pose Mode the selected bones of all rigs in Pose Mode.

An operator acts on every target that it can, and reports the reasons of all others. If there is nothing to do, its
button is greyed out, with the reason as the tooltip. Blender polls on every redraw, so polls check as little as they
can. If every target refuses, nothing has changed: the operator is cancelled, without an undo step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, ClassVar, cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_

from ..animation import Refused, key_frames, modes_of
from ..animation.actions.slots import active_fcurves
from ..animation.baking.originals import BAKED, CLEANED, REDUCED, notes_of
from ..animation.queries.keyed import source_of
from ..animation.queries.polls import with_more_keys_than
from ..animation.queries.segments import frame_in_action, segment_at
from ..animation.transforms import TURNS_PROPERTY, WIDTHS, Transform, split_path, transform_in, transform_of
from ..blender import Operator, Returned, existing, pose_bones
from .wording import names_of

KEY_EDITORS = ("DOPESHEET_EDITOR", "GRAPH_EDITOR")

WHOLE, CURRENT, SELECTED = "WHOLE", "CURRENT", "SELECTED"

SCOPES = [
    (WHOLE, "All Segments", "All segments alike"),
    (CURRENT, "Current Segment", "The segment under the playhead. The others do not change"),
    (SELECTED, "Selected Keys", "The segments after the selected keys. The others do not change"),
]
"""The segments of a target that get a mode or turns, as items of an enum property."""

Frames = tuple[float, ...] | None
"""Frames of keys; None means all keys of a target."""

NO_TARGETS = n_("Select objects or bones with keys first")

NOTHING_SHOWN = n_("No keys of location, rotation or scale are shown here")

LATER_CHANGE_PROBLEMS = {
    BAKED: n_("These keys were baked since: Un-Bake first"),
    REDUCED: n_("These keys were reduced since: Restore Keys first"),
    CLEANED: n_("These keys were cleaned since: Restore Keys first"),
}
"""The reason why an earlier change cannot be undone yet, by the kind of the last change."""

MOST_REFUSALS = 8
"""The most refusals listed in a report."""


def is_key_editor(context: bpy.types.Context) -> bool:
    return context.area is not None and context.area.type in KEY_EDITORS


def is_posing(context: bpy.types.Context) -> bool:
    """Return whether the selection is bones, not objects: in Pose Mode, and in Weight Paint with a posed rig."""
    return context.mode == "POSE" or (context.mode == "PAINT_WEIGHT" and context.pose_object is not None)


def active_target(context: bpy.types.Context) -> Transform | None:
    """Return the target that panels and ticks in menus show."""
    active = context.active_pose_bone if is_posing(context) else context.object
    return None if active is None else transform_of(active)


def each_target(context: bpy.types.Context) -> Iterator[Transform]:
    """Return the targets of operators in this context, as an iterator: polls need only the first that fits."""
    return _shown_in_editor(context) if is_key_editor(context) else map(transform_of, selected(context))


def targets_of(context: bpy.types.Context) -> list[Transform]:
    """Return the list of targets of operators in this context."""
    return list(each_target(context))


def with_bones_of_rigs(context: bpy.types.Context, targets: Iterable[Transform]) -> Iterator[Transform]:
    """Yield the targets. Outside of Pose Mode a rig is replaced by whichever of the rig and its bones have keys.

    In a key editor the selected rigs are added, because it shows channels of bones only if the bones are selected.
    """
    if is_posing(context):
        yield from targets
        return
    if is_key_editor(context):
        rigs = (obj for obj in selected(context) if isinstance(obj, bpy.types.Object) and obj.type == "ARMATURE")
        targets = (*map(transform_of, rigs), *targets)
    seen: set[Transform] = set()
    for target in targets:
        keyed = [bone for bone in with_keyed_bones(target) if bone not in seen]
        yield from keyed
        seen.update(keyed)


def with_keyed_bones(target: Transform) -> list[Transform]:
    """Return the keyed ones of a rig and its bones, if any bone has keys; otherwise the target alone."""
    if target.is_part or target.animated.type != "ARMATURE":
        return [target]
    keyed = list(with_more_keys_than((target, *map(transform_of, pose_bones(target.animated))), 0))
    return keyed if any(item.is_part for item in keyed) else [target]


def selected(context: bpy.types.Context) -> list[bpy.types.Object] | list[bpy.types.PoseBone]:
    """Return the selected bones, or the selected objects or else the active one, as Blender's operators do."""
    result = selected_in_view(context)
    return result if result or is_posing(context) or context.object is None else [context.object]


def selected_in_view(context: bpy.types.Context) -> list[bpy.types.Object] | list[bpy.types.PoseBone]:
    """Return the selected bones of all rigs in Pose Mode while bones are posed, else the selected objects."""
    if is_posing(context):
        return list(context.selected_pose_bones or ())
    return list(context.selected_objects or ())


def scope_for(context: bpy.types.Context) -> str:
    """Return the default scope of a mode in this context."""
    return SELECTED if is_key_editor(context) else WHOLE


def frames_meant(context: bpy.types.Context, target: Transform, scope: str) -> Frames:
    """Return the frames of the keys that begin a target's segments in a scope; None for all. `Refused` if none."""
    if scope == WHOLE:
        return None
    if scope == SELECTED:
        frames = key_frames(target, selected=True)
        if not len(frames):
            raise Refused(n_("{name}: no key of location, rotation or scale is selected"), name=target.name)
        return tuple(frames.tolist())
    source = source_of(target)
    if source is None:
        raise Refused(
            n_("{name} has no Action with keys: key it first, or enter a strip (NLA Editor, Tab)"), name=target.name
        )
    segment = segment_at(source, frame_in_action(target.animated, existing(context.scene).frame_current_final))
    if segment is None:
        raise Refused(
            n_("{name}: the playhead is not between two keys; move it there, or select keys instead"), name=target.name
        )
    return (segment.key,)


def each_done(
    targets: Iterable[Transform], refused: list[Refused], verb: Callable[[Transform], object]
) -> list[Transform]:
    """Call a function with each target, collect refusals, and return the targets that did not refuse."""
    done = []
    for target in targets:
        try:
            verb(target)
        except Refused as refusal:
            refused.append(refusal)
        else:
            done.append(target)
    return done


def grouped_by_frames(
    context: bpy.types.Context, targets: Iterable[Transform], scope: str, refused: list[Refused]
) -> dict[Frames, list[Transform]]:
    """Group targets by the frames of the keys that begin their segments in a scope.
    Targets without any are added to `refused`.
    """
    groups: dict[Frames, list[Transform]] = {}
    each_done(
        targets,
        refused,
        lambda target: groups.setdefault(frames_meant(context, target, scope), []).append(target),
    )
    return groups


def modes_meant(context: bpy.types.Context, target: Transform | None, scope: str) -> set[str]:
    """Return the current modes of a target's segments in a scope."""
    if target is None:
        return set()
    try:
        meant = frames_meant(context, target, scope)
    except ValueError:
        return set()
    keys = key_frames(target)
    frames = keys if meant is None else np.array(meant)
    if not len(frames):
        frames = np.zeros(1)
    # The last key begins no segment. Alone it still has a mode, for keys to come.
    return set(modes_of(target, frames[~np.isin(frames, keys[-1:])] if len(frames) > 1 else frames))


def _shown_in_editor(context: bpy.types.Context) -> Iterator[Transform]:
    """Yield the objects and bones whose location, rotation, scale or turns are shown in a key editor."""
    shown = {fcurve.as_pointer() for fcurve in context.visible_fcurves or ()}
    for obj in _animated_in_editor(context) if shown else ():
        result = set()
        for fcurve in active_fcurves(obj):
            prefix, prop = split_path(fcurve.data_path)
            if prefix not in result and (prop in WIDTHS or prop == TURNS_PROPERTY) and fcurve.as_pointer() in shown:
                result.add(prefix)
                if (target := transform_in(obj, prefix)) is not None:
                    yield target


def _animated_in_editor(context: bpy.types.Context) -> Iterable[bpy.types.Object]:
    """Return the objects that a key editor may show."""
    if not existing(cast(bpy.types.SpaceDopeSheetEditor, context.space_data).dopesheet).show_only_selected:
        return existing(context.view_layer).objects
    active = (context.object,) if context.object is not None else ()
    return dict.fromkeys((*context.selected_objects, *active, *(context.objects_in_mode or ())))


class OnTargets(Operator):
    """Operators on the selected objects or bones, or on those that the editor shows."""

    nothing_to_do: ClassVar[str] = ""
    """The reason for a greyed-out operator if it has nothing to do on any target."""

    nothing_meant: ClassVar[str] = ""
    """The reason if there are no targets; "" for the editor's own reason."""

    with_work: Any = staticmethod(iter)
    """A function that filters targets: it returns the ones with something to do."""

    leaves_others: ClassVar[bool] = False
    """True to skip all other targets silently; False to let them report why nothing could be done."""

    verb: ClassVar[Callable]
    """The function that `do` calls with the targets and with a list for `refused`."""

    summary: ClassVar[str]
    """The message reported after `verb`."""

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        """Return an iterator over the operator's targets in this context."""
        return each_target(context)

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        seen: list[Transform] = []

        def noted() -> Iterator[Transform]:
            for target in cls.each_target(context):
                seen.append(target)
                yield target

        if any(True for _ in cls.with_work(noted())):
            return True
        cls.poll_message_set(cls.reason(seen, context))
        return False

    @classmethod
    def reason(cls, targets: list[Transform], context: bpy.types.Context) -> str:
        """Return why the operator is greyed out, in the user's language."""
        nothing_meant = cls.nothing_meant or (NOTHING_SHOWN if is_key_editor(context) else NO_TARGETS)
        return tip_(cls.nothing_to_do if targets else nothing_meant)

    def execute(self, context: bpy.types.Context) -> Returned:
        targets = self.acted_on(context)
        return self.act(targets, lambda refused: self.do(context, targets, refused))

    def acted_on(self, context: bpy.types.Context) -> list[Transform]:
        """Return the targets that the operator will act on."""
        targets = list(self.each_target(context))
        return list(self.with_work(targets)) if self.leaves_others else targets

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        """Act on all targets, add refusals to the list, and return a summary. This is a `verb` of `act`."""
        type(self).verb(targets, refused=refused)
        return rpt_(self.summary)

    def act(self, targets: Sequence[Transform], verb: Callable[[list[Refused]], str]) -> Returned:
        """Call a function on all targets at once, and report the result.

        Parameters
        ----------
        targets
        verb
            Acts on the targets, adds refusals to the list that it is given, and returns a summary. May raise `Refused`
            if it could do nothing.
        """
        refused: list[Refused] = []
        try:
            summary = verb(refused)
        except Refused as refusal:
            refused, summary = [refusal], ""
        # Bones of a rig may all give the same reason.
        reasons = list(dict.fromkeys(map(str, refused)))
        refusals = reasons[:MOST_REFUSALS]
        if len(reasons) > MOST_REFUSALS:
            refusals.append(rpt_("and {count} more").format(count=len(reasons) - MOST_REFUSALS))
        if not summary or len(refused) >= len(targets):
            self.report({"ERROR"}, "\n".join(refusals))
            return {"CANCELLED"}
        if refused:
            text = rpt_("{done} of {all}: {summary}. But")
            but = text.format(done=len(targets) - len(refused), all=names_of(targets), summary=summary)
            self.report({"WARNING"}, "\n".join([but, *refusals]))
        else:
            self.report({"INFO"}, f"{names_of(targets)}: {summary}")
        return {"FINISHED"}


class OnChanged(OnTargets):
    """Operators on targets whose keys were changed last in some ways, while those from before are still in the file."""

    kinds: ClassVar[Sequence[str]]

    @classmethod
    def last_changes(cls, targets: Iterable[Transform]) -> dict[Transform, str]:
        """Return the kind of the last change to the keys of each changed target."""
        result = {}
        for target, notes in notes_of(targets):
            if kind := next((note.kind for note in notes if note.original is not None), None):
                result[target] = kind
        return result

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        targets = list(cls.each_target(context))
        changes = cls.last_changes(targets)
        if not set(cls.kinds).isdisjoint(changes.values()):
            return True
        reason = cls.reason(targets, context)
        for target, later in changes.items():
            if any(note.kind in cls.kinds and note.original is not None for note in target.motion.bakes):
                reason = tip_(LATER_CHANGE_PROBLEMS[later])
        cls.poll_message_set(reason)
        return False

    def acted_on(self, context: bpy.types.Context) -> list[Transform]:
        return [target for target, kind in self.last_changes(self.each_target(context)).items() if kind in self.kinds]
