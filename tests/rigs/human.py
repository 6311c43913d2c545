"""Rigify's human, which comes with Blender: a production-like rig of 706 bones, 216 of them controls.

Rigify takes five seconds to generate it, so it is generated once per process; each `human()` is a copy.
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
"""Name prefixes of bones that animators do not touch."""


class NoRigify(RuntimeError):
    """Rigify is missing, or fails to generate its human."""


def human() -> bpy.types.Object:
    """Return Rigify's human in the current scene, in rest pose: arms and legs by IK, its control widgets in no scene.

    Raises
    ------
    NoRigify
        If this Blender has no Rigify, or Rigify fails to generate.
    """
    with bpy.data.libraries.load(str(_library()), link=False) as (_, expected):
        expected.objects = ["rig"]
    rig = expected.objects[0]
    bpy.context.scene.collection.objects.link(rig)
    bpy.context.view_layer.update()
    return rig


def controls(rig: bpy.types.Object) -> list[bpy.types.PoseBone]:
    """Return the bones that an animator poses."""
    return [bone for bone in rig.pose.bones if not bone.name.startswith(MECHANISM)]


@cache
def _library() -> Path:
    """Write a .blend with the rig, generated in a temporary scene, and return its path; the open file is unchanged."""
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
    # Rigify reads its own preferences while it registers: without `default_set` there are none, and its register()
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
            # Rigify leaves the rig's panels and operators behind, which need it, and a handler that fails without it.
            for name in set(dir(bpy.types)) - known:
                bpy.utils.unregister_class(getattr(bpy.types, name))
            for handler in [item for item in bpy.app.handlers.load_post if item.__module__.startswith("rigify.")]:
                bpy.app.handlers.load_post.remove(handler)
