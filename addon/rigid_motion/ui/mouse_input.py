"""What mouse and keyboard say while something is dragged, as Blender's own transforms have it."""

from __future__ import annotations

import bpy

SHIFT_RATIO = 0.1
"""The part of a movement that Shift leaves."""

CONFIRM, CANCEL = {"LEFTMOUSE", "RET", "NUMPAD_ENTER"}, {"RIGHTMOUSE", "ESC"}
MODIFIERS = {"LEFT_CTRL", "RIGHT_CTRL", "LEFT_SHIFT", "RIGHT_SHIFT"}


class MouseInput:
    """Movements of the mouse, keys, and a number that is typed: then the mouse has no say until it is deleted."""

    def __init__(self) -> None:
        self.typed = ""
        self.is_stepped = self.is_fine = False
        """True while Ctrl or Shift is held."""

    @property
    def number(self) -> float | None:
        """The number that was typed; None where the mouse has its say."""
        try:
            return float(self.typed) if self.typed else None
        except ValueError:  # so far it is a sign or a point alone
            return 0.0

    def handle(self, event: bpy.types.Event) -> bool:
        """Take an event, and say whether it may have changed anything."""
        self.is_stepped, self.is_fine = event.ctrl, event.shift
        if event.type == "MOUSEMOVE":
            self.move(event, SHIFT_RATIO if event.shift else 1.0)
        elif event.type not in MODIFIERS:
            return event.value == "PRESS" and (self.press(event.type) or self._type(event))
        return True

    def move(self, event: bpy.types.Event, ratio: float) -> None:
        """Go where the mouse is, by this part of the way."""
        raise NotImplementedError

    def press(self, key: str) -> bool:
        """Take a key that was pressed, and say whether it was for this."""
        raise NotImplementedError

    def _type(self, event: bpy.types.Event) -> bool:
        if event.type == "BACK_SPACE":
            self.typed = self.typed[:-1]
            return True
        if event.unicode and event.unicode in "0123456789.,-":
            self.typed += event.unicode.replace(",", ".")
            return True
        return False
