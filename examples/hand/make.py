"""Five reaches of a hand with a controller, as the CSV of a logger in Unity, with the usual faults of such logs."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "scripts")]

from examples import staging
from examples.stills import render_still
from research.making.motions import MOTIONS
from research.making.tracking import tick, track
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.scenes.scene import SceneSettings, build_scene

SEED = 7

HEADER = "timestamp_ms,PosX,PosY,PosZ,RotX,RotY,RotZ,RotW"

STARTED = 48_213.0
"""How long the game had been running at the first row, in milliseconds."""

TWICE, LOST, FLIPPED = slice(60, 63), slice(150, 158), slice(200, None)
"""Rows that are written twice, rows that are missing, and rows whose quaternions have the opposite sign."""

RATE, MODES, MOMENT = "5", ("bezier", "lerp_slerp", "dq_sclerp", "motor_spline"), 3.32
"""Keys per second, modes and time in seconds of the picture."""

SIZE = 800, 360


def main(arguments: list[str] | None = None) -> None:
    """Write the log, and render the picture if asked to."""
    options = staging.parse(HERE, __doc__, arguments)
    path = staging.put(options.output, "hand.csv", log())
    if options.picture:
        picture(path, options.output / "hand.png")


def log() -> str:
    """Return the text of the log."""
    rng = np.random.default_rng(SEED)
    reach = MOTIONS["reach"]
    times = tick(rng, reach.duration)
    # Swapping y and z is its own inverse: Unity's y is up and its axes are left-handed.
    poses = to_blender(track(rng, reach.poses, times), "unity")
    quaternions = np.roll(poses.quaternions, -1, axis=1)
    quaternions[FLIPPED] *= -1.0
    rows = np.column_stack((STARTED + 1e3 * times, poses.positions, quaternions))
    order = np.insert(np.arange(len(rows)), TWICE.stop, np.arange(TWICE.start, TWICE.stop))
    order = order[(order < LOST.start) | (order >= LOST.stop)]
    lines = [f"{row[0]:.2f}," + ",".join(f"{value:.5f}" for value in row[1:]) for row in rows[order]]
    return "\n".join([HEADER, *lines, ""])


def picture(recording: Path, path: Path) -> None:
    """Render one moment of the comparison scene."""
    settings = SceneSettings(resolution=SIZE, antialiasing="8", subject="controller", distinct=True)
    (clip,), _ = read_clips([str(recording)], "unity")
    scene = build_scene(reconstruct(clip, Uniform(RATE), MODES, radius=0.1), settings)
    scene.frame_set(1 + round(MOMENT * settings.fps))
    render_still(scene, path)


if __name__ == "__main__":
    staging.run(main)
