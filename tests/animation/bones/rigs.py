"""Armatures with keys on their bones, to be edited and looked at. Metres, radians, frames of the scene."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import bpy
import numpy as np
from scipy.spatial.transform import Rotation

from rigid_motion.animation import set_mode, write_channel
from tests.animation.keyed import WIDTHS, rotation_path
from tests.animation.oracle import expected_bases
from tests.thoroughness import THOROUGH

FRAMES = (1.0, 11.0, 24.0, 40.0)
PLAYED = np.arange(-2.0, 44.0)
"""From before the first key until after the last."""

BETWEEN = np.arange(-2.0, 44.0, 0.375)
"""The same at all eighths of frames, whole ones among them."""

ORDERS = ("QUATERNION", "XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX", "AXIS_ANGLE")
INHERIT_SCALES = ("FULL", "FIX_SHEAR", "ALIGNED", "AVERAGE", "NONE", "NONE_LEGACY")


Case, Other = TypeVar("Case"), TypeVar("Other")

THIS_BLENDER = 10 * bpy.app.version[0] + bpy.app.version[1]


def in_turn(cases: Iterable[Case], others: Sequence[Other]) -> list[tuple[Case, Other]]:
    """Each case with one of the others by default, which is another one on each Blender, and with half of them in
    thorough runs: every second of all pairs, of each case and of each of the others.
    """
    step = 2 if THOROUGH else len(others)
    pairs = itertools.product(enumerate(cases), enumerate(others))
    return [(case, other) for (i, case), (j, other) in pairs if (i + j + THIS_BLENDER) % step == 0]


@dataclass(frozen=True)
class Rest:
    """A bone as it is at rest, in the armature's space; `settings` are properties of `bpy.types.Bone`."""

    name: str
    head: tuple[float, float, float]
    tail: tuple[float, float, float]
    parent: str = ""
    roll: float = 0.0
    settings: tuple[tuple[str, object], ...] = ()


ARM = (
    Rest("Body", (0.1, -0.2, 0.9), (0.15, -0.1, 1.4), roll=0.4),
    Rest("Upper", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3), "Body", roll=-1.1),
    Rest("Lower", (0.6, 0.1, 1.3), (0.8, 0.3, 1.2), "Upper", roll=2.0),
    Rest("Hand", (0.82, 0.33, 1.2), (0.9, 0.4, 1.1), "Lower", roll=0.7),
)
"""A body and three bones that hang on it, one behind the other."""


def new_rig(
    name: str = "Rig", bones: Sequence[Rest] = ARM, rotation_mode: str = "QUATERNION", **settings: object
) -> bpy.types.Object:
    """An armature in the scene. `settings` are properties of the last bone, such as `use_connect`."""
    rig = bpy.data.objects.new(name, bpy.data.armatures.new(name))
    bpy.context.scene.collection.objects.link(rig)
    with_edit_bones(rig, lambda edit_bones: _build(edit_bones, bones, settings))
    for pose_bone in rig.pose.bones:
        pose_bone.rotation_mode = rotation_mode
    return rig


def _build(edit_bones: bpy.types.ArmatureEditBones, bones: Sequence[Rest], last: dict[str, object]) -> None:
    for rest in bones:
        made = edit_bones.new(rest.name)
        made.head, made.tail, made.roll = rest.head, rest.tail, rest.roll
        made.parent = edit_bones[rest.parent] if rest.parent else None
        for setting, value in (dict(rest.settings) | (last if rest is bones[-1] else {})).items():
            setattr(made, setting, value)


def with_edit_bones(rig: bpy.types.Object, edit: Callable[[bpy.types.ArmatureEditBones], None]) -> None:
    """Go into Edit Mode with this rig alone, and back."""
    select_only(rig)
    bpy.ops.object.mode_set(mode="EDIT")
    edit(rig.data.edit_bones)
    bpy.ops.object.mode_set(mode="OBJECT")


def select_only(*objects: bpy.types.Object) -> None:
    """Select these, and make the first one active."""
    bpy.context.view_layer.update()
    for obj in bpy.context.scene.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[0]


def select_bones(rig: bpy.types.Object, *names: str) -> None:
    """Select these bones of a rig in Pose Mode, the first of them the active one."""
    for bone in rig.pose.bones:
        (bone if bpy.app.version >= (5, 0) else bone.bone).select = bone.name in names
    rig.data.bones.active = rig.data.bones[names[0]] if names else None


def pose_mode(rig: bpy.types.Object, *selected: str) -> bpy.types.Object:
    """Go into Pose Mode with this rig alone, with these bones selected or all."""
    select_only(rig)
    bpy.ops.object.mode_set(mode="POSE")
    select_bones(rig, *(selected or rig.pose.bones.keys()))
    return rig


