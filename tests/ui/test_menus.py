"""Entries of menus and pies, tested without a window. Tests in tests/gui show their looks."""

from __future__ import annotations

from types import SimpleNamespace
from unittest.mock import Mock

import bpy
import numpy as np
import pytest

from rigid_motion.animation import MODE_IDS, write_channel
from rigid_motion.ui import menus
from tests.ui.conftest import FRAMES, select_keys


def drawn(menu):
    """Return what a menu draws for the active object: operator, icon, properties."""
    result = []

    def operator(name, text="", icon="NONE", **_):
        result.append((name, icon, SimpleNamespace(mode="", on="", name="", text=text)))
        return result[-1][-1]

    layout = Mock(spec=["menu_pie", "separator", "menu", "operator_menu_enum"], operator=operator)
    layout.menu_pie.return_value = layout
    own = {name: getattr(menu, name, None) for name in ("scope", "pie", "menu", "beside")}
    menu.draw(SimpleNamespace(layout=layout, **own), bpy.context)
    return result


PIES = [menus.RIGID_MOTION_MT_pie_view, menus.RIGID_MOTION_MT_pie_keys]
MODE_MENUS = [getattr(menus, f"RIGID_MOTION_MT_{name}") for name in ("view", "keys", "current", "whole")]


def offered(menu):
    """Return the modes that a menu offers, with their labels."""
    return {properties.mode: properties.text for name, _, properties in drawn(menu) if name == "rigid_motion.set_mode"}


@pytest.mark.parametrize("menu", MODE_MENUS, ids=lambda menu: menu.__name__)
def test_every_menu_offers_every_mode_and_says_which_are_one_motion(tool, menu):
    modes = offered(menu)
    assert sorted(modes) == sorted(MODE_IDS)
    assert {text for text in modes.values() if "=" in text} == {
        *("Motor Screw (= Screw)", "Spiral (= Screw)", "Spiral Blend (= Screw Blend)")
    }


@pytest.mark.parametrize("menu", PIES, ids=lambda menu: menu.__name__)
def test_a_pie_has_one_slice_for_each_motion_and_the_way_to_all_modes(tool, menu):
    motions = {"BLENDER", "motor_spline", "dq_sclerp", "lerp_slerp", "pga_lerp"}
    assert offered(menu).keys() == motions
    more, hold = [properties.name for name, _, properties in drawn(menu) if name == "wm.call_menu"]
    assert offered(getattr(bpy.types, more)).keys() == set(MODE_IDS)
    assert "rigid_motion.hold_in" in {name for name, *_ in drawn(getattr(bpy.types, hold))}
    write_channel(tool, "scale", FRAMES, np.ones((len(FRAMES), 3)))
    assert offered(menu).keys() == motions | {"cga_slerp"}


def test_the_mode_that_is_chosen_is_ticked_and_modes_that_are_mixed_have_dots(tool):
    bpy.ops.rigid_motion.set_mode(mode="pga_lerp")
    assert icons() == {"pga_lerp": "CHECKMARK"}
    select_keys(tool, 11.0)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp", on="SELECTED")
    assert icons() == {"pga_lerp": "DOT", "dq_sclerp": "DOT"}


def icons():
    """Return the icons of the modes that have one."""
    entries = drawn(menus.RIGID_MOTION_MT_view)
    return {p.mode: icon for name, icon, p in entries if name == "rigid_motion.set_mode" and icon != "BLANK1"}


def test_menus_draw_without_an_object(extension):
    for menu in (*MODE_MENUS, *PIES):
        assert drawn(menu)
