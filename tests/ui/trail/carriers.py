"""Objects and bones with keys on paths to edit."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import bpy
import numpy as np
from mathutils import Matrix, Quaternion

from rigid_motion.animation import set_mode
from tests.animation.bones.rigs import pose_mode, select_only
from tests.animation.held import handled, new_hands, new_prop, wander
from tests.animation.keyed import Carrier
from tests.animation.scenes import FRAMES, give_own_deltas, key, new_object
from tests.ui.conftest import select_keys
from tests.ui.rigs import key_bone, new_rig

MOVE, TURN = Matrix.Translation((0.3, -0.5, 0.8)), Quaternion((0.3, -0.5, 0.8), 0.7)

MIDDLE = FRAMES[1]


def new_tool(order: str) -> Callable[[], Carrier]:
    return lambda: key(new_object(rotation_mode=order))


def with_deltas() -> Carrier:
    obj = key(new_object(rotation_mode="XZY"))
    give_own_deltas(obj)
    return obj


def on_parent(kind: str) -> Callable[[], Carrier]:
    """Return a maker of props: on a moving table, on one that is scaled, too, or on a moving bone."""

    def make() -> Carrier:
        prop = new_prop(kind)
        wander(prop, 6, FRAMES)
        return prop

    return make


def bone(**settings: object) -> Callable[[], Carrier]:
    """Return a maker of hands below moving bones."""

    def make() -> Carrier:
        rig = new_rig(**settings)
        for name in ("Hip", "Arm"):
            set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
        return key(rig.pose.bones["Hand"], seed=1743)

    return make


CARRIERS: dict[str, Callable[[], Carrier]] = {
    **{order: new_tool(order) for order in ("QUATERNION", "XYZ", "AXIS_ANGLE")},
    "with deltas": with_deltas,
    **{kind: on_parent(kind) for kind in ("parented", "scaled", "hung")},
    "bone": bone(),
    **{
        f"{name}={value}": bone(**{name: value})
        for name, value in (("use_local_location", False), ("use_inherit_rotation", False), ("inherit_scale", "NONE"))
    },
}


def choose(carrier: Carrier, *frames: float) -> Carrier:
    """Select one object or bone, and these keys of it."""
    if isinstance(carrier, bpy.types.PoseBone):
        pose_mode(carrier.id_data, carrier.name)
    else:
        select_only(carrier)
    select_keys(carrier, *frames)
    return carrier


def held_prop(kind: str, *frames: float) -> Carrier:
    """Return a prop that passes from hand to hand."""
    prop = new_prop(kind)
    handled(prop, *new_hands())
    return choose(prop, *frames)


def about(point: Sequence[float], turn: Quaternion) -> np.ndarray:
    """Return the map (4, 4) that turns the world about a point."""
    middle = Matrix.Translation(point)
    return np.array(middle @ turn.to_matrix().to_4x4() @ middle.inverted())
