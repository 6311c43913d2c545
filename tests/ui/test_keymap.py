"""The extension's shortcuts are free in Blender's own keymaps."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import bpy
import pytest

SHARED = {"Window", "Screen", "Screen Editing", "Frames", "Animation", "Markers", "View2D", "Animation Channels"}
"""Keymaps that apply in all editors, or in parts of them."""

OF_EDITORS = {"3D View", "3D View Generic", "Object Mode", "Object Non-modal", "Pose"}
OF_EDITORS |= {"Dopesheet", "Dopesheet Generic", "Graph Editor", "Graph Editor Generic"}


def keymaps_of_blender(name):
    """Yield the keymaps of a key configuration: the name, and the operator, key and modifiers of each item."""
    path = Path(bpy.utils.system_resource("SCRIPTS")) / "presets/keyconfig/keymap_data" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for keymap_name, _, content in module.generate_keymaps(module.Params()):
        yield keymap_name, [item[:2] for item in content["items"]]


@pytest.mark.parametrize("name", ["blender_default", "industry_compatible_data"])
def test_the_shortcut_is_free(name):
    looked_through = set()
    for keymap_name, items in keymaps_of_blender(name):
        if keymap_name in SHARED | OF_EDITORS:
            looked_through.add(keymap_name)
            taken = [event for _, event in items if event["type"] == "T" and (event.get("alt") or event.get("any"))]
            assert not [event for event in taken if not event.get("ctrl")], keymap_name
    assert looked_through == SHARED | OF_EDITORS
