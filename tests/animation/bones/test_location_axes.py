"""Bones without *Local Location*, as Rigify's controls of hands and feet: moved along their parent's axes, they turn
about their own, and go by the same screw as if there was no such setting."""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix, Vector

from rigid_motion import animation
from rigid_motion.motion import KEYFRAME_MODES
from tests.animation.bones.rigs import Rest, in_turn, new_rig, with_edit_bones
from tests.animation.keyed import curves_of
from tests.rigs import scenes

POSES = (
    (1, (0.1, -0.4, 1.2), (0.9, 0.2, -0.4)),
    (11, (0.5, 0.3, 0.7), (-0.3, 0.8, 0.6)),
    (25, (-0.2, 0.6, 0.4), (0.2, -0.5, 1.4)),
)
"""Frame, head and Euler angles, in the space of the armature."""


@pytest.fixture
def pair(live_file) -> tuple[bpy.types.PoseBone, bpy.types.PoseBone]:
    """Two bones at one place, askew below a parent that is askew too, of which the second is moved along other axes."""
    parent = Rest("Parent", (0.2, 0.1, 0.0), (0.3, 0.4, 0.5), roll=0.7)
    one, other = (Rest(name, (0.4, 0.2, 0.6), (0.9, 0.4, 0.2), "Parent", roll=0.7) for name in "AB")
    rig = new_rig("Rig", (parent, one, other), use_local_location=False)
    return rig.pose.bones["A"], rig.pose.bones["B"]


def pose(bones: tuple[bpy.types.PoseBone, ...], rotation_mode: str = "QUATERNION") -> None:
    for bone in bones:
        bone.rotation_mode = rotation_mode
        for frame, head, angles in POSES:
            scenes.key(bone, frame, Matrix.LocRotScale(Vector(head), Euler(angles), None))
        # What Bezier handles make of a key in the middle depends on the axes.
        for fcurve in curves_of(bone.id_data).values():
            for point in fcurve.keyframe_points:
                point.interpolation = "LINEAR"


def shown(bones: tuple[bpy.types.PoseBone, ...]) -> list[np.ndarray]:
    """The matrices of bones in their armature on all frames."""
    rig, frames = bones[0].id_data, range(POSES[0][0], POSES[-1][0] + 1)
    rows = [[np.array(scenes.shown(rig, frame)[bone.name].matrix) for bone in bones] for frame in frames]
    return list(np.moveaxis(np.array(rows), 1, 0))


@pytest.mark.parametrize(("mode", "rotation_mode"), in_turn(KEYFRAME_MODES, ["QUATERNION", "YXZ"]))
def test_it_goes_as_a_bone_that_is_moved_along_its_own_axes(pair, mode, rotation_mode):
    pose(pair, rotation_mode)
    animation.set_mode(list(pair), mode)
    one, other = shown(pair)
    np.testing.assert_allclose(other, one, atol=1e-5)


def toggle(rig: bpy.types.Object) -> None:
    rig.data.bones["B"].use_local_location = True


def roll(rig: bpy.types.Object, name: str) -> None:
    with_edit_bones(rig, lambda bones: setattr(bones[name], "roll", 1.5))


REST_EDITS = {
    "by its setting": toggle,
    "by its roll": partial(roll, name="B"),
    "by its parent's": partial(roll, name="Parent"),
}


@pytest.mark.parametrize("edit", REST_EDITS.values(), ids=REST_EDITS)
def test_when_it_gets_other_axes_the_in_betweens_are_made_anew_at_once(pair, edit):
    pose(pair)
    animation.set_mode([pair[1]], "dq_sclerp")
    rig = pair[1].id_data
    rig.update_tag()
    bpy.context.view_layer.update()
    edit(rig)
    bpy.context.view_layer.update()
    bone = rig.pose.bones["B"]
    (followed,) = shown((bone,))
    assert animation.refresh() == 0
    for mode in ("BLENDER", "dq_sclerp"):
        animation.set_mode([bone], mode)
    (anew,) = shown((bone,))
    np.testing.assert_allclose(followed, anew, atol=1e-6)
