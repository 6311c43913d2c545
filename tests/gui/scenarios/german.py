"""German translation in Blender's interface: a report, the panel, tooltips, menus, the pie and the preferences.

Blender's module for Python has no languages, so the translation is tested in the real interface here.
"""

from __future__ import annotations

from importlib import import_module

import addon_utils
import bpy
from bpy.app.translations import pgettext_iface, pgettext_rpt, pgettext_tip

from tests.animation.bones.rigs import select_only
from tests.animation.keyed import curves_of
from tests.animation.scenes import turning
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import cube, extension

SCREW = "dq_sclerp"

NOTHING_REDUCED = "The keys here are neither reduced nor cleaned"


def speak(language: str) -> None:
    view = bpy.context.preferences.view
    view.language = language
    view.use_translate_interface = view.use_translate_reports = view.use_translate_tooltips = True


def notes(frame: int) -> list[str]:
    """Return the notes of the panel for the cube on a frame."""
    bpy.context.scene.frame_set(frame)
    return [text for _, text in import_module(f"{extension().module}.ui.notes").facts_and_notes(cube(), frame)[1]]


def scenario(hand: Hand) -> Steps[None]:
    """An animator works in German, then in English again, then without the extension."""
    speak("de_DE")
    bpy.data.objects.remove(cube())
    select_only(turning("Cube", (0.0, 90.0, 269.0), (1.0, 20.0, 40.0)))
    view = hand.area("VIEW_3D")
    yield from in_the_panel(hand, view)
    yield from refused()
    yield from in_menus(hand, view)
    yield from of_others(hand, view)
    yield from preferences(hand)
    yield from other_languages()


def refused() -> Steps[None]:
    """Check a refusal, and a tooltip that an operator assembles."""
    modifiers = curves_of(cube())["location", 1].modifiers
    envelope = modifiers.new("ENVELOPE")
    (note,) = notes(10)
    assert "Position Y hat eine Hüllkurve" in note, note
    modifiers.remove(envelope)
    operators = import_module(f"{extension().module}.ui.operators")
    tooltip = pgettext_tip(operators.RIGID_MOTION_OT_unbake.bl_description)
    assert tooltip.startswith("Gebackenem die Aktion zurückgeben"), tooltip
    yield


def in_the_panel(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Take pictures of the panel where space is short and where notes are long."""
    yield from hand.open_sidebar(view, "Animation")
    sidebar = places.region(view, "UI")
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    bpy.context.scene.rigid_motion_overlay.show_paths = True
    assert notes(10) == []
    yield from hand.picture("panel", places.box(sidebar))
    (note,) = notes(30)
    assert note.startswith("179.0° sind fast eine halbe Umdrehung"), note
    yield from hand.picture("panel-with-a-note", places.box(sidebar))
    bpy.ops.rigid_motion.reduce_keys("EXEC_DEFAULT", tolerance=10.0)
    yield from hand.picture("panel-reduced", places.box(sidebar))
    bpy.ops.rigid_motion.restore_keys()
    bpy.ops.rigid_motion.set_mode(mode=SCREW)
    yield from hand.click((yield from hand.find_button(view, "UI", "rigid_motion.bake")))
    yield from hand.picture("bake")
    yield from hand.press("ESC")


def of_others(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Take pictures of the sidebar with a refusal, without keys, and without an active object, with its Item tab.

    `tests/ui/test_panels.py` checks the notes for each object without a window.
    """
    sidebar, seen = places.region(view, "UI"), set[bytes]()
    for number, act in enumerate(
        (
            lambda: None,
            lambda: setattr(cube(), "rotation_mode", "AXIS_ANGLE"),
            lambda: cube().animation_data_clear(),
            lambda: setattr(bpy.context.view_layer.objects, "active", None),
        )
    ):
        act()
        pixels = yield from hand.picture(f"others-{number}", places.box(sidebar))
        seen.add(pixels.tobytes())
        assert len(seen) == number + 1, "nothing new in the sidebar"


def in_menus(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Take pictures of the pie and of the context menu."""
    centre = places.centre(places.region(view))
    yield from hand.hover(centre)
    yield from hand.pie("T", "N", picture="pie", box=places.box_around(centre, 900, 420), alt=True)
    yield from hand.click(centre, button="RIGHTMOUSE")
    yield from hand.press("UP_ARROW")
    yield from hand.press("RIGHT_ARROW")
    yield from hand.picture("menu")
    yield from hand.press("ESC")
    yield from hand.press("ESC")


def preferences(hand: Hand) -> Steps[None]:
    """Take a picture of the extension's preferences, in the window of Blender's own."""
    module = next(module for module in addon_utils.modules() if module.__name__ == extension().module)
    addon_utils.module_bl_info(module)["show_expanded"] = True
    bpy.context.window_manager.addon_search = "Rigid Motion"
    bpy.ops.screen.userpref_show()
    yield from hand.wait_until(lambda: len(bpy.context.window_manager.windows) == 2, "the preferences open")
    bpy.context.preferences.active_section = "ADDONS"
    yield 1.0
    yield from hand.picture("preferences")


def other_languages() -> Steps[None]:
    """Check that texts are English in English, in languages without a translation, and without the extension."""
    assert pgettext_rpt(NOTHING_REDUCED).startswith("Die Schlüsselbilder")
    assert pgettext_iface("Live Update") == "Live-Aktualisierung"
    for language in ("en_US", "fr_FR"):
        speak(language)
        yield
        assert pgettext_rpt(NOTHING_REDUCED) == NOTHING_REDUCED
    speak("de_DE")
    bpy.ops.preferences.addon_disable(module=extension().module)
    yield
    assert pgettext_rpt(NOTHING_REDUCED) == NOTHING_REDUCED, "an extension that is off translates nothing"
