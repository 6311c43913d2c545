"""What all operators on targets have in common. Each does all that it can in one go, and says why not where it cannot.

Where there is nothing to do, a button is greyed out, and its tooltip has the reason. That is asked on every redraw, so
it looks at as little as it can. An operator that every target refused has changed nothing: it is cancelled, without an
undo step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, ClassVar

import bpy
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_

from ..animation import Refused
from ..animation.baking.copies import BAKED, REDUCED, entries_of
from ..animation.transforms import Transform
from .targets import each_target, is_key_editor, is_posing
from .wording import kind_of, names_of, spoken_of

NO_TARGETS = n_("Select an object with keys first")
NO_BONES = n_("Select bones first")
NOTHING_SHOWN = n_("No keys of location, rotation or scale are shown here")

BUT = {
    "objects": n_("{done} of {count} objects: {summary}. But"),
    "bones": n_("{done} of {count} bones: {summary}. But"),
    "objects and bones": n_("{done} of {count} objects and bones: {summary}. But"),
}
"""The text before refusals where something was done."""

LATER = {
    BAKED: n_("These keys were baked since: Un-Bake first"),
    REDUCED: n_("These keys were reduced since: Restore Keys first"),
}
"""The reason why what was done before cannot be taken back yet, by what was done last."""

MOST_REFUSALS = 8
"""Refusals that a report has room for."""


class OnTargets:
    """Operators on the selected objects or bones, or on those that the editor shows. Their texts are about objects."""

    bl_options: Any = {"REGISTER", "UNDO"}  # noqa: RUF012 - Blender reads it

    nothing_to_do: ClassVar[str] = ""
    """The reason why the operator is greyed out where it has nothing to do on any target."""

    with_work: Any = staticmethod(iter)
    """A function of targets that returns those on which there is something to do."""

    leaves_others: ClassVar[bool] = False
    """True if it does nothing to other targets; otherwise these say why nothing could be done."""

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
        if targets:
            return tip_(spoken_of(cls.nothing_to_do, kind_of(targets)))
        return tip_(NOTHING_SHOWN if is_key_editor(context) else NO_BONES if is_posing(context) else NO_TARGETS)

    @classmethod
    def description(cls, context: bpy.types.Context, _properties: bpy.types.OperatorProperties) -> str:
        return tip_(spoken_of(cls.bl_description, "bones" if is_posing(context) else "objects"))

    def execute(self, context: bpy.types.Context) -> Any:
        targets = list(self.each_target(context))
        if self.leaves_others:
            targets = list(self.with_work(targets))
        return self.act(targets, lambda refused: self.do(context, targets, refused))

    def do(self, context: bpy.types.Context, targets: list[Transform], refused: list[Refused]) -> str:
        """Do it to all targets, put refusals into the list, and return in words what was done: a verb of `act`."""
        raise NotImplementedError

    def act(self, targets: Sequence[Transform], verb: Callable[[list[Refused]], str]) -> set[str]:
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
            but = rpt_(BUT[kind_of(targets)]).format(
                done=len(targets) - len(refused), count=len(targets), summary=summary
            )
            self.report({"WARNING"}, "\n".join([but, *refusals]))
        else:
            self.report({"INFO"}, f"{names_of(targets)}: {summary}")
        return {"FINISHED"}


class OnChanged(OnTargets):
    """Operators on targets whose keys were baked or reduced last, while what they had before is still in the file."""

    kind: ClassVar[str]
    verb: ClassVar[Callable]
    summary: ClassVar[str]

    @classmethod
    def last_changes(cls, targets: Iterable[Transform]) -> dict[Transform, str]:
        """Return what was done last to the keys of each target that something was done to."""
        result = {}
        for target, entries in entries_of(targets):
            if kind := next((entry.kind for entry in entries if entry.original is not None), None):
                result[target] = kind
        return result

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        targets = list(cls.each_target(context))
        changes = cls.last_changes(targets)
        if cls.kind in changes.values():
            return True
        reason = cls.reason(targets, context)
        for target, later in changes.items():
            if any(entry.kind == cls.kind and entry.original is not None for entry in target.motion.bakes):
                reason = tip_(LATER[later])
        cls.poll_message_set(reason)
        return False

    def execute(self, context: bpy.types.Context) -> set[str]:
        targets = [target for target, kind in self.last_changes(self.each_target(context)).items() if kind == self.kind]

        def go_back(refused: list[Refused]) -> str:
            type(self).verb(targets, refused=refused)
            return rpt_(self.summary)

        return self.act(targets, go_back)
