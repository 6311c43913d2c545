"""How far live in-betweens are off between whole frames: in delta transforms, and set to be exact there.

    python scripts/research subframes
    python scripts/research subframes --radius 1

Objects go from key to key about axes and in directions drawn at random. At sub-frames, the pose that Blender shows is
compared with the pose that the mode has there: millimetres are the largest displacement of any point of the shell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np

from research.publishing import publish, say, study_parser
from rigid_motion import animation
from rigid_motion.animation.compute.differences import in_betweens
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.motion import KEYFRAME_MODES, Poses, shell_error
from rigid_motion.motion.eulers import extrinsic_eulers_from_quaternions
from rigid_motion.motion.measures import rms
from rigid_motion.motion.quaternions import align_signs, angle_between, multiply

SEGMENTS = 24

ROTATION_MODES = ("QUATERNION", "XYZ")

QUARTERS = np.array((0.25, 0.5, 0.75))
"""Where motion blur with a few steps looks."""

THIRTY_SECONDS = np.arange(1, 32) / 32.0
"""Between samples wherever these lie."""

EIGHTHS = np.array((0.125, 0.375, 0.625, 0.875))
"""Half-way between keys that are baked on every quarter of a frame."""


@dataclass(frozen=True)
class Motion:
    """What happens between two keys: an angle in degrees, a distance in metres, a duration in frames."""

    name: str
    turn: float
    distance: float
    frames: int

    @property
    def key_frames(self) -> np.ndarray:
        return 1.0 + self.frames * np.arange(SEGMENTS + 1)


MOTIONS = (
    Motion("Slow", 30.0, 0.5, 48),
    Motion("Brisk", 90.0, 1.0, 24),
    Motion("Violent", 150.0, 2.0, 13),
)


@dataclass(frozen=True)
class Deviation:
    """How far a motion is off: shell errors in metres, the rotation in radians."""

    largest: float
    rms: float
    rotation: float


def key_poses(motion: Motion) -> Poses:
    """Poses a turn and a step apart, in directions drawn at random."""
    random = np.random.default_rng(11)
    axes, steps = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in random.normal(size=(2, SEGMENTS, 3)))
    half = 0.5 * np.radians(motion.turn)
    quaternions = [np.array((0.5, 0.5, -0.5, 0.5))]
    for axis in axes:
        quaternions.append(multiply(np.concatenate(((np.cos(half),), np.sin(half) * axis)), quaternions[-1]))
    positions = np.concatenate((np.zeros((1, 3)), np.cumsum(motion.distance * steps, axis=0)))
    return Poses(positions, align_signs(np.array(quaternions)))


def keyed_object(motion: Motion, rotation_mode: str) -> bpy.types.Object:
    """An empty in the scene with these keys, eased as Blender eases them."""
    obj = bpy.data.objects.new(motion.name, None)
    obj.rotation_mode = rotation_mode
    bpy.context.collection.objects.link(obj)
    poses, frames = key_poses(motion), motion.key_frames
    animation.write_channel(obj, "location", frames, poses.positions, interpolation="BEZIER")
    if rotation_mode == "QUATERNION":
        animation.write_channel(obj, "rotation_quaternion", frames, poses.quaternions, interpolation="BEZIER")
    else:
        angles = extrinsic_eulers_from_quaternions(poses.quaternions, rotation_mode)
        animation.write_channel(obj, "rotation_euler", frames, angles, interpolation="BEZIER")
    return obj


def between(motion: Motion, fractions: np.ndarray) -> np.ndarray:
    """The sub-frames from the first key to the last."""
    first, last = motion.key_frames[[0, -1]]
    return (np.arange(first, last)[:, None] + fractions).ravel()


def deviation(obj: bpy.types.Object, frames: np.ndarray, requested: Poses, radius: float) -> Deviation:
    """How far Blender shows an object from where it should be."""
    shown = animation.read_poses(obj, frames)
    shell = shell_error(shown, requested, radius)
    return Deviation(
        float(shell.max()), rms(shell), float(angle_between(shown.quaternions, requested.quaternions).max())
    )


def measure(motion: Motion, mode: str, rotation_mode: str, radius: float) -> list[Deviation]:
    """Of live in-betweens, of exact ones, of those baked on every quarter of a frame, and on every whole frame."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    obj = keyed_object(motion, rotation_mode)
    animation.set_mode(obj, mode)
    source = source_of(obj)
    quarters, eighths = (between(motion, fractions) for fractions in (QUARTERS, EIGHTHS))
    at_quarters, at_eighths = (in_betweens(source, frames).desired for frames in (quarters, eighths))
    live = deviation(obj, quarters, at_quarters, radius)
    animation.set_exact(obj)
    finest = between(motion, THIRTY_SECONDS)
    exact = deviation(obj, finest, in_betweens(source, finest).desired, radius)
    animation.set_exact(obj, False)
    animation.bake(obj, step=0.25)
    finely = deviation(obj, eighths, at_eighths, radius)
    animation.unbake(obj)
    animation.bake(obj)
    return [live, exact, finely, deviation(obj, quarters, at_quarters, radius)]


def rest_bodies_of(motion: Motion, radius: float) -> dict[str, Any]:
    """The figures of one motion, for every mode and rotation mode."""
    rows = []
    for mode in KEYFRAME_MODES:
        for rotation_mode in ROTATION_MODES:
            live, exact, finely, whole = measure(motion, mode, rotation_mode, radius)
            figures = {
                "live_mm": 1e3 * live.largest,
                "live_rms_mm": 1e3 * live.rms,
                "live_degrees": np.degrees(live.rotation),
                "quarter_mm": 1e3 * finely.largest,
                "quarter_degrees": np.degrees(finely.rotation),
                "whole_mm": 1e3 * whole.largest,
                "exact_mm": 1e3 * exact.largest,
            }
            rows.append({"mode": mode, "rotation": rotation_mode, **figures})
    about = {"name": motion.name, "degrees": motion.turn, "metres": motion.distance, "frames": motion.frames}
    return {**about, "rows": rows}


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("subframes", __doc__)
    parser.add_argument("--radius", type=float, default=0.1, help="of the shell, in metres (%(default)s)")
    options = parser.parse_args(arguments)
    result = []
    animation.register()
    try:
        for motion in MOTIONS:
            say(motion.name)
            result.append(rest_bodies_of(motion, options.radius))
    finally:
        animation.unregister()
    figures = {"radius": options.radius, "motions": result}
    return publish("subframes", figures, options, f"--radius {options.radius:g}", Blender=bpy.app.version_string)
