"""Links to the documentation: buttons that open it, and the pages behind *Online Manual* (F1)."""

from __future__ import annotations

from typing import Any

import bpy

WEBSITE = "https://example.org/rigid-motion"
"""The project's website, also in the manifest. It must be set before a release."""

DOCS = f"{WEBSITE}/blob/main/docs/"
"""The pages of the version in development."""

ANIMATORS = "animators.md"

MODES = f"{ANIMATORS}#which-mode-is-good-for-what"
EDIT = f"{ANIMATORS}#edit"
BREAKDOWN = f"{ANIMATORS}#breakdown-push-and-relax"
LIMITS = f"{ANIMATORS}#limits"
EDIT_PATH = "on_the_path.md#edit-path"
LIVE = "live.md"
HOLDING = "holding.md"
ON_THE_PATH = "on_the_path.md"

OF_OPERATORS = (
    (MODES, "set_mode"),
    (EDIT, "set_turns", "copy_mode", "add_cycles"),
    (BREAKDOWN, "breakdown", "push", "relax"),
    (f"{HOLDING}#hold-in", "hold_in*"),
    (f"{HOLDING}#let-go", "let_go"),
    (f"{HOLDING}#match-grip", "match_grip"),
    (f"{HOLDING}#pass", "pass_frames"),
    (f"{ON_THE_PATH}#deviations", "go_to_deviation"),
    (f"{ON_THE_PATH}#layers", "*_layer"),
    (f"{ON_THE_PATH}#speed", "equalise_speed"),
    (f"{ANIMATORS}#see-the-motion", "update_path"),
    (EDIT_PATH, "edit_path", "*_path_key*", "set_path_point", "drag_path_tangent"),
    (f"{ANIMATORS}#bake", "*bake"),
    ("reduction.md", "reduce_keys"),
    (f"{ANIMATORS}#clean-motion", "clean_motion"),
    (f"{ANIMATORS}#reduce-keys", "*_keys"),
    (LIMITS, "refresh"),
    (LIVE, "live_*"),
    (f"{ANIMATORS}#choose-a-mode", "*"),
)
OF_PROPERTIES = (
    (f"{HOLDING}#pass", "scene.rigid_motion_pass"),
    (f"{ON_THE_PATH}#deviations", "rigidmotionoverlay.*deviation*"),
    (f"{ON_THE_PATH}#ghosts", "rigidmotionoverlay.*ghost*", "rigidmotionoverlay.show_bodies"),
    (f"{ON_THE_PATH}#speed", "rigidmotionoverlay.*speed*"),
    (f"{ANIMATORS}#see-the-motion", "rigidmotionoverlay.*"),
    (LIVE, "livesettings.*", "livebone.*"),
    (MODES, "rigidmotion.mode"),
    (EDIT_PATH, "rigidmotion.lead"),
    (EDIT, "rigidmotion.*"),
    (f"{ANIMATORS}#install", "rigidmotionpreferences.*"),
)
PAGES = tuple(
    (f"{kind}.{name}", page)
    for kind, table in (("bpy.ops.rigid_motion", OF_OPERATORS), ("bpy.types", OF_PROPERTIES))
    for page, *names in table
    for name in names
)
"""Patterns of operators and properties, in lower case as Blender requires, and their pages. The first match counts."""


def pages() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return the manual map that Blender asks for: the base URL, and the page of each pattern."""
    return DOCS, PAGES


def draw(layout: bpy.types.UILayout) -> None:
    """Draw buttons that open the documentation and the website."""
    row: Any = layout.row()
    row.operator("wm.url_open", text="Documentation", icon="HELP").url = DOCS + ANIMATORS
    row.operator("wm.url_open", text="Website", icon="URL").url = WEBSITE


def register() -> None:
    bpy.utils.register_manual_map(pages)


def unregister() -> None:
    bpy.utils.unregister_manual_map(pages)
