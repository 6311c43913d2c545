"""From the context to targets, the transforms and keys that an editor means; and what operators on them have in common.

In a Dope Sheet or Graph Editor these are the transforms whose channels are shown. Elsewhere they are the selected
objects; while bones are posed, the selected bones of all rigs in Pose Mode.

Each operator does all that it can in one go, and says why not where it cannot. Where there is nothing to do, a button
is greyed out, and its tooltip has the reason. That is asked on every redraw, so it looks at as little as it can. An
operator that every target refused has changed nothing: it is cancelled, without an undo step.
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
"""The parts of a target that get a mode or turns, as the items of an enum property."""

Frames = tuple[float, ...] | None
"""Frames of keys, None for all of a target."""

NO_TARGETS = n_("Select objects or bones with keys first")

NOTHING_SHOWN = n_("No keys of location, rotation or scale are shown here")

LATER_CHANGE_PROBLEMS = {
    BAKED: n_("These keys were baked since: Un-Bake first"),
    REDUCED: n_("These keys were reduced since: Restore Keys first"),
    CLEANED: n_("These keys were cleaned since: Restore Keys first"),
}
"""The reason why what was done before cannot be taken back yet, by what was done last."""

MOST_REFUSALS = 8
"""Refusals that a report has room for."""


def is_key_editor(context: bpy.types.Context) -> bool:
    return context.area is not None and context.area.type in KEY_EDITORS


def is_posing(context: bpy.types.Context) -> bool:
    """Return whether bones are selected here, and not objects: in Pose Mode,
    and while weights are painted for a posed rig.
    """
    return context.mode == "POSE" or (context.mode == "PAINT_WEIGHT" and context.pose_object is not None)


def active_target(context: bpy.types.Context) -> Transform | None:
    """Return what panels and ticks in menus are about."""
    active = context.active_pose_bone if is_posing(context) else context.object
    return None if active is None else transform_of(active)


def each_target(context: bpy.types.Context) -> Iterator[Transform]:
    """Return what an operator acts on here, one after the other: polls need no more than the first that fits."""
    return _shown_in_editor(context) if is_key_editor(context) else map(transform_of, selected(context))


def targets_of(context: bpy.types.Context) -> list[Transform]:
    """Return what an operator acts on here."""
    return list(each_target(context))


def with_bones_of_rigs(context: bpy.types.Context, targets: Iterable[Transform]) -> Iterator[Transform]:
    """Yield the targets, and outside of Pose Mode in place of rigs all that has keys of them and of their bones.

    In a key editor these are the selected rigs too: it shows channels of bones only where the bones are selected.
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
    """Return what has keys of a rig and its bones, where any of its bones has; otherwise the target alone."""
    if target.is_part or target.animated.type != "ARMATURE":
        return [target]
    keyed = list(with_more_keys_than((target, *map(transform_of, pose_bones(target.animated))), 0))
    return keyed if any(item.is_part for item in keyed) else [target]


def selected(context: bpy.types.Context) -> list[bpy.types.Object] | list[bpy.types.PoseBone]:
    """Return the selected objects, without any the active one; or the selected bones alone,
    as Blender's operators have it.
    """
    result = selected_in_view(context)
    return result if result or is_posing(context) or context.object is None else [context.object]


def selected_in_view(context: bpy.types.Context) -> list[bpy.types.Object] | list[bpy.types.PoseBone]:
    """Return the selected bones of all rigs in Pose Mode while these are posed, else the selected objects."""
    if is_posing(context):
        return list(context.selected_pose_bones or ())
    return list(context.selected_objects or ())


def scope_for(context: bpy.types.Context) -> str:
    """Return what of the targets gets a mode here, unless asked for otherwise."""
    return SELECTED if is_key_editor(context) else WHOLE


def frames_meant(context: bpy.types.Context, target: Transform, scope: str) -> Frames:
    """Return the keys of a target that begin the segments meant, None for all of it. `Refused` where there are none."""
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
    """Do something to each target, and return those that did not refuse."""
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
    """Return the targets whose segments meant begin on the same keys, together.
    `refused` takes why others have none.
    """
    groups: dict[Frames, list[Transform]] = {}
    each_done(
        targets,
        refused,
        lambda target: groups.setdefault(frames_meant(context, target, scope), []).append(target),
    )
    return groups


def modes_meant(context: bpy.types.Context, target: Transform | None, scope: str) -> set[str]:
    """Return the modes that what is meant of a target has now."""
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
    """Yield the objects and the bones of which location, rotation, scale or turns are shown in a key editor."""
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
    """The reason why the operator is greyed out where it has nothing to do on any target."""

    nothing_meant: ClassVar[str] = ""
    """The reason where there are no targets; "" for that of the editor."""

    with_work: Any = staticmethod(iter)
    """A function of targets that returns those on which there is something to do."""

    leaves_others: ClassVar[bool] = False
    """True if it does nothing to other targets; otherwise these say why nothing could be done."""

    verb: ClassVar[Callable]
    """What `do` calls with targets, and with a list for `refused`."""

    summary: ClassVar[str]
    """What was done then."""

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        """Return what the operator acts on here, one after the other."""
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
        targets = self.meant(context)
        return self.act(targets, lambda refused: self.do(context, targets, refused))

    def meant(self, context: bpy.types.Context) -> list[Transform]:
        """Return the targets that something is to be done to."""
        targets = list(self.each_target(context))
        return list(self.with_work(targets)) if self.leaves_others else targets

    def do(self, _context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        """Do it to all targets, put refusals into the list, and return in words what was done: a verb of `act`."""
        type(self).verb(targets, refused=refused)
        return rpt_(self.summary)

    def act(self, targets: Sequence[Transform], verb: Callable[[list[Refused]], str]) -> Returned:
        """Do something to all targets at once, and report it.

        Parameters
        ----------
        targets
        verb
            Does it, puts refusals into the list that it is given, and returns in words what was done. May raise
            `Refused` where nothing could be.
        """
        refused: list[Refused] = []
        try:
            summary = verb(refused)
        except Refused as refusal:
            refused, summary = [refusal], ""
        # Bones of a rig may all have the same reason.
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
        """Return what was done last to the keys of each target that something was done to."""
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

    def meant(self, context: bpy.types.Context) -> list[Transform]:
        return [target for target, kind in self.last_changes(self.each_target(context)).items() if kind in self.kinds]
