"""Descriptions, and the manual: F1 on operators and properties, and buttons in the preferences, open the right page."""

from __future__ import annotations

import tomllib
from pathlib import Path

import bpy
import pytest
from bl_operators.wm import WM_OT_doc_view_manual, _wm_doc_get_id

from rigid_motion.animation.properties import RigidMotion
from rigid_motion.ui import CLASSES, gltf_export, live, manual
from rigid_motion.ui.overlay.settings import RigidMotionOverlay
from rigid_motion.ui.preferences import RigidMotionPreferences
from tests.test_glossary import anchors

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
