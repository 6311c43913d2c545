"""A dancer with a key on every bone and frame, and next to her the same dance from its key poses alone."""

from __future__ import annotations

import sys
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "scripts")]

from examples import figure, staging
from examples.dancer import dance
from rigid_motion import animation
from rigid_motion_batch import palette
from rigid_motion_batch.scenes.materials import surface

MODE = "motor_spline"
TOLERANCE, RADIUS = 0.01, 0.03
"""Largest error allowed within the radius around each joint, both in metres."""

LANES = ("Recorded", staging.SKIN, -1.1), ("Key poses", palette.MODE_COLOURS[MODE], 1.1)
"""Title, colour and X position of each dancer."""

WIDTH = 4.6
"""Width of the picture, in metres."""

STILL, GHOSTS = 98, 3
"""The frame of the picture, and the number of earlier key poses shown in it."""


def main(arguments: list[str] | None = None) -> None:
    """Make both dancers, and print the number of keys left and the largest error."""
    options = staging.parse(HERE, __doc__, arguments)
    count = len(dance.FRAMES)
    staging.begin(count, dance.FPS)
    camera = staging.look((0.0, 0.0, 1.08), (82.0, 0.0, 0.0), WIDTH)
    rigs = []
    for name, colour, place in LANES:
        rig = dance.dancer()
        rig.name, rig.location.x, rig.show_in_front = name, place, True
        figure.clothe(rig, surface(f"{name} skin", colour)).hide_select = True
        rigs.append(rig)
    recorded, reduced = rigs
    bones = list(reduced.pose.bones)
    animation.reduce_keys_of(bones, MODE, TOLERANCE, RADIUS, shared=True)
    done = animation.reduction_of(bones)
    poses = np.unique([frame for bone in bones for frame in animation.key_frames(bone)])
    off = measure(recorded, reduced)

    says = (
        f"{count} poses, {done.before} keys",
        f"{len(poses)} poses, {done.after} keys, joints off by up to {off:.1f} mm",
    )
    for (name, colour, place), text in zip(LANES, says, strict=True):
        staging.title(camera, place / WIDTH - 0.22, name, text, colour)
        print(f"{name}: {text}")
    staging.foot(camera, "No joint is off by more than 10 mm on any frame")

    def dress() -> None:
        staging.write(camera, "Behind: the key poses before this frame", 0.019, -0.262, 0.02, palette.DARK.faint)
        for frame in poses[poses < STILL][-GHOSTS:]:
            ghost(reduced.children[0], int(frame))

    staging.finish(options, "dancer", reduced, STILL, bone="DEF-hand.R", dress=dress)


def measure(recorded: bpy.types.Object, reduced: bpy.types.Object) -> float:
    """Return the largest error of any joint on any frame, in millimetres."""

    def off() -> tuple[float]:
        joints = [[bone.head for bone in staging.evaluated(rig).pose.bones] for rig in (recorded, reduced)]
        return (np.linalg.norm(np.subtract(*np.array(joints)), axis=-1).max(),)

    return 1e3 * float(staging.on_frames(staging.all_frames(), off).max())


def ghost(body: bpy.types.Object, frame: int) -> None:
    """Add a copy of the body in the pose of a frame, behind the dancer, only for the picture."""
    bpy.context.scene.frame_set(frame)
    seen = staging.evaluated(body)
    mesh = bpy.data.meshes.new_from_object(seen)
    mesh.materials.clear()
    mesh.materials.append(surface("Ghost", LANES[1][1], alpha=0.18))
    obj = bpy.data.objects.new(f"Key pose {frame}", mesh)
    obj.matrix_world = seen.matrix_world.copy()
    obj.location.y += 0.6
    bpy.context.scene.collection.objects.link(obj)


if __name__ == "__main__":
    staging.run(main)
