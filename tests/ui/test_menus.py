"""Menus and pies, tested without a window; descriptions, and the manual, whose pages F1 and buttons open."""

from __future__ import annotations

import tomllib
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import bpy
import numpy as np
import pytest
from bl_operators.wm import WM_OT_doc_view_manual, _wm_doc_get_id

from rigid_motion.animation import MODE_IDS, write_channel
from rigid_motion.animation.properties import RigidMotion
from rigid_motion.ui import CLASSES, gltf_export, live, manual, menus
from rigid_motion.ui.overlay.settings import RigidMotionOverlay
from rigid_motion.ui.preferences import RigidMotionPreferences
from tests.test_glossary import anchors
from tests.ui.conftest import FRAMES, select_keys


def drawn(menu):
    """Return what a menu draws for the active object: operator, icon, properties."""
    result = []

    def operator(name, text="", icon="NONE", **_):
        result.append((name, icon, SimpleNamespace(mode="", on="", name="", text=text)))
        return result[-1][-1]

    layout = Mock(spec=["menu_pie", "separator", "menu", "operator_menu_enum"], operator=operator)
    layout.menu_pie.return_value = layout
    own = {name: getattr(menu, name, None) for name in ("scope", "pie", "menu", "other_menu")}
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


ROOT = Path(__file__).resolve().parents[2]


def page(doc_id: str) -> str | None:
    """Return the page that Blender opens for the id of a button, for example "RIGID_MOTION_OT_bake.step"."""
    return WM_OT_doc_view_manual._lookup_rna_url(_wm_doc_get_id(doc_id, do_url=False), verbose=False)


def test_every_operator_and_its_properties_say_what_they_are_for_and_it_has_a_page(extension):
    for operator in (cls for cls in CLASSES if issubclass(cls, bpy.types.Operator)):
        assert page(operator.bl_idname).startswith(manual.DOCS), operator
        assert operator.bl_idname.startswith("rigid_motion.")
        assert operator.bl_description, operator
        assert not operator.bl_description.endswith("."), operator
        # Exports and ports change nothing that could be undone.
        without_undo = operator.__module__ in (gltf_export.__name__, live.__name__)
        assert {"REGISTER", "UNDO"} - operator.bl_options <= ({"UNDO"} if without_undo else set()), operator
        kind = getattr(bpy.ops.rigid_motion, operator.bl_idname.partition(".")[2]).get_rna_type()
        for prop in kind.properties:
            if prop.identifier != "rna_type":
                assert prop.name, (operator, prop.identifier)
                assert prop.description, (operator, prop.identifier)
                assert all(item.description for item in getattr(prop, "enum_items", ())), prop.identifier


@pytest.mark.parametrize(
    "cls",
    [RigidMotion, RigidMotionOverlay, RigidMotionPreferences],
    ids=lambda cls: cls.__name__,
)
def test_every_property_that_is_drawn_says_what_it_is_for_and_has_a_page(cls, extension):
    own = {name for base in cls.__mro__ for name in vars(base).get("__annotations__", {})}
    shown = [prop for prop in cls.bl_rna.properties if prop.identifier in own and not prop.is_hidden]
    assert shown
    for prop in shown:
        name = prop.identifier
        assert prop.name
        assert prop.description or prop.type == "COLLECTION"
        # Before 5.0 Blender cannot look up preferences of extensions by name, so the map is asked.
        url = WM_OT_doc_view_manual._lookup_rna_url(f"bpy.types.{cls.__name__}.{name}", verbose=False)
        assert url.startswith(manual.DOCS), name


def test_blenders_own_pages_stay_its_own(extension):
    assert page("Object.location").startswith("https://docs.blender.org/")


@pytest.mark.parametrize("target", sorted({page for _, page in manual.PAGES} | {manual.ANIMATORS}))
def test_every_page_is_in_the_checkout_and_has_the_heading(target):
    name, _, anchor = target.partition("#")
    text = (ROOT / "docs" / name).read_text(encoding="utf-8")
    assert not anchor or anchor in anchors(text)


def test_the_address_is_that_of_the_manifest():
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["website"] == manual.WEBSITE
    assert manual.DOCS.startswith(manual.WEBSITE)
