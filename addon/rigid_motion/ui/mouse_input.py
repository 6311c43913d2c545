"""Mouse and keyboard input during a drag, as in Blender's own transforms."""

from __future__ import annotations

import bpy

SHIFT_RATIO = 0.1
"""Shift reduces a movement of the mouse to this fraction."""

CONFIRM, CANCEL = {"LEFTMOUSE", "RET", "NUMPAD_ENTER"}, {"RIGHTMOUSE", "ESC"}
MODIFIERS = {"LEFT_CTRL", "RIGHT_CTRL", "LEFT_SHIFT", "RIGHT_SHIFT"}


class MouseInput:
    """Movements of the mouse, keys, and a typed number. A typed number overrides the mouse until it is deleted."""

    def __init__(self) -> None:
        self.typed = ""
        self.is_stepped = self.is_fine = False
        """True while Ctrl or Shift is held."""

    @property
    def number(self) -> float | None:
        """The typed number; None if there is none, so the mouse counts."""
        try:
            return float(self.typed) if self.typed else None
        except ValueError:  # only a sign or a point so far
            return 0.0

    def handle(self, event: bpy.types.Event) -> bool:
        """Handle an event. Return whether it may have changed anything."""
        self.is_stepped, self.is_fine = event.ctrl, event.shift
        if event.type == "MOUSEMOVE":
            self.move(event, SHIFT_RATIO if event.shift else 1.0)
        elif event.type not in MODIFIERS:
            return event.value == "PRESS" and (self.press(event.type) or self._type(event))
        return True

    def move(self, event: bpy.types.Event, ratio: float) -> None:
        """Follow the mouse by this fraction of its movement."""
        raise NotImplementedError

    def press(self, key: str) -> bool:
        """Handle a pressed key. Return whether the key has a meaning here."""
        raise NotImplementedError

    def _type(self, event: bpy.types.Event) -> bool:
        if event.type == "BACK_SPACE":
            self.typed = self.typed[:-1]
            return True
        if event.unicode and event.unicode in "0123456789.,-":
            self.typed += event.unicode.replace(",", ".")
            return True
        return False
