"""A stage for tests of holds: a prop that is picked up, passed on and put down, and edits of its keys."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from tests.animation.bones.rigs import Rest, new_rig
from tests.animation.keyed import Carrier
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
