"""Two objects or two bones on an in-between of theirs, and their twins: the same motion as dense keys.

All have keys on frames 1, 21 and 41, linear ones of metres and wild turns. The twins have linear keys on all eighths of
frames with the values that the channels show, no modes, and nobody follows their edits: what Blender does to them it
has to do to the others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import Rest, key_bone, new_rig, pose_mode, select_only
from tests.animation.keyed import Carrier, rotation_path
from tests.animation.scenes import key, key_densely, new_object
from tests.blank import blank

KEYS = (1.0, 21.0, 41.0)
IN_BETWEEN, AWAY = 11, 12

KINDS = tuple((what, order) for what in ("OBJECT", "BONE") for order in ("QUATERNION", "XYZ", "AXIS_ANGLE"))
"""What is edited, and how it turns."""

BONES = (
    Rest("Hip.L", (0.0, 0.0, 0.2), (0.0, 0.1, 0.7), roll=0.3),
    Rest("Foot.L", (0.0, 0.1, 0.7), (0.1, 0.1, 1.1), "Hip.L", roll=-0.8),
    Rest("Hip.R", (0.6, 0.0, 0.2), (0.6, 0.1, 0.7), roll=1.3),
)
"""The first and the last are edited; one hangs on the first."""


@dataclass
class Stage:
    """What is edited, selected; the first of it is active, and has a parent that is turned, or is in such a rig."""

    kind: str
    carriers: list[Carrier]
    auto: bool
    """Whether what is done by hand is keyed."""

    @property
    def first(self) -> Carrier:
        return self.carriers[0]

    @property
    def owner(self) -> bpy.types.Object:
        return self.first.id_data

    def operator(self, name: str) -> Callable:
        """One that there is of both kinds."""
        return getattr(bpy.ops.object if self.kind == "OBJECT" else bpy.ops.pose, name)

    def by_hand(self, carrier: Carrier, path: str, index: int = -1) -> None:
        """Blender's buttons key what was typed into them."""
        if self.auto:
            carrier.keyframe_insert(path, index=index)


def set_stage(kind: str, order: str, mode: str, *, auto: bool = False) -> Stage:
    """A new file with them, on the in-between."""
    animation.set_enabled(True)
    blank()
    if kind == "OBJECT":
        root = new_object("Root", "XYZ")
        root.location, root.rotation_euler, root.scale = (0.5, -1.0, 0.3), (0.4, -0.2, 0.9), (1.5, 1.5, 1.5)
        carriers = [new_object(name, order) for name in ("Tool", "Other")]
        carriers[0].parent = root
        select_only(*carriers)
    else:
        rig = new_rig("Rig", BONES, order)
        rig.location, rig.rotation_euler = (0.5, -1.0, 0.3), (0.4, -0.2, 0.9)
        pose_mode(rig, "Hip.L", "Hip.R")
        carriers = [rig.pose.bones["Hip.L"], rig.pose.bones["Hip.R"]]
    for seed, carrier in enumerate(carriers):
        (key if kind == "OBJECT" else key_bone)(carrier, KEYS, seed=seed, scale="even", interpolation="LINEAR")
    set_mode(carriers, mode)
    go_to(IN_BETWEEN)
    return Stage(kind, carriers, auto)


def go_to(frame: int) -> None:
    bpy.context.scene.frame_set(frame)
    bpy.context.view_layer.update()


def make_twins(carriers: Sequence[Carrier]) -> None:
    """Give these dense keys of what their channels show, and have nobody follow what becomes of them."""
    for carrier in carriers:
        key_densely(carrier)
    animation.set_enabled(False)
    go_to(IN_BETWEEN)


@contextmanager
def in_view() -> Iterator[None]:
    """Have operators run in a 3D View."""
    window = bpy.context.window_manager.windows[0]
    area = next((area for area in window.screen.areas if area.type == "VIEW_3D"), None)
    if area is None:
        area = window.screen.areas[0]
        area.type = "VIEW_3D"
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, screen=window.screen, area=area, region=region):
        yield


def all_seen() -> np.ndarray:
    """The world matrices of all objects and bones in the scene, and the 3D Cursor's, shape (n, 4, 4)."""
    bpy.context.view_layer.update()
    depsgraph, result = bpy.context.evaluated_depsgraph_get(), []
    for obj in sorted(bpy.context.scene.objects, key=lambda obj: obj.name):
        evaluated = obj.evaluated_get(depsgraph)
        result += [
            evaluated.matrix_world,
            *(evaluated.matrix_world @ bone.matrix for bone in (evaluated.pose.bones if obj.pose else ())),
        ]
    return np.array([*result, bpy.context.scene.cursor.matrix])


def channels_seen(carriers: Sequence[Carrier]) -> np.ndarray:
    """What the channels of these have, as drivers and scripts read it."""
    return np.concatenate(
        [[*carrier.location, *getattr(carrier, rotation_path(carrier)), *carrier.scale] for carrier in carriers]
    )
