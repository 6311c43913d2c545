"""A new file without objects at factory settings, as often as tests ask for one."""

import bpy

Settings = list[tuple[str, str, object]]

_factory: Settings = []
"""Blender's preferences as it comes, once they were asked for."""


def blank() -> bpy.types.Context:
    """Begin a new file without objects, at factory settings.

    Blender loads all of its add-ons anew with factory settings, six times the work of a new file: that is done only
    where the preferences are no longer as they come.
    """
    if _factory and _preferences() == _factory:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    else:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        _factory[:] = _factory or _preferences()
    return bpy.context


def _preferences() -> Settings:
    """Every preference that is one value or a list of values, but for colours; and which add-ons are on."""
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
