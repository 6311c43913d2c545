"""The lid of a chest with four keys: Blender's own in-betweens move it off its hinge, Screw keeps it there."""

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
from rigid_motion_batch.scenes.materials import ink, surface

KEYS = (1, 0.0), (25, 115.0), (49, 40.0), (65, 0.0)
"""Frames, and the lid's opening angle on each, in degrees."""

LANES = ("Blender", staging.BLENDER, "BLENDER", -0.52), ("Screw", staging.RIGID, "dq_sclerp", 0.52)
"""Title, colour, mode and sideways position of each chest."""

WIDTH, DEPTH, HEIGHT, THICKNESS = 0.6, 0.4, 0.3, 0.07
HINGE = Vector((0.0, DEPTH / 2.0, HEIGHT))
"""The hinge, in the chest's space."""

IN_LID = Vector((0.0, DEPTH / 2.0, -THICKNESS / 2.0))
"""The hinge, in the space of the lid, whose origin is in its middle."""

ACROSS = 1.9
"""Width of the picture, in metres."""

STILL = 12


def main(arguments: list[str] | None = None) -> None:
    """Make the scene, and print how far each lid leaves its hinge."""
    options = staging.parse(HERE, __doc__, arguments)
    staging.begin(frames=KEYS[-1][0] + 15)
    camera = staging.look((0.0, 0.0, 0.36), (75.0, 0.0, 68.0), ACROSS)
    across = camera.matrix_basis.to_3x3() @ Vector((1.0, 0.0, 0.0))
    lids = []
    for name, colour, mode, place in LANES:
        lid = chest(name, colour, across * place)
        animation.set_mode(lid, mode)
        lids.append(lid)
    animation.refresh()
    for lid, (name, colour, _, place) in zip(lids, LANES, strict=True):
        points = hinge_points(lid)
        off = staging.length(staging.farthest(points, np.array(lid.parent.matrix_world @ HINGE)))
        staging.title(camera, place / ACROSS - 0.19, name, f"hinge off by up to {off}", colour)
        fine = np.arange(KEYS[0][0], KEYS[1][0] + 0.1, 0.25)
        staging.path(f"{name} path", corner_points(lid, fine), colour, 0.004)
        print(f"{name}: hinge off by up to {off}")
    staging.foot(camera, "The same four keys for both.   Orange: the hinge of the chest.   Line: a corner of the lid")
    staging.finish(options, "lid", lids[1], STILL)


def chest(name: str, colour: str, place: Vector) -> bpy.types.Object:
    """Add a chest with a keyed lid at a place, and return the lid."""
    box = figure.boxes(f"{name} chest", surface("Chest", staging.STONE), ((0, 0, HEIGHT / 2), (WIDTH, DEPTH, HEIGHT)))
    box.location, box.hide_select = place, True
    pin = figure.boxes(f"{name} hinge", ink("Hinge", staging.WOOD), (HINGE, (WIDTH + 0.06, 0.022, 0.022)))
    pin.parent, pin.hide_select, pin.show_in_front = box, True, True
    lid = figure.boxes(f"{name} lid", surface(f"{name} lid", colour), ((0, 0, 0), (WIDTH, DEPTH, THICKNESS)))
    lid.parent = box
    for frame, angle in KEYS:
        staging.key(lid, frame, pose(angle))
    bpy.context.view_layer.update()
    return lid


def pose(degrees: float) -> Matrix:
    """Return the matrix of the lid turned about its hinge, in the chest's space."""
    turned = Matrix.Rotation(np.radians(-degrees), 4, "X")
    return Matrix.Translation(HINGE) @ turned @ Matrix.Translation(-IN_LID)


def hinge_points(lid: bpy.types.Object) -> np.ndarray:
    """Return the position of the hinge as a point of the lid on each frame, shape (frames, 3)."""
    return staging.on_frames(staging.all_frames(), lambda: staging.evaluated(lid).matrix_world @ IN_LID)


def corner_points(lid: bpy.types.Object, frames: np.ndarray) -> np.ndarray:
    """Return the path of the lid's corner at the hinge, on the camera's side, shape (frames, 3)."""
    corner = IN_LID + Vector((WIDTH / 2.0 + 0.01, 0.0, 0.0))
    return staging.on_frames(frames, lambda: staging.evaluated(lid).matrix_world @ corner)


if __name__ == "__main__":
    staging.run(main)
