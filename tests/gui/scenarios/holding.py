"""A mug that one rig picks up, hands over to its other hand and throws, and another one catches; then hands are edited.

By clicks and keys: the pie, its menu, the sidebar, the Key menu of the Dope Sheet, and the redo panel. In the end it is
measured how far the mug slips in the hands.
"""

from __future__ import annotations

import bpy
import numpy as np
from mathutils import Matrix, Quaternion, Vector

from rigid_motion.animation import hold_facts
from tests.gui import places
from tests.gui.driver import FOLDED_PANEL, Hand, Steps
from tests.gui.keyed import on_screen
from tests.rigs.human import human
from tests.rigs.scenes import GRIP, HANDSHAKE, key, make_fist, turned

TAKEN, PASSED, THROWN, CAUGHT, END = 20, 44, 66, 84, 110

TABLE = Vector((-0.22, -0.42, 1.0))
"""Where the mug stands."""

SLIP = 2e-6
"""How far a thing may be from where it was in the hand that holds it: parts of its matrix, lengths in metres."""


def obj(name: str) -> bpy.types.Object:
    return bpy.data.objects[name]


def grasped(side: str, fist: Vector, axes: Matrix) -> Matrix:
    """The pose of a hand that has the middle of its fist here."""
    grip = Vector((GRIP.x if side == "L" else -GRIP.x, *GRIP[1:]))
    result = axes.to_4x4()
    result.translation = fist - axes @ grip
    return result


def make_the_stage() -> None:
    """Two humans that face each other, with keys of their hands alone, a table, and a mug on it."""
    bpy.data.batch_remove(bpy.data.objects)
    bpy.context.scene.frame_end = END
    for name, place, turn in (("Alice", (0.0, 0.0, 0.0), 0.0), ("Bob", (0.1, -2.3, 0.0), 180.0)):
        rig = human()
        rig.name, rig.location, rig.rotation_euler.z = name, place, np.radians(turn)
        for side in "LR":
            make_fist(rig, side)
    level, tilted = HANDSHAKE, turned(-25.0, "X").to_3x3() @ HANDSHAKE
    raised, inwards = turned(60.0, "X").to_3x3() @ HANDSHAKE, turned(-35.0, "Z").to_3x3() @ HANDSHAKE
    for name, side, frame, fist, axes in (
        ("Alice", "R", 1, (-0.35, -0.25, 1.1), level),
        ("Alice", "R", TAKEN, TABLE, level),
        ("Alice", "R", 32, (-0.18, -0.36, 1.25), tilted),
        ("Alice", "R", PASSED, (0.0, -0.34, 1.2), inwards),
        ("Alice", "R", 58, (-0.3, -0.2, 1.0), level),
        ("Alice", "L", 1, (0.3, -0.2, 1.0), level),
        ("Alice", "L", 30, (0.3, -0.2, 1.0), level),
        ("Alice", "L", PASSED, (0.03, -0.34, 1.2), level),
        ("Alice", "L", 56, (0.25, -0.12, 1.05), tilted),
        ("Alice", "L", THROWN, (0.24, -0.52, 1.4), raised),
        ("Alice", "L", 76, (0.24, -0.4, 1.2), level),
        ("Bob", "R", 1, (-0.3, -0.2, 1.0), level),
        ("Bob", "R", 60, (-0.3, -0.2, 1.0), level),
        ("Bob", "R", CAUGHT, (-0.15, -0.5, 1.35), tilted),
        ("Bob", "R", 92, (-0.2, -0.35, 1.1), level),
        ("Bob", "R", END, (-0.25, -0.3, 1.25), inwards),
    ):
        key(obj(name).pose.bones[f"hand_ik.{side}"], frame, grasped(side, Vector(fist), axes))
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(-0.22, -0.5, 0.9))
    bpy.context.object.name, bpy.context.object.scale = "Table", (0.5, 0.4, 0.06)
    make_the_mug()
    bpy.context.scene.frame_set(1)


