"""The preferences of the extension: default mode, live update, and the colors and line width of the overlay.

Blender stores them with its own preferences, not in a file. Colors are RGBA as displayed, widths are in pixels at a
resolution scale of 1.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import bpy

from .. import animation
from ..animation.properties import MODE_ITEMS
from ..animation.transforms import OWN_WORDS
from ..blender import BoolProperty, EnumProperty, FloatProperty, FloatVectorProperty, existing, with_properties
from . import keymap, manual
from .wording import split

Color = tuple[float, float, float, float]

EXTENSION = __package__.rpartition(".")[0]
"""The name of the extension in Blender: the parent package."""

DEFAULT_MODE = "motor_spline"


def preferences() -> RigidMotionPreferences:
    """Return the preferences; their defaults if the package is registered without being an extension, as in tests of
    a checkout.
    """
    addon = existing(bpy.context.preferences).addons.get(EXTENSION)
    return cast(RigidMotionPreferences, UNCHANGED if addon is None else addon.preferences)


def apply() -> None:
    """Apply the preferences as loaded by Blender."""
    animation.set_enabled(preferences().live_update)


def _on_live_update(chosen: RigidMotionPreferences, _context: bpy.types.Context) -> None:
    animation.set_enabled(chosen.live_update)
    if chosen.live_update:
        animation.refresh()


def _color(name: str, description: str, default: Color) -> Color:
    return FloatVectorProperty(
        name=name,
        description=description,
        size=4,
        subtype="COLOR_GAMMA",
        default=default,
        min=0.0,
        max=1.0,
        translation_context=OWN_WORDS,
    )


@with_properties
class RigidMotionPreferences(bpy.types.AddonPreferences):
    bl_idname = EXTENSION

    default_mode: str = EnumProperty(
        name="Default Mode",
        description="The mode that Set Rigid Motion Mode uses if none is given: in Search, or by your own shortcut",
        items=MODE_ITEMS,
        default=DEFAULT_MODE,
        translation_context=OWN_WORDS,
    )
    live_update: bool = BoolProperty(
        name="Live Update",
        description="Update after every edit. Otherwise in-betweens do not change until Refresh In-Betweens",
        default=True,
        update=_on_live_update,
    )
    native_color: Color = _color(
        "Blender's Path", "Color of the path by Blender's own in-betweens", (0.80, 0.80, 0.80, 1.0)
    )
    mode_color: Color = _color("Mode's Path", "Color of the path by the mode", (0.20, 0.72, 1.0, 1.0))
    key_color: Color = _color(
        "Selected Keys", "Color of the selected keys on a path. The others are white", (1.0, 0.75, 0.20, 1.0)
    )
    tick_color: Color = _color("Ticks", "Color of the evenly timed marks along a path", (1.0, 1.0, 1.0, 1.0))
    past_color: Color = _color("Past", "Color of ghosts before the current frame", (1.0, 0.42, 0.42, 1.0))
    future_color: Color = _color("Future", "Color of ghosts after the current frame", (0.25, 0.85, 0.62, 1.0))
    line_width: float = FloatProperty(
        name="Line Width",
        description="Width of the paths",
        default=2.0,
        min=1.0,
        max=10.0,
        precision=1,
        subtype="PIXEL",
    )

    def draw(self, context: bpy.types.Context) -> None:
        layout = split(self.layout)
        manual.draw(layout)
        layout.separator()
        layout.prop(self, "default_mode")
        layout.prop(self, "live_update")

        layout.label(text="Path Overlay")
        column = layout.column()
        for name in (*filter(lambda name: name.endswith("_color"), vars(UNCHANGED)), "line_width"):
            column.prop(self, name)

        layout.label(text="Pie Menu")
        keymap.draw(context, layout)


UNCHANGED = SimpleNamespace(
    **{name: prop.keywords["default"] for name, prop in RigidMotionPreferences.__annotations__.items()}
)
