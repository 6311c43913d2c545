"""A BVH file imported, reduced by a button to about the keys it was made with, its dense keys discarded; undone.

It is also exported by *File > Export > glTF, Reduced*, through the file dialog.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import addon_utils
import bpy

from rigid_motion import animation
from rigid_motion.gltf import read_document
from rigid_motion.gltf.tracks import read_clips
from tests.animation.bones.hand_made import AUTOMATIC, LAST, bake_each_frame, hand_made, keys_of
from tests.animation.bones.rigs import pose_mode
from tests.gui import places
from tests.gui.driver import Hand, Steps

NAME = "Walk"


def rig() -> bpy.types.Object:
    """Return the rig, looked up each time: undo replaces it."""
    return bpy.data.objects[NAME]


def count() -> int:
    """Return the number of keys of all bones."""
    return sum(map(len, keys_of(rig()).values()))


def handle_types() -> set[str]:
    """Return the present types of the right handles."""
    curves = rig().animation_data.action.layers[0].strips[0].channelbags[0].fcurves
    return {key.handle_right_type for curve in curves for key in curve.keyframe_points}


def import_walk() -> int:
    """Import a file exported from a hand-made animation; return the number of keys of that animation."""
    addon_utils.enable("io_anim_bvh")
    made = hand_made(AUTOMATIC, "XYZ")
    own = sum(map(len, keys_of(made).values()))
    bake_each_frame(made)
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / f"{NAME}.bvh")
        bpy.ops.export_anim.bvh(filepath=path, frame_start=0, frame_end=LAST, rotate_mode="NATIVE")
        bpy.data.batch_remove(bpy.data.objects)
        bpy.data.batch_remove(bpy.data.actions)
        bpy.ops.import_anim.bvh(filepath=path, frame_start=0, update_scene_duration=True, axis_forward="Y", axis_up="Z")
    return own


def scenario(hand: Hand) -> Steps[None]:
    yield from hand.open_animation_workspace()
    view, sheet = hand.area("VIEW_3D"), hand.area("DOPESHEET_EDITOR")
    bpy.data.batch_remove(bpy.data.objects)
    own = import_walk()
    space = view.spaces.active.region_3d
    space.view_location, space.view_distance = (0.0, 0.0, 1.0), 5.0
    bpy.ops.ed.undo_push(message="Import")
    dense = count()
    assert dense > 10 * own
    yield from hand.open_sidebar(view, "Animation")
    button = yield from hand.find_button(view, "UI", "rigid_motion.reduce_keys")
    yield from hand.click(button)
    yield from hand.wait_until(lambda: count() < dense, "the button reduces all bones of the rig")
    reduction = animation.reduction_of(rig().pose.bones)
    assert reduction.mode == animation.NATIVE, "the default is what needs the fewest keys"
    assert reduction.needed["motor_spline"] > count()
    assert "AUTO_CLAMPED" in handle_types()
    yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    redo, before = (yield from hand.unfold_redo_panel(view)), count()
    yield from hand.enter("0.002", places.redo_row(redo, 1))
    yield from hand.wait_until(lambda: count() != before, "another tolerance, the same curves")
    assert animation.reduction_of(rig().pose.bones).mode == animation.NATIVE
    assert count() < 1.5 * own
    yield from hand.picture("redo-panel", places.box(view))
    few = count()

    yield from hand.click((yield from hand.find_button(view, "UI", "rigid_motion.discard_dense_keys", narrow=True)))
    yield from hand.wait_until(lambda: len(bpy.data.actions) == 1, "the dense keys are out of the file")
    assert count() == few
    pose_mode(rig(), "Arm.L")
    sheet.type = "GRAPH_EDITOR"
    yield 0.3
    yield from hand.hover(places.centre(places.region(sheet)))
    yield from hand.press("HOME")
    yield from hand.picture("graph-editor")

    sheet.type = "DOPESHEET_EDITOR"
    yield 0.3
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: len(bpy.data.actions) > 1, "undo brings the dense keys back into the file")
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: count() == dense, "one step takes the curves back")
    yield from exported(hand, Path(tempfile.mkdtemp()) / "walk.glb")


def exported(hand: Hand, target: Path) -> Steps[None]:
    """Export the rig by the menu: the file has fewer keys than frames."""
    # Events can be simulated in the first window only.
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from hand.press("F4")
    yield from hand.choose("glTF, Reduced (.glb)")
    yield from hand.wait_until(lambda: hand.window.screen.areas[0].type == "FILE_BROWSER", "the file dialog opens")
    (browser,) = hand.window.screen.areas
    yield from hand.wait_until(lambda: browser.spaces.active.params is not None, "it has listed the folder")
    yield from hand.picture("dialog")
    parameters = browser.spaces.active.params
    parameters.directory, parameters.filename = f"{target.parent}/".encode(), target.name
    yield
    with bpy.context.temp_override(window=hand.window, area=browser):
        bpy.ops.file.execute()
    yield from hand.wait_until(target.exists, "the file is written")
    (clip,) = read_clips(read_document(target))
    assert sum(len(track.times) for track in clip.tracks) < 0.8 * len(clip.tracks) * LAST
