"""New empty files at factory settings, cheap enough for every test."""

import bpy

Settings = list[tuple[str, str, object]]

_factory: Settings = []
"""Blender's factory preferences, once they have been read."""


def blank() -> bpy.types.Context:
    """Start a new file without objects, at factory settings.

    With factory settings, Blender loads all of its add-ons again, which takes six times as long as a new file: that
    happens only if the preferences have changed.
    """
    if _factory and _preferences() == _factory:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        _factory[:] = _factory or _preferences()
    return bpy.context


def _preferences() -> Settings:
    """Return every preference that is one value or a list of values, except colours, and the enabled add-ons."""
    preferences = bpy.context.preferences
    result: Settings = [("addons", entry.module, True) for entry in preferences.addons]
    for part in preferences.bl_rna.properties:
        if part.type == "POINTER" and part.identifier != "rna_type":
            owner = getattr(preferences, part.identifier)
            for setting in owner.bl_rna.properties:
                if setting.type not in ("POINTER", "COLLECTION"):
                    value = getattr(owner, setting.identifier)
                    listed = getattr(setting, "is_array", False)
                    result.append((part.identifier, setting.identifier, tuple(value) if listed else value))
    return result
