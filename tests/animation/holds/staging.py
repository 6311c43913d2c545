"""A stage for tests of holds: a prop that is picked up, passed on and put down, and edits of its keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.keyed import WIDTHS, Carrier, curves_of
from tests.animation.scenes import key, new_object

FRAMES = np.arange(0.0, 62.0, 1.75)
PICKED_UP, PASSED, LET_GO = 20.0, 36.0, 50.0
PROPS = "Tool", "Child", "Rig/Bone"
HANDS = "Hand", "Other", "Rig/Grip"

RESTS = (
    Rest("Grip", (0.3, 0.0, 1.4), (0.6, 0.1, 1.3)),
    Rest("Bone", (-0.5, 0.3, 0.2), (-0.4, 0.3, 0.6), roll=0.9),
)


def found(name: str) -> Carrier:
    obj, _, bone = name.partition("/")
    return bpy.data.objects[obj].pose.bones[bone] if bone else bpy.data.objects[obj]


def go_to(frame: float) -> None:
    bpy.context.scene.frame_set(int(frame // 1), subframe=frame % 1)


def set_up(frames: Sequence[float], seed: int = 0) -> None:
    """Add hands with keys on these frames, and props: an object, one with a moving parent, and a bone."""
    new_rig("Rig", RESTS)
    for name in ("Hand", "Other", "Parent", "Tool", "Child"):
        new_object(name)
    for number, name in enumerate((*HANDS, "Parent")):
        key(found(name), frames, seed=seed + number)
    found("Child").parent = found("Parent")


@pytest.fixture
def stage(live_file) -> Callable[[str], Carrier]:
    """Return a function that sets up a prop that is picked up, passed on and put down, by its name."""

    def set_stage(name: str = "Tool", *, held: bool = True) -> Carrier:
        set_up((1.0, 24.0, 41.0, 60.0))
        prop = found(name)
        prop.rotation_mode = "QUATERNION"
        key(prop, (1.0, 9.0, 60.0), seed=7)
        animation.set_mode(prop, "dq_sclerp")
        bpy.context.view_layer.update()
        for frame, holder in ((PICKED_UP, "Hand"), (PASSED, "Rig/Grip"), (LET_GO, None)) if held else ():
            go_to(frame)
            animation.hold_in(found(name), holder and found(holder))
        bpy.ops.ed.undo_push(message="Held")
        return found(name)

    return set_stage


def update() -> None:
    bpy.context.view_layer.update()


def spaces(prop: Carrier) -> list[tuple[float, int]]:
    """Return the frames of switches, and the numbers of the new holders."""
    return [(switch.frame, switch.after) for switch in animation.queries.keyed.source_of(prop).switches]


def influence(prop: Carrier, constraint: str) -> bpy.types.FCurve:
    return next(c for (path, _), c in curves_of(prop).items() if f'"{constraint}"].influence' in path)


def moving(prop: Carrier) -> list[bpy.types.FCurve]:
    return [curve for (path, _), curve in curves_of(prop).items() if path in WIDTHS]


def retime(prop: Carrier, to: Callable[[float], float], curves: Sequence[bpy.types.FCurve] | None = None) -> None:
    for fcurve in curves or curves_of(prop).values():
        for point in fcurve.keyframe_points:
            point.co_ui.x = to(point.co.x)
        fcurve.update()


def delete(prop: Carrier, frame: float) -> None:
    for fcurve in moving(prop):
        for point in reversed(fcurve.keyframe_points):
            if abs(point.co.x - frame) < 0.01:
                fcurve.keyframe_points.remove(point)
        fcurve.update()


def copy(prop: Carrier, frame: float, by: float) -> None:
    """Duplicate keys as Shift D does."""
    for fcurve in moving(prop):
        there = next(point for point in fcurve.keyframe_points if abs(point.co.x - frame) < 0.01)
        fields = {field: getattr(there, field) for field in ("back", "amplitude", "period")}
        made = fcurve.keyframe_points.insert(there.co.x + by, there.co.y)
        for field, value in fields.items():
            setattr(made, field, value)
        fcurve.update()
