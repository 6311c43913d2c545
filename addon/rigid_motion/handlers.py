"""What Blender calls: its lists of handlers, `bpy.app.handlers`, for what happens, and what draws into its editors."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy

Drawing = tuple[type[bpy.types.Space], Callable[[], None]]
"""A kind of editor, and what is called when its main region is drawn."""

_handles: dict[Drawing, object] = {}
"""What Blender knows them by."""


def append_handlers(handlers: Mapping[str, Callable]) -> None:
    """Add handlers to Blender's lists, by the names of these."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).append(handler)


def remove_handlers(handlers: Mapping[str, Callable]) -> None:
    """Take them off again."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).remove(handler)


def append_drawing(space: type[bpy.types.Space], draw: Callable[[], None], moment: str = "POST_VIEW") -> None:
    """Have a function be called whenever an editor of this kind is drawn, which it is in windows alone."""
    if not bpy.app.background:
        _handles[space, draw] = space.draw_handler_add(draw, (), "WINDOW", moment)


def remove_drawing(space: type[bpy.types.Space], draw: Callable[[], None]) -> None:
    """Have it be called no longer."""
    if (handle := _handles.pop((space, draw), None)) is not None:
        space.draw_handler_remove(handle, "WINDOW")
