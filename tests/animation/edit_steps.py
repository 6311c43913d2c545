"""Every edit is an operator with undo, as in a window, and what handlers complained of meanwhile.

Blender pushes its undo step before handlers get to see the edit.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import ClassVar

import bpy


class Edit(bpy.types.Operator):
    """Any change, as an operator with undo."""

    bl_idname = "test.edit"
    bl_label = "Edit"
    bl_options: ClassVar = {"REGISTER", "UNDO"}
    change: ClassVar[Callable[[], None]]

    def execute(self, context: bpy.types.Context) -> set[str]:
        Edit.change()
        return {"FINISHED"}


class Complaints(logging.Handler):
    """Errors that handlers wrote down instead of raising them into Blender."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.found: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.found.append(self.format(record))
