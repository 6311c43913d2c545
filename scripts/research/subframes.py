"""How far live in-betweens are off between whole frames: in delta transforms, and set to be exact there.

    python scripts/research subframes
    python scripts/research subframes --radius 1

Objects go from key to key about axes and in directions drawn at random. At sub-frames, the pose that Blender shows is
compared with the pose that the mode has there: millimetres are the largest displacement of any point of the shell.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import bpy
import numpy as np

from research.studies import publish, study_parser
from rigid_motion import animation
from rigid_motion.animation.compute.differences import in_betweens
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.motion import KEYFRAME_MODES, Poses, shell_error
from rigid_motion.motion.eulers import extrinsic_eulers_from_quaternions
from rigid_motion.motion.measures import rms
from rigid_motion.motion.quaternions import align_signs, angle_between, multiply, normalise
from rigid_motion_batch.scenes.body_scene import registered

SEGMENTS = 24
ROTATION_MODES = ("QUATERNION", "XYZ")

QUARTERS = np.array((0.25, 0.5, 0.75))  # where motion blur with a few steps looks
THIRTY_SECONDS = np.arange(1, 32) / 32.0  # between samples wherever these lie
EIGHTHS = np.array((0.125, 0.375, 0.625, 0.875))  # half-way between keys that are baked on every quarter of a frame


class Motion(NamedTuple):
    """What happens between two keys, in degrees, metres and frames."""

    name: str
    degrees: float
    metres: float
    frames: int


MOTIONS = (
    Motion("Slow", 30.0, 0.5, 48),
    Motion("Brisk", 90.0, 1.0, 24),
    Motion("Violent", 150.0, 2.0, 13),
)


def key_poses(motion: Motion) -> Poses:
    """Return poses a turn and a step apart, in directions drawn at random."""
    axes, steps = normalise(np.random.default_rng(11).normal(size=(2, SEGMENTS, 3)))
    half = 0.5 * np.radians(motion.degrees)
    quaternions = [np.array((0.5, 0.5, -0.5, 0.5))]
    for axis in axes:
        quaternions.append(multiply(np.concatenate(((np.cos(half),), np.sin(half) * axis)), quaternions[-1]))
    positions = np.concatenate((np.zeros((1, 3)), np.cumsum(motion.metres * steps, axis=0)))
    return Poses(positions, align_signs(np.array(quaternions)))


def keyed_object(motion: Motion, rotation_mode: str) -> bpy.types.Object:
    """Return an empty in the scene with these keys, eased as Blender eases them."""
    obj = bpy.data.objects.new(motion.name, None)
    obj.rotation_mode = rotation_mode
    bpy.context.collection.objects.link(obj)
    poses, channel = key_poses(motion), "rotation_quaternion"
    rotations = poses.quaternions
    if rotation_mode != "QUATERNION":
        channel, rotations = "rotation_euler", extrinsic_eulers_from_quaternions(rotations, rotation_mode)
    for path, values in (("location", poses.positions), (channel, rotations)):
        animation.write_channel(
            obj, path, 1.0 + motion.frames * np.arange(SEGMENTS + 1), values, interpolation="BEZIER"
        )
    return obj


def measure(motion: Motion, mode: str, rotation_mode: str, radius: float) -> dict[str, float]:
    """Measure live in-betweens, exact ones, those baked on every quarter of a frame, and on every whole frame."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = keyed_object(motion, rotation_mode)
    animation.set_mode(obj, mode)
    whole = 1.0 + np.arange(motion.frames * SEGMENTS)[:, None]
    moments = [(whole + fractions).ravel() for fractions in (QUARTERS, THIRTY_SECONDS, EIGHTHS)]
    quarters, finest, eighths = ((frames, in_betweens(source_of(obj), frames).desired) for frames in moments)

    def deviation(name: str, units: Sequence[str], frames: np.ndarray, requested: Poses) -> dict[str, float]:
        """Return how far Blender shows it from where it should be."""
        shown = animation.read_poses(obj, frames)
        shell, turned = shell_error(shown, requested, radius), angle_between(shown.quaternions, requested.quaternions)
        figures = {"mm": 1e3 * shell.max(), "rms_mm": 1e3 * rms(shell), "degrees": np.degrees(turned.max())}
        return {f"{name}_{unit}": float(figures[unit]) for unit in units}

    figures = deviation("live", ("mm", "rms_mm", "degrees"), *quarters)
    animation.set_exact(obj)
    figures |= deviation("exact", ("mm",), *finest)
    animation.set_exact(obj, False)
    animation.bake(obj, step=0.25)
    figures |= deviation("quarter", ("mm", "degrees"), *eighths)
    animation.unbake(obj)
    animation.bake(obj)
    return figures | deviation("whole", ("mm",), *quarters)


def figures_of(motion: Motion, radius: float) -> dict[str, Any]:
    """Return the figures of one motion, for every mode and rotation mode."""
    rows = [
        {"mode": mode, "rotation": rotation_mode, **measure(motion, mode, rotation_mode, radius)}
        for mode in KEYFRAME_MODES
        for rotation_mode in ROTATION_MODES
    ]
    return {**motion._asdict(), "rows": rows}


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("subframes", __doc__)
    parser.add_argument("--radius", type=float, default=0.1, help="of the shell, in metres (%(default)s)")
    options = parser.parse_args(arguments)
    with registered():
        figures = {"radius": options.radius, "motions": [figures_of(motion, options.radius) for motion in MOTIONS]}
    return publish("subframes", figures, options, f"--radius {options.radius:g}", Blender=bpy.app.version_string)