def make_the_mug() -> None:
    """A cup with a handle, upright, its origin in its middle."""
    bpy.ops.mesh.primitive_torus_add(
        major_radius=0.03, minor_radius=0.008, rotation=(np.pi / 2, 0, 0), location=(0.055, 0, 0)
    )
    handle = bpy.context.object
    bpy.ops.mesh.primitive_cylinder_add(vertices=24, radius=0.042, depth=0.12)
    handle.select_set(True)
    bpy.ops.object.join()
    mug = bpy.context.object
    bpy.ops.object.transform_apply()
    mug.name, mug.location, mug.rotation_mode = "Mug", TABLE, "QUATERNION"


def look_from(view: bpy.types.Area, place: tuple, distance: float, degrees: tuple = (78.0, 0.0, 62.0)) -> None:
    space = view.spaces.active.region_3d
    turn = turned(degrees[2], "Z") @ turned(degrees[0], "X")
    space.view_location, space.view_distance, space.view_rotation = place, distance, turn.to_quaternion()
    space.view_perspective = "PERSP"


def go_to(frame: int) -> Steps[None]:
    bpy.context.scene.frame_set(frame)
    yield


def scenario(hand: Hand) -> Steps[None]:
    """An animator lets two rigs toss a mug, and changes their hands afterwards."""
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    make_the_stage()
    show_arms_alone()
    look_from(view, (0.0, -1.0, 1.15), 3.0)
    bpy.ops.ed.undo_push(message="Stage")
    yield from hand.open_sidebar(sheet, "Animation")
    yield from picked_up(hand, view)
    yield from handed_over(hand, view, sheet)
    yield from thrown(hand, view)
    yield from caught(hand, view)
    yield from seen_in_the_sheet(hand, sheet)
    yield from seen_along_its_path(hand, view)
    yield from edited(hand, view)


def picked_up(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """From the table, by the pie; undone and done again as one step."""
    yield from go_to(TAKEN)
    yield from select_hand(hand, view, "Alice", "hand_ik.R")
    there = on_screen("Mug")
    yield from hand.pie("T", "NE", alt=True, picture="pie")
    yield 0.3
    yield from hand.picture("hold-menu")
    yield from hand.choose("Hold In")
    yield from hand.wait_until(lambda: now() == "hand_ik.R", "the right hand holds the mug")
    assert np.abs(on_screen("Mug") - there).max() < SLIP
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: now() == "" and not obj("Mug").animation_data, "one undo takes it all back")
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: now() == "hand_ik.R", "redone")
    yield from hand.picture("picked-up")


def handed_over(hand: Hand, view: bpy.types.Area, sheet: bpy.types.Area) -> Steps[None]:
    """To the left hand, by the Dope Sheet's Key menu; longer, in the redo panel."""
    yield from go_to(PASSED)
    yield from select_hand(hand, view, "Alice", "hand_ik.L")
    yield from hand.open_menu(sheet, "DOPESHEET_MT_key")
    for arrow in ("UP_ARROW", "RIGHT_ARROW"):
        yield from hand.press(arrow)
    yield 0.3
    yield from hand.picture("key-menu")
    for _ in range(2):
        yield from hand.press("ESC")
    yield from hand.open_menu(sheet, "DOPESHEET_MT_key")
    yield from hand.choose("Hold In")
    yield from hand.wait_until(lambda: now() == "hand_ik.L", "the left hand holds the mug")
    assert hold_facts(obj("Mug")).frames == 4
    yield from set_in_redo_panel(hand, sheet, 6)


def set_in_redo_panel(hand: Hand, area: bpy.types.Area, frames: int) -> Steps[None]:
    """Over how many frames it passes, in what is unfolded after an operator."""
    redo = yield from hand.unfold_redo_panel(area)
    yield from hand.picture(f"redo-{frames}")
    yield from hand.enter(str(frames), places.redo_row(redo, 0))
    yield from hand.wait_until(lambda: hold_facts(obj("Mug")).frames == frames, f"it passes over {frames} frames")


