"""What Blender's dependency graphs tell of edits."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from rigid_motion.animation.following.changes import edited_objects, graphs_of
from tests.animation.scenes import linked, new_object
from tests.blank import blank


@pytest.mark.parametrize("number", [0, 1])
def test_of_two_objects_with_one_name_that_is_found_which_was_edited(tmp_path: Path, number):
    blank()
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {new_object("Tool")})
    blank()
    namesakes = [new_object("Tool"), linked(tmp_path / "library.blend", "Tool")]
    found: list[bpy.types.Object] = []

    def note(scene: bpy.types.Scene, *_: object) -> None:
        found.extend(*map(edited_objects, graphs_of(scene)))

    bpy.app.handlers.depsgraph_update_pre.append(note)
    namesakes[number].update_tag()
    bpy.context.view_layer.update()
    bpy.app.handlers.depsgraph_update_pre.remove(note)
    assert found == [namesakes[number]]
