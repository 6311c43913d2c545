"""Objects and bones with keys on paths to edit."""

from __future__ import annotations

from collections.abc import Sequence

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


BONES: dict[str, dict[str, object]] = {
    "bone": {},
    "free of its rest": {"use_local_location": False},
    "not turned along": {"use_inherit_rotation": False},
    "not scaled along": {"inherit_scale": "NONE"},
}
KINDS = ("QUATERNION", "XYZ", "AXIS_ANGLE", "with deltas", "parented", "scaled", "hung", *BONES)


def carrier_of(kind: str) -> Carrier:
    """Return a keyed object with this rotation mode or with deltas, a prop on a moving parent, or a hand."""
    if kind in BONES:
        return new_hand(**BONES[kind])
    if kind in ("parented", "scaled", "hung"):
        prop = new_prop(kind)
        wander(prop, 6, FRAMES)
        return prop
    obj = key(new_object(rotation_mode="XZY" if kind == "with deltas" else kind))
    if kind == "with deltas":
        give_own_deltas(obj)
    return obj


def new_hand(**settings: object) -> bpy.types.PoseBone:
    """Return a keyed hand below moving bones."""
    rig = new_rig(**settings)
    for name in ("Hip", "Arm"):
        set_mode(key_bone(rig.pose.bones[name]), "dq_sclerp")
    return key(rig.pose.bones["Hand"], seed=1743)


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
