"""Rigify's human, between keys: the parent of a hand switched in the sidebar and by F3, undone, and Apply Visual
Transform to Pose. The hand stays where it is seen."""

from __future__ import annotations

import bpy
import numpy as np

from tests.animation.bones.poses import seen
from tests.animation.keyed import key_frames
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.rigs.human import human
from tests.rigs.poses import key_controls

HAND, TORSO = "hand_ik.L", "torso"
POSES = {HAND: ((0.3, -0.2, 0.4), (0.9, 0.7, 1.2)), TORSO: ((0.2, 0.3, 0.1), (0.2, 0.5, 1.4))}
KEYS = 1, 21
PARENTS = ["None", "Root", "Torso", "Hips", "Chest", "Head"]

STAYS = 1e-5
"""Metres, and parts of a rotation matrix."""

BESIDE, ABOVE = "rigify_transfer_use_all_keys", 62
"""What the button in the Item tab is above of, and by how many pixels: Blender does not tell what it calls."""


def rig() -> bpy.types.Object:
    """The rig, asked for anew each time: undo replaces it."""
    return bpy.data.objects["rig"]


def parent() -> str:
    return PARENTS[rig().pose.bones["upper_arm_parent.L"]["IK_parent"]]


def select(*names: str) -> None:
    for bone in rig().pose.bones:
        bone.select = bone.name in names
    rig().data.bones.active = rig().data.bones[names[0]]


def assert_stays(before: np.ndarray, what: str) -> None:
    off = np.abs(seen(rig(), HAND) - before).max()
    assert off < STAYS, f"{what}: off by {off}"


def go(frame: int) -> Steps[np.ndarray]:
    bpy.context.scene.frame_set(frame)
    yield
    return seen(rig(), HAND)


def scenario(hand: Hand) -> Steps[None]:
    """An animator switches what a hand hangs on between two keys."""
    view = hand.area("VIEW_3D")
    yield from pose_the_human(hand, view)
    yield from by_search(hand, view)
    yield from apply(hand, view)
    bpy.context.scene.tool_settings.use_keyframe_insert_auto = True
    yield from in_the_sidebar(hand, view)


def pose_the_human(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """The human with its own operators, keys on a hand and the torso, and a screw for both from the pie."""
    bpy.data.batch_remove(bpy.data.objects)
    human()
    rig()["rig_ui"].as_module()
    for collection in rig().data.collections_all:
        collection.is_visible = collection.name not in ("DEF", "MCH", "ORG")
    bpy.context.view_layer.objects.active = rig()
    rig().select_set(True)
    key_controls(rig(), POSES, KEYS)
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("TAB", ctrl=True)
    select(HAND, TORSO)
    yield from hand.pie("T", "E", alt=True)
    select(HAND)


def by_search(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """F3, which has the entries of the menu in Pose; and the menu as a shortcut opens it."""
    before = yield from go(16)
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Switch Parent on Screen Chest")
    yield from hand.wait_until(lambda: parent() == "Chest", "the hand hangs on the chest")
    assert_stays(before, "switched by F3")
    with bpy.context.temp_override(window=hand.window, area=view, region=places.region(view)):
        bpy.ops.rigid_motion.switch_parent("INVOKE_DEFAULT")
    yield 0.3
    yield from hand.choose_row(PARENTS.index("Hips"))
    yield from hand.wait_until(lambda: parent() == "Hips", "the hand hangs on the hips")
    assert_stays(before, "switched by a shortcut")


def apply(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Apply Visual Transform to Pose after switches, undone."""
    before = yield from go(8)
    bpy.ops.ed.undo_push(message="Frame")
    channels = tuple(rig().pose.bones[HAND].location)
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.search("Apply Visual Transform to Pose")
    assert_stays(before, "the visual transform applied")
    assert tuple(rig().pose.bones[HAND].location) != channels
    yield from hand.press("Z", ctrl=True)
    assert tuple(rig().pose.bones[HAND].location) == channels
    assert_stays(before, "the visual transform undone")


def in_the_sidebar(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """The button in the Item tab, an entry of its menu, with Auto Key; undone, redone; another frame and back."""
    frame, to, hung_on = 11, "Torso", parent()
    before = yield from go(frame)
    bpy.ops.ed.undo_push(message="Frame")
    yield from hand.open_sidebar(view, "Item")
    x, y = yield from hand.find_button(view, "UI", BESIDE)
    yield from hand.click((x, y + ABOVE))
    yield from hand.picture("menu")
    yield from hand.choose_row(PARENTS.index(to))
    yield from hand.wait_until(lambda: parent() == to, f"the hand hangs on {to}")
    assert_stays(before, "switched")
    assert frame in key_frames(rig().pose.bones[HAND])
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: parent() == hung_on, "the switch is undone")
    assert_stays(before, "undone")
    assert frame not in key_frames(rig().pose.bones[HAND])
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: parent() == to, "the switch is redone")
    yield from go(frame + 1)
    yield from go(frame)
    assert_stays(before, "another frame and back")
