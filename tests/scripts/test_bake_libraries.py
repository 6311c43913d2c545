"""Tests of bake.py on files that link to others: missing libraries are named and counted, existing ones found again."""

from collections.abc import Callable
from pathlib import Path

import bpy
import pytest

from rigid_motion.animation import set_mode
from tests.animation.scenes import key, new_object
from tests.scripts.baking import extension, new_file, run, save

WAY_OUT = "tell the file where it is now (Outliner, Blender File, right-click: Relocate)"


def make_library(path: Path) -> Path:
    """Save a library with a live object in a collection, and a mesh."""
    with extension():
        new_file()
        prop = set_up(new_object("Prop", data=bpy.data.meshes.new("Box")))
        bpy.data.collections.new("Props").objects.link(prop)
        bpy.data.collections["Props"].use_fake_user = True
        return save(path)


def set_up(obj: bpy.types.Object) -> bpy.types.Object:
    set_mode(key(obj), "dq_sclerp")
    return obj


def linked(library: Path, kind: str) -> bpy.types.ID:
    with bpy.data.libraries.load(str(library), link=True, relative=False) as (there, here):
        setattr(here, kind, getattr(there, kind))
    return getattr(here, kind)[0]


def link_object(library: Path) -> bpy.types.Object:
    obj = linked(library, "objects")
    bpy.context.scene.collection.objects.link(obj)
    return obj


def link_action(library: Path) -> None:
    data = new_object("Local").animation_data_create()
    data.action = linked(library, "actions")
    data.action_slot = data.action.slots[0]


def link_and_override(library: Path) -> bpy.types.Object:
    obj = link_object(library).override_create(remap_local_usages=True)
    obj.animation_data.action = obj.animation_data.action.copy()
    set_mode(obj, "dq_sclerp")
    return obj


def link_collection(library: Path) -> None:
    new_object("Instance").instance_type = "COLLECTION"
    bpy.data.objects["Instance"].instance_collection = linked(library, "collections")


def link_mesh(library: Path) -> None:
    set_up(new_object("Local", data=linked(library, "meshes")))


def shot_with(path: Path, link: Callable[[Path], object], library: Path) -> Path:
    """Save a file with a live object of its own, and data linked from a library by a relative path."""
    with extension():
        new_file()
        set_up(new_object("Tool"))
        save(path)
        link(library)
        bpy.ops.file.make_paths_relative()
        bpy.ops.wm.save_mainfile()
    path.with_suffix(".blend1").unlink()
    return path


@pytest.mark.parametrize(
    ("link", "expected", "told", "code"),
    [
        (link_object, "Object Prop", "Prop: not baked: it is missing from", 1),
        (link_action, "Action PropAction", "Local: not baked: its Action PropAction is missing from", 1),
        (link_and_override, "Object Prop", "Prop: not baked: what it overrides is missing from", 1),
        (link_collection, "Collection Props", "incomplete, for there may be objects to be baked in what is missing", 1),
        (link_mesh, "Mesh Box", "2 objects baked.\n", 0),
    ],
)
def test_a_missing_library_is_named_and_fails_what_needs_its_motion(tmp_path, capsys, link, expected, told, code):
    library = make_library(tmp_path / "library.blend")
    shot = shot_with(tmp_path / "shot.blend", link, library)
    library.unlink()
    capsys.readouterr()
    assert run(shot) == code
    said = capsys.readouterr().err
    (line,) = (line for line in said.splitlines() if " was not found" in line)
    assert line.startswith(f"{shot}: library {library} was not found (")
    assert f"{expected}): bring it back" in line
    assert line.endswith(WAY_OUT)
    assert said.count(told) == 1
    assert f"{shot}: Tool: baked" in said, "what is there is done"
