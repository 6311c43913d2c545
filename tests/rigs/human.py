"""The human of Rigify, which comes with Blender: a rig as productions use them, of 706 bones, 216 of them controls.

Rigify takes five seconds to generate it, so that is done once in a process; each `human()` is a copy of its own.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import shutil
import tempfile
from functools import cache
from pathlib import Path

import addon_utils
import bpy

MECHANISM = ("DEF-", "MCH-", "ORG-", "VIS_")
"""What the names of bones begin with that no animator touches."""


class NoRigify(RuntimeError):
    """Rigify is not there, or does not generate its human."""


def human() -> bpy.types.Object:
    """Rigify's human in the present scene, in rest pose: arms and legs by IK, the widgets of its controls outside.

    Raises
    ------
    NoRigify
        Where this Blender has no Rigify, or it will not generate.
    """
    with bpy.data.libraries.load(str(_library()), link=False) as (_, expected):
        expected.objects = ["rig"]
    rig = expected.objects[0]
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.update()
    return rig


def controls(rig: bpy.types.Object) -> list[bpy.types.PoseBone]:
    """The bones that an animator poses."""
    return [bone for bone in rig.pose.bones if not bone.name.startswith(MECHANISM)]


@cache
def _library() -> Path:
    """A .blend with the rig in it, generated in a scene of its own; the open file is left as it was."""
    folder = Path(tempfile.mkdtemp(prefix="rigify-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    before, shown = set(bpy.data.user_map()), bpy.context.window.scene
    bpy.context.window.scene = bpy.data.scenes.new("Metarig")
    try:
        bpy.data.libraries.write(str(folder / "human.blend"), {_generate()})
    finally:
        bpy.context.window.scene = shown
        bpy.data.batch_remove(set(bpy.data.user_map()) - before)
    return folder / "human.blend"


def _generate() -> bpy.types.Object:
    # Rigify looks for its own preferences while it registers: without `default_set` there are none, and its register()
    # ends half-way, before the rig types have their parameters.
    said, known = io.StringIO(), set(dir(bpy.types))
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        try:
            if addon_utils.enable("rigify", default_set=True) is None:
                raise NoRigify("this Blender has no Rigify, or it does not register")
            bpy.ops.object.armature_human_metarig_add()
            bpy.ops.pose.rigify_generate()
            return bpy.context.view_layer.objects["rig"]
        except (RuntimeError, KeyError, AttributeError) as error:
            raise NoRigify(f"Rigify makes no human: {error}\n{said.getvalue()[-2000:]}") from error
        finally:
            addon_utils.disable("rigify", default_set=True)
            # It leaves panels and operators of the rig behind, which need it, and a handler that fails where it is not.
            for name in set(dir(bpy.types)) - known:
                bpy.utils.unregister_class(getattr(bpy.types, name))
            for handler in [item for item in bpy.app.handlers.load_post if item.__module__.startswith("rigify.")]:
                bpy.app.handlers.load_post.remove(handler)
