"""A recorded body: reduced as an object by its button, in the redo panel to key poses, undone."""

from __future__ import annotations

import bpy
import numpy as np

from rigid_motion import animation
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.rigs.recorded import FRAMES, NAMES, recorded_rig


def rig() -> bpy.types.Object:
    """The rig, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Body"]


def keys() -> list[int]:
    """How many keys every bone has."""
    return [len(animation.key_frames(rig().pose.bones[name])) for name in NAMES]


def ends() -> np.ndarray:
    """Where the bones' ends are in the world, every third frame."""
    result = []
    for frame in FRAMES[::3]:
        bpy.context.scene.frame_set(int(frame))
        result.append([rig().matrix_world @ rig().pose.bones[name].tail for name in NAMES])
    return np.array(result)


def scenario(hand: Hand) -> Steps[None]:
    yield from hand.open_animation_workspace()
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    recorded_rig()
    rig().select_set(True)
    bpy.context.scene.frame_end = int(FRAMES[-1])
    space = view.spaces.active.region_3d
    space.view_location, space.view_distance = (0.0, 0.0, 0.9), 4.0
    bpy.ops.ed.undo_push(message="Recording")
    recorded = ends()
    dense = [len(FRAMES)] * len(NAMES)
    assert keys() == dense
    yield from hand.open_sidebar(view, "Animation")
    button = yield from hand.find_button(view, "UI", "rigid_motion.reduce_keys")
    yield from hand.click(button)
    yield from hand.wait_until(lambda: sum(keys()) < sum(dense), "the button reduces all bones of the rig")
    own = keys()
    assert len(set(own)) > 1, "each bone has keys of its own"
    assert np.linalg.norm(ends() - recorded, axis=-1).max() <= 0.003 * max(rig().dimensions)
    # The last row of the panel is above the lower edge of the editor, as the workspace comes.
    yield from hand.find_button(view, "UI", "show_paths", narrow=True)
    redo = yield from hand.unfold_redo_panel(view)
    yield from hand.enter("0.02", places.redo_row(redo, 1))
    yield from hand.wait_until(lambda: sum(keys()) < sum(own), "a larger tolerance leaves fewer keys")
    own = keys()
    yield from hand.picture("redo-panel", places.box(view))

    yield from hand.click(places.redo_row(redo, 4, across=0.5))
    yield from hand.wait_until(lambda: len(set(keys())) == 1, "Key Poses gives all bones keys on the same frames")
    assert max(keys()) < len(FRAMES)
    yield from hand.picture("key-poses")

    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: keys() == dense, "one step takes all of it back")
    np.testing.assert_allclose(ends(), recorded, atol=1e-5)
