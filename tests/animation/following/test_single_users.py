"""Actions that *Make Single User* has made: their edits are followed as those of all others."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import select_only
from tests.animation.keyed import curves_of
from tests.animation.oracle import expected_bases
from tests.animation.scenes import FRAMES, key, new_object

BETWEEN = 15


def make_single_user(obj: bpy.types.Object) -> None:
    """As *Object > Relations > Make Single User > Object Animation* does."""
    shared = obj.animation_data.action
    select_only(obj)
    bpy.ops.object.make_single_user(
        type="SELECTED_OBJECTS", animation=True, obdata_animation=False, object=False, obdata=False
    )
    assert obj.animation_data.action not in (shared, None)


@pytest.mark.parametrize("to", ["this frame", "another frame"])
def test_keys_that_a_script_sets_are_followed(live_file, to):
    obj = key(new_object("Tool"), FRAMES)
    set_mode(obj, "dq_sclerp")
    single = obj.copy()
    live_file.collection.objects.link(single)
    live_file.view_layer.update()
    live_file.scene.frame_set(BETWEEN)
    make_single_user(single)
    for index in range(3):
        curves_of(single)["location", index].keyframe_points[1].co.y += 1.5
    live_file.view_layer.update()
    if to == "another frame":
        live_file.scene.frame_set(BETWEEN + 1)
    frame = live_file.scene.frame_current
    for one in (obj, single):
        shown = np.array(one.evaluated_get(live_file.evaluated_depsgraph_get()).matrix_world)
        assert np.abs(shown - expected_bases(one, [float(frame)])[0]).max() < 2e-5
    assert np.abs(expected_bases(single, [float(frame)]) - expected_bases(obj, [float(frame)])).max() > 0.5