def thrown(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Let go over three frames, and two keys of its flight."""
    yield from go_to(THROWN)
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "NE", alt=True)
    yield 0.3
    yield from hand.choose("Let Go")
    yield from hand.wait_until(lambda: now() == "", "the mug is let go")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "NE", alt=True)
    yield 0.3
    yield from hand.choose("Pass")
    yield 0.3
    yield from hand.picture("pass")
    yield from hand.press("RET")
    yield from set_in_redo_panel(hand, view, 3)
    mug, start = obj("Mug"), Vector(on_screen("Mug")[:3, 3])
    end = Vector(fist_of("Bob", "hand_ik.R", CAUGHT))
    for share in (0.5, 0.94):
        frame = round(THROWN + share * (CAUGHT - THROWN))
        bpy.context.scene.frame_set(frame)
        mug.location = start.lerp(end, share) + Vector((0.0, 0.0, 4 * 0.25 * share * (1 - share)))
        mug.rotation_quaternion = mug.rotation_quaternion @ Quaternion((1.0, 0.0, 0.0), 0.9)
        for path in ("location", "rotation_quaternion"):
            mug.keyframe_insert(path, frame=frame)
    yield


def caught(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """By the other rig."""
    yield from go_to(CAUGHT)
    yield from select_hand(hand, view, "Bob", "hand_ik.R")
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.pie("T", "NE", alt=True)
    yield 0.3
    yield from hand.choose("Hold In")
    yield from hand.wait_until(lambda: now() == "hand_ik.R (Bob)", "the other rig holds the mug")
    bpy.ops.rigid_motion.pass_frames(frames=3)
    yield from hand.picture("caught")


def seen_in_the_sheet(hand: Hand, sheet: bpy.types.Area) -> Steps[None]:
    """The rows of what holds the mug, and the panel, where it is set how long it passes."""
    if bpy.context.mode == "POSE":
        bpy.ops.object.mode_set(mode="OBJECT")
    for item in bpy.context.view_layer.objects:
        item.select_set(item.name == "Mug")
    bpy.context.view_layer.objects.active = obj("Mug")
    bpy.ops.ed.undo_push(message="Select")
    yield from go_to(PASSED)
    channels = next(region for region in sheet.regions if region.type == "CHANNELS")
    yield from hand.hover((channels.x + 60, channels.y + channels.height - 60))
    for _ in range(3):
        yield from hand.press("NUMPAD_PLUS", ctrl=True)
    x, y = yield from hand.find_button(sheet, "UI", "show_paths", narrow=True)
    yield from hand.click((x + 60, y - FOLDED_PANEL))
    yield 0.3
    yield from hand.picture("panel")
    number = yield from hand.find_button(sheet, "UI", "rigid_motion_pass")
    yield from hand.click((number[0] + FOLDED_PANEL, number[1] + FOLDED_PANEL))
    yield 0.3
    yield from hand.picture("holders")
    yield from hand.press("ESC")
    yield from hand.enter("5", number)
    yield from hand.wait_until(lambda: hold_facts(obj("Mug")).frames == 5, "the number in the panel is at the key")
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: hold_facts(obj("Mug")).frames == 6, "undone")


def seen_along_its_path(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    settings = bpy.context.scene.rigid_motion_overlay
    settings.show_paths = True
    yield from hand.picture("path-before", places.box(places.region(view)))
    bpy.ops.rigid_motion.update_path()
    yield from hand.picture("path", places.box(places.region(view)))
    settings.show_ghosts = True
    yield from hand.picture("ghosts", places.box(places.region(view)))
    settings.show_ghosts = False


def edited(hand: Hand, view: bpy.types.Area) -> Steps[None]:
    """Both hands of the first rig, and the other's: the mug stays where it is held."""
    for rig, bone in (("Alice", "hand_ik.R"), ("Alice", "hand_ik.L"), ("Bob", "hand_ik.R")):
        for curve in obj(rig).animation_data.action.layers[0].strips[0].channelbags[0].fcurves:
            if curve.data_path == f'pose.bones["{bone}"].location':
                for point in curve.keyframe_points:
                    point.co_ui.y += 0.05 * (1 + curve.array_index) * np.sin(point.co.x)
        obj(rig).animation_data.action.id_data.update_tag()
    yield 0.5
    spans = (
        (TAKEN, PASSED - 6, "Alice", "hand_ik.R"),
        (PASSED, THROWN - 3, "Alice", "hand_ik.L"),
        (CAUGHT, END, "Bob", "hand_ik.R"),
    )
    worst = max(slip(rig, bone, first, last) for first, last, rig, bone in spans)
    assert worst < SLIP, worst
    bpy.context.scene.frame_set(PASSED - 3)
    yield from hand.picture("edited")


def slip(rig: str, bone: str, first: int, last: int) -> float:
    """By how much the mug goes astray in a hand on quarter frames, in parts of its matrix."""
    grips = []
    for quarter in range(4 * first, 4 * last + 1):
        bpy.context.scene.frame_set(quarter // 4, subframe=quarter % 4 / 4)
        posed = obj(rig).evaluated_get(bpy.context.evaluated_depsgraph_get())
        holder = np.array(posed.matrix_world, dtype=float) @ np.array(posed.pose.bones[bone].matrix, dtype=float)
        grips.append(np.linalg.inv(holder) @ on_screen("Mug"))
    return float(np.abs(np.array(grips) - grips[0]).max())


def fist_of(rig: str, bone: str, frame: int) -> Vector:
    """The middle of a right fist in the world."""
    bpy.context.scene.frame_set(frame)
    posed = obj(rig).evaluated_get(bpy.context.evaluated_depsgraph_get())
    return posed.matrix_world @ posed.pose.bones[bone].matrix @ Vector((-GRIP.x, *GRIP[1:]))


def now() -> str:
    """What holds the mug: the bone, with its rig if it is not the first one."""
    holder = hold_facts(obj("Mug")).now
    return "" if holder is None else holder.bone + (" (Bob)" if holder.target.name == "Bob" else "")


def show_arms_alone() -> None:
    """Bodies as bones, and of the controls those of hands."""
    for name in ("Alice", "Bob"):
        rig = obj(name)
        for collection in rig.data.collections_all:
            collection.is_visible = collection.name == "DEF" or collection.name in ("Arm.L (IK)", "Arm.R (IK)")
        for bone in rig.pose.bones:
            if not bone.name.startswith(("DEF-", "hand_ik")):
                bone.hide = True
        rig.data.display_type = "OCTAHEDRAL"


def select_hand(hand: Hand, view: bpy.types.Area, rig: str, bone: str) -> Steps[None]:
    """The mug by a click in Object Mode, then the rig, in Pose Mode a bone of it."""
    yield from hand.hover(places.centre(places.region(view)))
    if bpy.context.mode == "POSE":
        yield from hand.press("TAB", ctrl=True)
    if bpy.context.scene.frame_current == TAKEN:
        # Later a hand is around it, and that is what would be clicked on.
        yield from hand.click(places.point(view, on_screen("Mug")[:3, 3]))
        yield from hand.wait_until(lambda: obj("Mug").select_get(), "the mug is clicked on")
    for item in bpy.context.view_layer.objects:
        item.select_set(item.name in ("Mug", rig))
    bpy.context.view_layer.objects.active = obj(rig)
    yield from hand.press("TAB", ctrl=True)
    yield from hand.wait_until(lambda: bpy.context.mode == "POSE", "Pose Mode")
    for item in obj(rig).pose.bones:
        item.select = item.name == bone
    obj(rig).data.bones.active = obj(rig).data.bones[bone]
    bpy.ops.ed.undo_push(message="Select")
    yield
