"""Carriers with a motion and an offset layer, and their expected matrices, computed with Blender's functions alone."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import bpy
import numpy as np
from mathutils import Euler, Matrix, Quaternion, Vector

from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import new_rig
from tests.animation.held import in_holder, worlds
from tests.animation.keyed import Carrier, curves_of, rotation_path
from tests.animation.scenes import key, new_object, random_values, write

KEYS = (1.0, 11.0, 24.0, 40.0)
OFFSET_KEYS = (1.0, 15.0, 33.0)
FRAMES = np.arange(-2.0, 46.0, 0.375)
"""Steps through all eighths of frames, also before and after the keys."""

KINDS = ("object", "child", "on a bone", "root", "bone", "connected")


def moving_parent() -> bpy.types.Object:
    return key(new_object("Parent", "XYZ"), KEYS, seed=7)


def new(kind: str, order: str) -> Carrier:
    """Return an unkeyed carrier of this kind, on moving parents."""
    if kind == "object":
        return new_object("Tool", order)
    if kind == "child":
        obj = new_object("Tool", order)
        obj.parent, obj.matrix_parent_inverse = moving_parent(), Matrix.Translation((0.3, 1.0, 0.0))
        return obj
    rig = new_rig("Rig", rotation_mode=order, use_connect=kind == "connected")
    rig.parent = moving_parent()
    for bone in rig.pose.bones:
        if bone.name != {"root": "Body"}.get(kind, "Hand"):
            key(bone, KEYS, seed=3)
    if kind == "on a bone":
        key(rig.pose.bones["Hand"], KEYS, seed=3)
        obj = new_object("Tool", order)
        obj.parent, obj.parent_type, obj.parent_bone = rig, "BONE", "Hand"
        return obj
    return rig.pose.bones["Body" if kind == "root" else "Hand"]


def key_base(carrier: Carrier, mode: str, frames: Sequence[float] = KEYS, **how) -> Carrier:
    """Key it at random. Unit quaternions do not flip signs, as in posing."""
    key(carrier, frames, **how)
    if carrier.rotation_mode == "QUATERNION":
        turns = random_values(carrier, "rotation_quaternion", len(frames))
        turns /= np.linalg.norm(turns, axis=1, keepdims=True)
        for before, turn in pairwise(turns):
            turn *= np.sign(before @ turn)
        write(carrier, "rotation_quaternion", np.array(frames), turns, how.get("interpolation", "BEZIER"))
    set_mode(carrier, mode, frames)
    return carrier


def key_offset(carrier: Carrier, mode: str = "BLENDER", frames: Sequence[float] = OFFSET_KEYS, size: float = 0.3):
    """Key a layer whose strip is in tweak mode. At the first of these frames the layer is at rest."""
    turns, places = size * np.random.default_rng(5).normal(size=(2, len(frames), 3))
    turns[0] = places[0] = 0.0
    if carrier.rotation_mode == "QUATERNION":
        turns = np.array([Euler(turn).to_quaternion() for turn in turns])
    write(carrier, "location", np.array(frames), places, "BEZIER")
    write(carrier, rotation_path(carrier), np.array(frames), turns, "BEZIER")
    set_mode(carrier, mode)


def key_influence(obj: bpy.types.Object, *points: tuple[float, float]) -> None:
    fcurve = obj.animation_data.nla_tracks["Rigid Motion Layer"].strips[0].fcurves.find("influence")
    fcurve.keyframe_points.clear()
    for frame, influence in points:
        fcurve.keyframe_points.insert(frame, influence)


def seen(carrier: Carrier, frames: np.ndarray = FRAMES) -> np.ndarray:
    """Return displayed matrices, (m, 4, 4): objects in the world, bones relative to their parent bone or the rig."""
    if isinstance(carrier, bpy.types.Object):
        return worlds(carrier, frames)
    return in_holder(carrier, carrier.parent or carrier.id_data, frames)


def offsets(carrier: Carrier, frames: np.ndarray = FRAMES) -> np.ndarray:
    """Return the offsets of a layer whose strip is in tweak mode, to the power of its influence, shape (m, 4, 4)."""
    curves, path, order = curves_of(carrier), rotation_path(carrier), carrier.rotation_mode
    influence = carrier.id_data.animation_data.nla_tracks["Rigid Motion Layer"].strips[0].fcurves.find("influence")
    connected = isinstance(carrier, bpy.types.PoseBone) and carrier.bone.use_connect
    result = []
    for frame in frames:
        power = influence.evaluate(frame)
        place = Vector(curves["location", index].evaluate(frame) for index in range(3)) * power * (not connected)
        numbers = [curves[path, index].evaluate(frame) for index in range(4 if order == "QUATERNION" else 3)]
        if order == "QUATERNION":
            whole = Quaternion(numbers).normalized()
            turn = Quaternion(whole.axis, power * whole.angle)
        else:
            turn = Euler(np.array(numbers) * power, order).to_quaternion()
        result.append(np.array(Matrix.LocRotScale(place, turn, None)))
    return np.array(result)
