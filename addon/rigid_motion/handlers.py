"""Callbacks that Blender calls: adding and removing functions in `bpy.app.handlers`, and draw handlers of editors."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy

Drawing = tuple[type[bpy.types.Space], Callable[[], None]]
"""A type of editor, and the function called when its main region is drawn."""

_handles: dict[Drawing, object] = {}
"""Blender's handle of each draw handler, needed to remove it."""


def append_handlers(handlers: Mapping[str, Callable]) -> None:
    """Add handlers to Blender's lists; the keys are the names of the lists."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).append(handler)


def remove_handlers(handlers: Mapping[str, Callable]) -> None:
    """Remove handlers from Blender's lists."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).remove(handler)


def append_drawing(space: type[bpy.types.Space], draw: Callable[[], None], moment: str = "POST_VIEW") -> None:
    """Call a function whenever an editor of this type is drawn. Does nothing in background mode."""
    if not bpy.app.background:
        _handles[space, draw] = space.draw_handler_add(draw, (), "WINDOW", moment)


def remove_drawing(space: type[bpy.types.Space], draw: Callable[[], None]) -> None:
    """Stop calling a function when an editor of this type is drawn."""
    if (handle := _handles.pop((space, draw), None)) is not None:
        space.draw_handler_remove(handle, "WINDOW")
