"""What all operators on targets have in common. Each does all that it can in one go, and says why not where it cannot.

Where there is nothing to do, a button is greyed out, and its tooltip has the reason. That is asked on every redraw, so
it looks at as little as it can. An operator that every target refused has changed nothing: it is cancelled, without an
undo step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import ClassVar

import bpy

from ..animation import Refused
from ..animation.transforms import Transform
from .targets import each_target, is_key_editor, is_posing
from .wording import kind_of, names_of, spoken_of

NO_TARGETS = "Select an object with keys first"
NO_BONES = "Select bones first"
NOTHING_SHOWN = "No keys of location, rotation or scale are shown here"

MOST_REFUSALS = 8
"""Refusals that a report has room for."""


class OnTargets:
    """Operators on the selected objects or bones, or on those that the editor shows. Their texts are about objects."""

    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO"}

    nothing_to_do: ClassVar[str] = ""
    """Why the operator is greyed out where it has nothing to do on any target."""

    @classmethod
    def each_target(cls, context: bpy.types.Context) -> Iterator[Transform]:
        """What the operator acts on here, one after the other."""
        return each_target(context)

    @classmethod
    def with_work(cls, targets: Iterable[Transform]) -> Iterable[Transform]:
        """The targets on which there is something to do."""
        return targets

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
        """Why the operator is greyed out."""
        if targets:
            return spoken_of(cls.nothing_to_do, kind_of(targets))
        return NOTHING_SHOWN if is_key_editor(context) else NO_BONES if is_posing(context) else NO_TARGETS

    @classmethod
    def description(cls, context: bpy.types.Context, _properties: bpy.types.OperatorProperties) -> str:
        return spoken_of(cls.bl_description, "bones" if is_posing(context) else "objects")

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
            refusals.append(f"and {len(reasons) - MOST_REFUSALS} more")
        if not summary or len(refused) >= len(targets):
            self.report({"ERROR"}, "\n".join(refusals))
            return {"CANCELLED"}
        if refused:
            done = len(targets) - len(refused)
            of_all = f"{done} of {len(targets)} {kind_of(targets)}"
            self.report({"WARNING"}, "\n".join([f"{of_all}: {summary}. But", *refusals]))
        else:
            self.report({"INFO"}, f"{names_of(targets)}: {summary}")
        return {"FINISHED"}
