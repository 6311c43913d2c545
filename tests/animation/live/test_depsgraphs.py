"""What Blender's dependency graphs tell of edits."""

from __future__ import annotations

from pathlib import Path

import bpy
import pytest

from rigid_motion.animation.live.edited import objects_to_evaluate
from tests.animation.scenes import linked, new_object
from tests.blank import blank


@pytest.fixture
def namesakes(tmp_path: Path) -> list[bpy.types.Object]:
    """An object of this file and one that is linked, both called Tool, both in the scene and evaluated."""
    blank()
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {new_object("Tool")})
    blank()
    local = new_object("Tool")
    return [local, linked(tmp_path / "library.blend", "Tool")]


@pytest.mark.parametrize("number", [0, 1])
def test_of_two_objects_with_one_name_that_is_found_which_was_edited(namesakes, number):
    evaluated: set[int] = set()
    assert {obj for obj, _ in objects_to_evaluate(bpy.context.scene, evaluated)} == set(namesakes)
    namesakes[number].update_tag()
    assert [obj for obj, _ in objects_to_evaluate(bpy.context.scene, evaluated)] == [namesakes[number]]
