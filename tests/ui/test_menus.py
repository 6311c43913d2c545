"""Menus and pies, as far as they are the same without a window: what they offer. How they look, tests/gui shows."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import pytest

from rigid_motion.animation import MODE_IDS
from rigid_motion.ui import menus
from tests.ui.conftest import select_keys


class Layout:
    """Notes what a menu draws."""

    def __init__(self):
        self.drawn = []

    def menu_pie(self):
        return self

    def separator(self):
        pass

    def menu(self, name, text="", translate=True):
        self.drawn.append((name, "", ""))

    def operator(self, name, text="", icon="NONE", translate=True):
        properties = SimpleNamespace(mode="", on="", name="", text=text)
        self.drawn.append((name, icon, properties))
        return properties


def drawn(menu):
    """What a menu draws for the active object: operator or menu, icon, properties."""
    layout = Layout()
    own = {name: getattr(menu, name, None) for name in ("scope", "pie")}
    menu.draw(SimpleNamespace(layout=layout, **own), bpy.context)
    return layout.drawn


MODE_MENUS = [menu for menu in menus.CLASSES if menu.__name__.startswith("RIGID_MOTION_MT_")]


@pytest.mark.parametrize("menu", MODE_MENUS, ids=lambda menu: menu.__name__)
def test_every_menu_offers_every_mode(tool, menu):
    offered = [properties.mode for name, _, properties in drawn(menu) if name == "rigid_motion.set_mode"]
    assert sorted(offered) == sorted(MODE_IDS)


def test_the_mode_that_is_chosen_is_ticked(tool):
    bpy.ops.rigid_motion.set_mode(mode="pga_lerp")
    ticked = {p.mode: icon for name, icon, p in drawn(menus.RIGID_MOTION_MT_object) if name == "rigid_motion.set_mode"}
    assert [mode for mode, icon in ticked.items() if icon == "CHECKMARK"] == ["pga_lerp"]


def test_modes_that_are_mixed_have_dots(tool):
    select_keys(tool, 11.0)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp", on="SELECTED")
    icons = {p.mode: icon for name, icon, p in drawn(menus.RIGID_MOTION_MT_object) if name == "rigid_motion.set_mode"}
    assert {mode for mode, icon in icons.items() if icon == "DOT"} == {"BLENDER", "dq_sclerp"}
    assert "CHECKMARK" not in icons.values()


def test_menus_draw_without_an_object(extension):
    for menu in MODE_MENUS:
        assert drawn(menu)