@contextmanager
def own_clipboard(folder: str | Path) -> Iterator[None]:
    """Have copied poses apart from those of other Blenders on this machine: they are a file in the temporary folder."""
    filepaths = bpy.context.preferences.filepaths
    before, filepaths.temporary_directory = filepaths.temporary_directory, str(folder)
    try:
        yield
    finally:
        filepaths.temporary_directory = before


def key_bone(
    pose_bone: bpy.types.PoseBone,
    frames: Sequence[float] = FRAMES,
    *,
    seed: int = 0,
    scale: str | None = None,
    interpolation: str = "BEZIER",
    location: bool = True,
    amount: float = 1.0,
) -> bpy.types.PoseBone:
    """Key location, rotation and (with scale "even" or "uneven") scale at random. `amount`: 0 is the pose at rest."""
    random = np.random.default_rng((seed, sum(map(ord, pose_bone.name))))
    values = {"location": 0.3 * amount * random.normal(size=(len(frames), 3))} if location else {}
    turned = amount * random.normal(size=(len(frames), WIDTHS[rotation_path(pose_bone)]))
    if pose_bone.rotation_mode == "QUATERNION" and amount < 1.0:
        turned += (1.0, 0.0, 0.0, 0.0)
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    values[rotation_path(pose_bone)] = turned
    if scale:
        grown = random.normal(size=(len(frames), 3))
        values["scale"] = np.exp(0.3 * amount * (np.repeat(grown[:, :1], 3, axis=1) if scale == "even" else grown))
    for path, rows in values.items():
        write_bone(pose_bone, path, np.array(frames), rows, interpolation)
    return pose_bone


def write_bone(
    pose_bone: bpy.types.PoseBone, path: str, frames: np.ndarray, values: np.ndarray, interpolation: str = "LINEAR"
) -> None:
    """Replace a property's channels, which the Dope Sheet lists under the bone as it does those keyed by hand."""
    write_channel(
        *(pose_bone.id_data, f"{pose_bone.path_from_id()}.{path}", frames, values),
        interpolation=interpolation,
        group=pose_bone.name,
    )


def key_all(rig: bpy.types.Object, frames: Sequence[float] = FRAMES, **settings: object) -> bpy.types.Object:
    """Key every bone at random."""
    for pose_bone in rig.pose.bones:
        key_bone(pose_bone, frames, **settings)
    return rig


def moving_rig(
    mode: str = "dq_sclerp", rotation_mode: str = "QUATERNION", name: str = "Rig", **settings: object
) -> bpy.types.Object:
    """The arm with keys on all bones, all of one mode."""
    rig = key_all(new_rig(name, ARM, rotation_mode), **settings)
    set_mode(list(rig.pose.bones), mode)
    return rig


def twin_of(rig: bpy.types.Object, frames: np.ndarray) -> bpy.types.Object:
    """The same rig once more, with real keys on all of these frames, of where each bone has to be by its channels.

    Constraints that aim at the rig aim at its twin.
    """
    twin = rig.copy()
    twin.name = f"{rig.name} twin"
    bpy.context.scene.collection.objects.link(twin)
    twin.animation_data_clear()
    for pose_bone in twin.pose.bones:
        for constraint in pose_bone.constraints:
            for name in ("target", "pole_target"):
                if getattr(constraint, name, None) == rig:
                    setattr(constraint, name, twin)
    for pose_bone in rig.pose.bones:
        _write_basis(twin.pose.bones[pose_bone.name], frames, expected_bases(pose_bone, frames))
    return twin


def _write_basis(pose_bone: bpy.types.PoseBone, frames: np.ndarray, bases: np.ndarray) -> None:
    """Key a bone so that its matrices in the space of its channels are these (m, 4, 4), without shear."""
    scale = np.linalg.norm(bases[:, :3, :3], axis=1)
    write_bone(pose_bone, "location", frames, bases[:, :3, 3])
    write_bone(pose_bone, "scale", frames, scale)
    turned = _as_channels(bases[:, :3, :3] / scale[:, None, :], pose_bone.rotation_mode)
    write_bone(pose_bone, rotation_path(pose_bone), frames, turned)


def _as_channels(rotations: np.ndarray, rotation_mode: str) -> np.ndarray:
    """Rotation matrices (m, 3, 3) as quaternions, an angle and an axis, or angles about X, Y and Z, by SciPy."""
    turned = Rotation.from_matrix(rotations)
    if rotation_mode == "QUATERNION":
        return np.roll(turned.as_quat(), 1, axis=1)
    if rotation_mode == "AXIS_ANGLE":
        return np.column_stack((turned.magnitude(), turned.as_rotvec()))
    # Blender's orders name the turns about resting axes, the first one first, as SciPy's small letters do.
    return turned.as_euler(rotation_mode.lower())[:, [rotation_mode.index(axis) for axis in "XYZ"]]
