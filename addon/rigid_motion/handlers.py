"""Blender's lists of handlers, `bpy.app.handlers`: what each module that follows what happens puts into them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import bpy


def append_handlers(handlers: Mapping[str, Callable]) -> None:
    """Add handlers to Blender's lists, by the names of these."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).append(handler)


def remove_handlers(handlers: Mapping[str, Callable]) -> None:
    """Take them off again."""
    for name, handler in handlers.items():
        getattr(bpy.app.handlers, name).remove(handler)
