"""A sword in a fist, swung by the hand control: Blender's own in-betweens fold the arm, Screw does not."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "scripts")]

from examples import figure, staging
from rigid_motion import animation
from rigid_motion_batch.scenes.materials import surface

KEYS = (1, 75.0), (19, -45.0), (31, -45.0), (55, 75.0)
"""Frames, and the angle of the raised arm on each, in degrees."""

LANES = ("Blender", staging.BLENDER, "BLENDER", -1.4), ("Screw", staging.RIGID, "dq_sclerp", 1.4)
"""Title, colour, mode and Y position of each fighter."""

SHOULDER, ELBOW, WRIST = Vector((0.0, 0.0, 1.36)), Vector((0.0, 0.29, 1.32)), Vector((0.0, 0.58, 1.36))
BONES = {
    "DEF-spine.001": (None, (0.0, 0.0, 0.95), (0.0, 0.0, 1.12)),
    "DEF-spine.003": ("DEF-spine.001", (0.0, 0.0, 1.12), (0.0, 0.0, 1.38)),
    "DEF-spine.006": ("DEF-spine.003", (0.0, 0.02, 1.52), (0.0, 0.04, 1.70)),
    "DEF-upper_arm": ("DEF-spine.003", SHOULDER, ELBOW),
    "DEF-forearm": ("DEF-upper_arm", ELBOW, WRIST),
    "DEF-thigh": (None, (0.0, 0.0, 0.9), (0.0, 0.03, 0.48)),
    "DEF-shin": ("DEF-thigh", (0.0, 0.03, 0.48), (0.0, 0.0, 0.08)),
    "DEF-foot": ("DEF-shin", (0.0, 0.0, 0.06), (0.0, 0.14, 0.04)),
    "hand": (None, WRIST, (0.0, 0.66, 1.36)),
}
"""Parent, head and tail of each bone. The forearm follows the control `hand` by IK."""

TIP = Vector((0.0, 0.0, 0.85))
"""The tip, in the sword's space, whose origin is in the grip."""

WIDTH = 5.6
"""Width of the picture, in metres."""

STILL = 10


def main(arguments: list[str] | None = None) -> None:
    """Make the scene, and print the errors of grip and wrist."""
    options = staging.parse(HERE, __doc__, arguments)
    staging.begin(frames=KEYS[-1][0] + 10)
    camera = staging.look((0.0, 0.2, 1.35), (90.0, 0.0, 90.0), WIDTH)
    rigs = []
    for name, colour, mode, place in LANES:
        rig = fighter(name, colour, place)
        animation.set_mode(rig.pose.bones["hand"], mode)
        rigs.append((rig, sword(name, rig)))
    animation.refresh()
    for (rig, blade), (name, colour, _, place) in zip(rigs, LANES, strict=True):
        slipped, shorter = measure(rig, blade)
        head = f"wrist off its circle by up to {staging.length(shorter)}"
        staging.title(camera, place / WIDTH - 0.21, name, head, colour)
        down = np.arange(KEYS[0][0], KEYS[1][0] + 0.1, 0.25)
        tips = staging.on_frames(down, lambda blade=blade: staging.evaluated(blade).matrix_world @ TIP)
        staging.path(f"{name} path", tips, colour, 0.012)
        print(f"{name}: grip off the hand by up to {staging.length(slipped)}, {head}")
    staging.foot(camera, "The same keys on the hand control of both.   Line: the tip of the sword on its way down")
    staging.finish(options, "sword", rigs[1][0], STILL, bone="hand")


def fighter(name: str, colour: str, place: float) -> bpy.types.Object:
    """Add a rig of trunk, legs and an arm that follows a keyed hand control."""
    rig = bpy.data.objects.new(f"{name} rig", bpy.data.armatures.new("Fighter"))
    bpy.context.scene.collection.objects.link(rig)
    rig.location.y = place
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for bone, (parent, head, tail) in BONES.items():
        new = rig.data.edit_bones.new(bone)
        new.head, new.tail = head, tail
        if parent:
            new.parent = rig.data.edit_bones[parent]
    bpy.ops.object.mode_set(mode="OBJECT")
    rig.data.bones["hand"].use_deform = False
    follow = rig.pose.bones["DEF-forearm"].constraints.new("IK")
    follow.target, follow.subtarget, follow.chain_count = rig, "hand", 2
    figure.clothe(rig, surface(f"{name} skin", colour)).hide_select = True
    rig.show_in_front = True

    hand = rig.pose.bones["hand"]
    rest = hand.bone.matrix_local
    for frame, angle in KEYS:
        turned = Matrix.Rotation(np.radians(angle), 4, "X")
        about = Matrix.Translation(SHOULDER) @ turned @ Matrix.Translation(-SHOULDER)
        staging.key(hand, frame, rest.inverted() @ about @ rest)
    return rig


def sword(name: str, rig: bpy.types.Object) -> bpy.types.Object:
    """Add a sword that the hand holds, upright when the arm is level."""
    steel, gold = surface("Steel", staging.STEEL), surface("Gold", staging.WOOD)
    blade = figure.boxes(f"{name} sword", steel, ((0.0, 0.0, 0.47), (0.012, 0.05, 0.76)))
    hilt = figure.boxes(f"{name} hilt", gold, ((0, 0, 0), (0.03, 0.03, 0.18)), ((0, 0, 0.09), (0.02, 0.2, 0.025)))
    hilt.parent = blade
    hand = rig.pose.bones["hand"]
    bpy.context.scene.frame_set(KEYS[0][0])
    grip = hand.bone.matrix_local.inverted() @ Matrix.Translation(hand.bone.head_local)
    blade.matrix_basis = staging.evaluated(rig).matrix_world @ staging.evaluated(rig).pose.bones["hand"].matrix @ grip
    animation.hold_in(blade, hand)
    hilt.hide_select = True
    return blade


def measure(rig: bpy.types.Object, blade: bpy.types.Object) -> tuple[float, float]:
    """Return the largest distances of the grip from the hand and of the wrist from its circle, in metres."""

    def look() -> tuple[float, float]:
        bones = staging.evaluated(rig).pose.bones
        grip = staging.evaluated(blade).matrix_world.translation
        wrist = rig.matrix_world @ bones["DEF-forearm"].tail
        hand = rig.matrix_world @ bones["hand"].head
        circle = (WRIST - SHOULDER).length
        return (grip - hand).length, abs((wrist - rig.matrix_world @ SHOULDER).length - circle)

    slipped, off = staging.on_frames(staging.all_frames(), look).max(axis=0)
    return float(slipped), float(off)


if __name__ == "__main__":
    staging.run(main)
