"""A factor that is dragged with the mouse, as by Blender's Breakdowner: a slider in the header, and its keys.

Moving the mouse changes the factor, Shift does so finely, Ctrl in steps of a tenth, E lets it go beyond its ends, and
digits set it in per cent.
"""

from __future__ import annotations

import blf
import bpy
import gpu
from bpy.app.translations import pgettext_iface as iface_
from gpu_extras.batch import batch_for_shader

WAY = 300.0
"""Pixels, at a resolution scale of 1, that the mouse goes from 0 to 1."""

FINE, STEP = 0.1, 0.1
"""The part of a movement that Shift leaves, and the steps of Ctrl."""

DIGITS = {
    **{name: str(n) for n, name in enumerate(("ZERO", "ONE", "TWO", "THREE", "FOUR"))},
    **{name: str(n) for n, name in enumerate(("FIVE", "SIX", "SEVEN", "EIGHT", "NINE"), 5)},
    **{f"NUMPAD_{n}": str(n) for n in range(10)},
    "PERIOD": ".",
    "NUMPAD_PERIOD": ".",
    "COMMA": ".",
    "MINUS": "-",
    "NUMPAD_MINUS": "-",
}
"""The characters that keys type into a number."""

LINE, HANDLE, TEXT = (0.8, 0.8, 0.8, 0.7), (0.28, 0.45, 0.7, 1.0), (0.95, 0.95, 0.95, 1.0)
"""Colours, red, green, blue, alpha."""


class Slider:
    """A factor, and how mouse and keyboard change it.

    Parameters
    ----------
    factor : float
        To begin with.
    x : float
        Where the mouse is, in pixels.
    scale : float
        The resolution scale of the interface.
    """

    def __init__(self, factor: float, x: float, scale: float) -> None:
        self.overshoots = False
        """True if the factor may be below 0 and above 1."""
        self.typed = ""
        """The number that was typed, in per cent; the mouse has no say until it is deleted."""
        self._dragged, self._x, self._scale, self._snaps = factor, x, scale, False
        self._label = ""
        self._region: bpy.types.Region | None = None
        self._handler: tuple[type[bpy.types.Space], object, str] | None = None

    @property
    def factor(self) -> float:
        if self.typed:
            try:
                return float(self.typed) / 100.0
            except ValueError:  # so far it is a sign or a point alone
                return 0.0
        factor = self._dragged if self.overshoots else min(max(self._dragged, 0.0), 1.0)
        return round(factor / STEP) * STEP if self._snaps else factor

    def handle(self, event: bpy.types.Event) -> bool:
        """Take an event, and say whether it was for the slider."""
        self._snaps = event.ctrl
        if event.type == "MOUSEMOVE":
            self._dragged += (event.mouse_x - self._x) / (WAY * self._scale) * (FINE if event.shift else 1.0)
            self._x = event.mouse_x
            if not self.overshoots:
                # A mouse that comes back from beyond the end moves the factor at once.
                self._dragged = min(max(self._dragged, 0.0), 1.0)
        elif event.type in ("LEFT_CTRL", "RIGHT_CTRL", "LEFT_SHIFT", "RIGHT_SHIFT"):
            pass
        elif event.value != "PRESS":
            return False
        elif event.type == "E":
            self.overshoots = not self.overshoots
        elif event.type == "BACK_SPACE":
            self.typed = self.typed[:-1]
        elif event.type in DIGITS:
            self.typed += DIGITS[event.type]
        else:
            return False
        return True

    def show(self, context: bpy.types.Context, label: str) -> None:
        """Draw it into a header of the area until it is hidden; the keys are in the status bar."""
        self._label = label
        context.area.header_text_set(" ")
        # Blender takes the texts of a header out where it shows another: the tool header, if there is one.
        regions = {region.type: region for region in context.area.regions if region.height > 1}
        kind = "TOOL_HEADER" if "TOOL_HEADER" in regions else "HEADER"
        self._region, space = regions.get(kind), type(context.space_data)
        self._handler = space, space.draw_handler_add(self._draw, (), kind, "POST_PIXEL"), kind
        self.tell(context)

    def tell(self, context: bpy.types.Context) -> None:
        """Bring the status bar and the header up to date."""
        overshoot = iface_("On") if self.overshoots else iface_("Off")
        keys = iface_(
            "LMB, Enter: Confirm | Esc, RMB: Cancel | E: Overshoot ({overshoot}) | Ctrl: Steps of 10 % | "
            "Shift: Precision | 0-9: Per Cent"
        ).format(overshoot=overshoot)
        context.workspace.status_text_set(f"{self._label} {self._number} | {keys}")
        context.area.tag_redraw()

    def hide(self, context: bpy.types.Context) -> None:
        """Give header and status bar back."""
        if self._handler is not None:
            space, handle, kind = self._handler
            space.draw_handler_remove(handle, kind)
            self._handler = None
        context.workspace.status_text_set(None)
        context.area.header_text_set(None)

    @property
    def _number(self) -> str:
        return f"{self.typed} %" if self.typed else f"{100.0 * self.factor:.0f} %"

    def _draw(self) -> None:
        region, scale = bpy.context.region, self._scale
        if region != self._region:
            return
        low, high = (-0.25, 1.25) if self.overshoots else (0.0, 1.0)
        way, y = WAY * scale, 0.5 * region.height
        left = 0.5 * (region.width - way)
        gpu.state.blend_set("ALPHA")
        _draw_box(left + low * way, y - scale, left + high * way, y + scale, LINE)
        for tick in range(11):
            x, size = left + 0.1 * tick * way, (6.0 if tick % 5 == 0 else 3.0) * scale
            _draw_box(x - 0.5 * scale, y - size, x + 0.5 * scale, y + size, LINE)
        at = left + min(max(self.factor, low), high) * way
        _draw_box(at - 2.0 * scale, y - 9.0 * scale, at + 2.0 * scale, y + 9.0 * scale, HANDLE)
        blf.size(0, 11.0 * scale)
        blf.color(0, *TEXT)
        beside = 0.25 * way + 12.0 * scale
        for text, x in (
            (self._label, left - beside - blf.dimensions(0, self._label)[0]),
            (self._number, left + way + beside),
        ):
            blf.position(0, x, y - 4.0 * scale, 0)
            blf.draw(0, text)
        gpu.state.blend_set("NONE")


def _draw_box(left: float, bottom: float, right: float, top: float, colour: tuple[float, ...]) -> None:
    shader = gpu.shader.from_builtin("UNIFORM_COLOR")
    corners = [(left, bottom), (right, bottom), (left, top), (right, top)]
    batch = batch_for_shader(shader, "TRI_STRIP", {"pos": corners})
    shader.uniform_float("color", colour)
    batch.draw(shader)
