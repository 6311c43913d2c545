"""What has set properties: which of Blender's operators, or a script."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

BLENDING = (
    "TRANSFORM_OT_",
    *(f"POSE_OT_{name}" for name in ("push", "relax", "breakdown", "blend", "user_transforms_clear")),
)
"""The beginnings of the names of operators that go on from what properties have,
also when they are adjusted afterwards."""


@dataclass(frozen=True)
class Operators:
    """The operators that are at work."""

    names: tuple[str, ...] = ()
    """Names of those that run, and of the one that has ended last if it did since edits were last seen."""

    is_script: bool = True
    """True if what is set is set as a script does it: none runs, nor is one adjusted that goes on from what was."""

    def are_any(self, beginnings: tuple[str, ...]) -> bool:
        """Return whether the name of any begins so."""
        return any(name.startswith(beginnings) for name in self.names)


class OperatorWatch:
    """Which operators were at work between two looks."""

    def __init__(self) -> None:
        self._last = (0, "")
        """The operator that had ended last, told from others of its kind, and its name."""

    def look(self) -> Operators:
        """Return those that are at work now, or ended since the last look."""
        manager = bpy.context.window_manager
        ended = manager.operators if manager is not None else ()
        last = (ended[-1].as_pointer(), ended[-1].bl_idname) if len(ended) else (0, "")
        running = [one.bl_idname for window in (manager.windows if manager else ()) for one in window.modal_operators]
        names = (*running, *((last[1],) if last != self._last else ()))
        self._last = last
        return Operators(names, not running and not last[1].startswith(BLENDING))
