"""*File > Export > glTF, Reduced*: the menu, the file dialog with its tolerance, and the line in the status bar."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy

from rigid_motion.gltf import read_document
from rigid_motion.gltf.tracks import read_clips
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.rigs.recorded import FRAMES, recorded_rig


def scenario(hand: Hand) -> Steps[None]:
    """Export a recorded rig by hand: the file has fewer keys than the recording."""
    recorded_rig()
    bpy.context.scene.frame_end = int(FRAMES[-1])
    target = Path(tempfile.mkdtemp()) / "rig.glb"
    # Events can be simulated in the first window only.
    bpy.context.preferences.view.filebrowser_display_type = "SCREEN"
    yield from hand.hover(places.centre(hand.area("VIEW_3D")))
    yield from hand.press("F4")
    yield from hand.picture("menu")
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
    yield from hand.picture("done")
    (clip,) = read_clips(read_document(target))
    assert sum(len(track.times) for track in clip.tracks) < 0.8 * len(clip.tracks) * len(FRAMES)
