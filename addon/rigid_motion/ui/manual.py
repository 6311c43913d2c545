"""Where the documentation is: buttons that open it, and the pages behind *Online Manual* (F1)."""

from __future__ import annotations

from typing import Any

import bpy

WEBSITE = "https://example.org/rigid-motion"
"""The home of the project, in the manifest too. To be set before a release."""

DOCS = f"{WEBSITE}/blob/main/docs/"
"""The pages of the version that is worked on."""

ANIMATORS = "animators.md"

MODES = f"{ANIMATORS}#which-mode-is-good-for-what"
EDIT = f"{ANIMATORS}#edit"
BREAKDOWN = f"{ANIMATORS}#breakdown-push-and-relax"
LIMITS = f"{ANIMATORS}#limits"
EDIT_PATH = "on_the_path.md#edit-path"
LIVE = "live.md"
HOLDING = "holding.md"
ON_THE_PATH = "on_the_path.md"

PAGES = (
    ("bpy.ops.rigid_motion.set_mode", MODES),
    *((f"bpy.ops.rigid_motion.{name}", EDIT) for name in ("set_turns", "copy_mode", "add_cycles")),
    *(
        (f"bpy.ops.rigid_motion.{name}", f"{ANIMATORS}#breakdown-push-and-relax")
        for name in ("breakdown", "push", "relax")
    ),
    *(
        (f"bpy.ops.rigid_motion.{name}", f"{HOLDING}#{anchor}")
        for name, anchor in (
            ("hold_in*", "hold-in"),
            ("let_go", "let-go"),
            ("match_grip", "match-grip"),
            ("pass_frames", "pass"),
        )
    ),
    ("bpy.types.scene.rigid_motion_pass", f"{HOLDING}#pass"),
    ("bpy.ops.rigid_motion.go_to_deviation", f"{ON_THE_PATH}#deviations"),
    ("bpy.types.rigidmotionoverlay.*deviation*", f"{ON_THE_PATH}#deviations"),
    ("bpy.ops.rigid_motion.*_layer", f"{ON_THE_PATH}#layers"),
    ("bpy.ops.rigid_motion.equalise_speed", f"{ON_THE_PATH}#speed"),
    *((f"bpy.types.rigidmotionoverlay.{name}", f"{ON_THE_PATH}#ghosts") for name in ("*ghost*", "show_bodies")),
    ("bpy.types.rigidmotionoverlay.*speed*", f"{ON_THE_PATH}#speed"),
    ("bpy.ops.rigid_motion.update_path", f"{ANIMATORS}#see-the-motion"),
    *(
        (f"bpy.ops.rigid_motion.{name}", EDIT_PATH)
        for name in ("edit_path", "*_path_key*", "set_path_point", "drag_path_tangent")
    ),
    ("bpy.ops.rigid_motion.*bake", f"{ANIMATORS}#bake"),
    ("bpy.ops.rigid_motion.reduce_keys", "reduction.md"),
    ("bpy.ops.rigid_motion.clean_motion", f"{ANIMATORS}#clean-motion"),
    ("bpy.ops.rigid_motion.*_keys", f"{ANIMATORS}#reduce-keys"),
    ("bpy.ops.rigid_motion.refresh", LIMITS),
    ("bpy.ops.rigid_motion.live_*", LIVE),
    ("bpy.ops.rigid_motion.*", f"{ANIMATORS}#choose-a-mode"),
    ("bpy.types.livesettings.*", LIVE),
    ("bpy.types.livebone.*", LIVE),
    ("bpy.types.rigidmotion.mode", MODES),
    ("bpy.types.rigidmotion.lead", EDIT_PATH),
    ("bpy.types.rigidmotion.*", EDIT),
    ("bpy.types.rigidmotionoverlay.*", f"{ANIMATORS}#see-the-motion"),
    ("bpy.types.rigidmotionpreferences.*", f"{ANIMATORS}#install"),
)
"""Operators and properties, in lower case as Blender asks for them, and the page of each: the first that fits."""


def pages() -> tuple[str, tuple[tuple[str, str], ...]]:
    """Return what Blender asks for: where pages are, and which is whose."""
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
