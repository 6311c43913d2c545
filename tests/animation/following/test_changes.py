"""Changes that Blender reports: which objects and channels were edited."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.following.changes import edited_objects, graphs_of
from tests.animation.bones.rigs import select_only
from tests.animation.keyed import curves_of
from tests.animation.oracle import expected_bases, world_now
from tests.animation.scenes import FRAMES, key, linked, new_object
from tests.blank import blank


@pytest.mark.parametrize("number", [0, 1])
def test_of_two_objects_with_one_name_that_is_found_which_was_edited(tmp_path: Path, number):
    blank()
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {new_object("Tool")})
    blank()
    namesakes = [new_object("Tool"), linked(tmp_path / "library.blend", "Tool")]
    found: list[bpy.types.Object] = []

    def note(scene: bpy.types.Scene, *_: object) -> None:
        found.extend(edited_objects(*graphs_of(scene)))

    bpy.app.handlers.depsgraph_update_pre.append(note)
    namesakes[number].update_tag()
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_pre.remove(note)
    # The library of an evaluated copy cannot be read safely, since it may be gone.
    assert namesakes[number] in found
    namesakes[1].update_tag()
    bpy.data.libraries.remove(bpy.data.libraries[0])
    bpy.context.view_layer.update()


@pytest.mark.parametrize("frame", [15, 16])
def test_what_was_made_single_user_is_followed_at_once_or_with_another_frame(live_file, frame):
    obj = key(new_object("Tool"), FRAMES)
    set_mode(obj, "dq_sclerp")
    single, shared = obj.copy(), obj.animation_data.action
    live_file.collection.objects.link(single)
    live_file.view_layer.update()
    live_file.scene.frame_set(15)
    select_only(single)
    # Like Object > Relations > Make Single User > Object Animation.
    bpy.ops.object.make_single_user(
        type="SELECTED_OBJECTS", animation=True, obdata_animation=False, object=False, obdata=False
    )
    assert single.animation_data.action not in (shared, None)
    before = expected_bases(single, [frame])
    for index in range(3):
        curves_of(single)["location", index].keyframe_points[1].co.y += 1.5
    live_file.view_layer.update()
    if frame != 15:
        live_file.scene.frame_set(frame)
    for one in (obj, single):
        assert np.abs(world_now(one.name) - expected_bases(one, [frame])[0]).max() < 2e-5
    assert np.abs(expected_bases(single, [frame]) - before).max() > 0.5
