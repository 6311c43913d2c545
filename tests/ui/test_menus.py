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
    own = {name: getattr(menu, name, None) for name in ("scope", "pie", "posing")}
    menu.draw(SimpleNamespace(layout=layout, **own), bpy.context)
    return layout.drawn


def names_in(menu):
    """What a menu calls each mode."""
    return {properties.mode: properties.text for name, _, properties in drawn(menu) if name == "rigid_motion.set_mode"}


MODE_MENUS = [menu for menu in menus.CLASSES if menu.__name__.startswith("RIGID_MOTION_MT_")]


@pytest.mark.parametrize("menu", MODE_MENUS, ids=lambda menu: menu.__name__)
def test_every_menu_offers_every_mode(tool, menu):
    offered = [properties.mode for name, _, properties in drawn(menu) if name == "rigid_motion.set_mode"]
    assert sorted(offered) == sorted(MODE_IDS)


PIES = [menus.RIGID_MOTION_MT_pie_object, menus.RIGID_MOTION_MT_pie_pose, menus.RIGID_MOTION_MT_pie_keys]


@pytest.mark.parametrize("menu", [menu for menu in MODE_MENUS if menu not in PIES], ids=lambda menu: menu.__name__)
def test_menus_have_blenders_own_first_and_then_the_mode_to_take_for_most(tool, menu):
    offered = [properties.mode for name, _, properties in drawn(menu) if name == "rigid_motion.set_mode"]
    assert offered[:3] == ["BLENDER", "motor_spline", "dq_sclerp"]


@pytest.mark.parametrize("menu", PIES)
def test_a_pie_has_a_slice_for_each_mode_and_no_more(tool, menu):
    west, east, _south, north, *_ = (properties.mode for _, _, properties in drawn(menu))
    assert (west, east, north) == ("BLENDER", "dq_sclerp", "motor_spline")
    # More than eight slices would go into a menu below the pie.
    assert len(drawn(menu)) == len(MODE_IDS) == 8


@pytest.mark.parametrize("menu", PIES)
def test_a_pie_has_short_names_and_menus_keep_the_algebra(tool, menu):
    slices = names_in(menu)
    assert slices["motor_spline"] == "Smooth Screw"
    assert slices["dq_sclerp"] == "Screw"
    assert slices["cga_slerp"] == "Spiral"
    assert not any("(" in text for text in slices.values())
    assert len(set(slices.values())) == len(slices)
    listed = names_in(menus.RIGID_MOTION_MT_object)
    assert listed["motor_spline"] == "Smooth Screw (PGA)"
    assert listed["dq_sclerp"] == "Screw (Dual Quaternion)"
    assert listed["cga_slerp"] == "Versor Spiral (CGA)"


def test_a_tooltip_has_the_algebra_and_says_what_is_the_same_motion_as_another(tool):
    def tooltip(mode):
        properties = SimpleNamespace(mode=mode, on="WHOLE", is_property_set=lambda name: True)
        return bpy.types.RIGID_MOTION_OT_set_mode.description(bpy.context, properties).splitlines()

    assert tooltip("dq_sclerp")[1] == "Algebra: dual quaternions"
    assert tooltip("pga_slerp") == [
        "The screw motion, by the exponential of the motor's logarithm. The same motion as Screw.",
        "Algebra: motors of projective geometric algebra (PGA)",
        "On: All Segments",
    ]
    assert tooltip("cga_lerp")[0].endswith("The same motion as Motor Blend where nothing grows.")
    assert len(tooltip("lerp_slerp")) == len(tooltip("BLENDER")) == 2


@pytest.mark.parametrize("mode", MODE_IDS)
def test_a_pie_ticks_every_mode_that_is_chosen(tool, mode):
    bpy.ops.rigid_motion.set_mode(mode=mode)
    assert [p.mode for _, icon, p in drawn(PIES[0]) if icon == "CHECKMARK"] == [mode]


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


def test_of_selected_keys_the_last_one_has_no_say(tool):
    select_keys(tool, 21.0)
    bpy.ops.rigid_motion.set_mode(mode="dq_sclerp", on="SELECTED")
    select_keys(tool, 21.0, 41.0)
    icons = {p.mode: icon for name, icon, p in drawn(menus.RIGID_MOTION_MT_keys) if name == "rigid_motion.set_mode"}
    assert [mode for mode, icon in icons.items() if icon == "CHECKMARK"] == ["dq_sclerp"]


def test_menus_draw_without_an_object(extension):
    for menu in MODE_MENUS:
        assert drawn(menu)
