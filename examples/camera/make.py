"""A camera as solved by a tracker, with jitter and gaps, and the same shot from the few keys of a smooth path."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Quaternion, Vector

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "scripts")]

from examples import figure, staging
from research.making.tracking import table, turn
from rigid_motion import animation
from rigid_motion.motion import Poses, reduce_keys, rms, shell_error
from rigid_motion.motion.quaternions import multiply
from rigid_motion_batch import palette
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.scenes.materials import ink, surface

SEED, FPS, FRAMES = 11, 24, 240

JITTER, SHAKE = 0.006, math.radians(0.1)
"""Standard deviations of the solver's error, independent on every frame, in metres and radians."""

LOST = (70, 77), (151, 163)
"""Frames without a solution: first, and one past the last."""

MODE, TOLERANCE, RADIUS = "motor_spline", 0.025, 0.3
"""Largest error allowed anywhere within the radius around the camera, both in metres."""

COLOUR = palette.MODE_COLOURS[MODE]

WIDTH = 3.6
"""Width of the picture, in metres."""

STILL = 110

GRAPH = 0.38, 0.08
"""Width of a graph, and height of one degree in it, in widths of the picture."""


def main(arguments: list[str] | None = None) -> None:
    """Write the solved camera track, and a scene with both cameras."""
    options = staging.parse(HERE, __doc__, arguments)
    path = staging.put(options.output, "solve.csv", solution())

    (clip,), _ = read_clips([str(path)], "blender")
    kept = reduce_keys(clip.times, clip.poses, MODE, TOLERANCE, RADIUS)
    scene = staging.begin(FRAMES, FPS)
    view = staging.look((0.0, -0.05, 0.72), (58.0, 0.0, 0.0), WIDTH)
    solved = camera("Solved", clip.times, clip.poses)
    smooth = camera("Smooth", clip.times[kept], clip.poses[kept])
    animation.set_mode(smooth, MODE)
    animation.refresh()

    frames = 1.0 + FPS * clip.times
    seen = poses_on(smooth, frames)
    truth = path_of(clip.times)
    shakes = {"Solved": shake(poses_on(solved, frames), frames), "Smooth": shake(seen, frames)}
    counts = {"Solved": len(frames), "Smooth": len(kept)}
    report = {name: f"{counts[name]} keys, shakes by {rms(shakes[name]):.3f} degrees" for name in counts}
    for name, text in report.items():
        print(f"{name}: {text}")
    off = [1e2 * float(shell_error(*pair, RADIUS).max()) for pair in ((seen, clip.poses), (seen, truth))]
    print(f"Smooth is off the solution by up to {off[0]:.1f} cm, off the true path by up to {off[1]:.1f} cm")
    furnish(clip.times, clip.poses, poses_on(smooth, np.array(staging.all_frames())), kept)
    body(smooth)
    for x, name, colour in ((-0.47, "Solved", staging.BLENDER), (0.03, "Smooth", COLOUR)):
        staging.title(view, x, name, report[name], colour)
        graph(view, x, shakes[name], colour)
    staging.foot(
        view, "Grey: the camera as solved, with two gaps.   Green: the smooth path.   Orange: its keys.   Graphs: shake"
    )
    scene.camera = view
    staging.finish(options, "camera", smooth, STILL)


def path_of(times: np.ndarray) -> Poses:
    """Return the true camera path: a rising walk around a table, aimed at the objects on the table."""
    share = np.clip(times * FPS / FRAMES, 0.0, 1.0)
    eased = share * share * (3.0 - 2.0 * share)
    angle = np.radians(-190.0 + 200.0 * eased)
    radius = 1.25 - 0.25 * np.sin(np.pi * eased)
    places = np.stack(
        (radius * np.cos(angle), radius * np.sin(angle), 0.5 + 0.7 * eased + 0.05 * np.sin(5.0 * np.pi * share)),
        axis=-1,
    )
    aims = [Vector((0.0, 0.0, 0.25)) - Vector(place) for place in places]
    quaternions = np.array([aim.to_track_quat("-Z", "Y") for aim in aims])
    flips = np.cumprod(np.where(np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0, -1.0, 1.0))
    quaternions[1:] *= flips[:, None]
    return Poses(places, quaternions)


def solution() -> str:
    """Return the tracker's CSV: seconds, metres and quaternions, one row for each solved frame."""
    rng = np.random.default_rng(SEED)
    times = np.arange(FRAMES) / FPS
    truth = path_of(times)
    positions = truth.positions + JITTER * rng.standard_normal((FRAMES, 3))
    quaternions = multiply(truth.quaternions, turn(SHAKE * rng.standard_normal((FRAMES, 3))))
    frames = np.arange(1, FRAMES + 1)
    lost = np.any([(frames >= first) & (frames < end) for first, end in LOST], axis=0)
    return table(times[~lost], Poses(positions[~lost], quaternions[~lost]))


def camera(name: str, times: np.ndarray, poses: Poses) -> bpy.types.Object:
    """Add a camera with a key at each of these times, in seconds."""
    obj = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    obj.data.display_size = 0.12
    obj.rotation_mode = "QUATERNION"
    bpy.context.scene.collection.objects.link(obj)
    animation.bake_poses(obj, 1.0 + FPS * times, poses, key_type="KEYFRAME")
    return obj


def poses_on(obj: bpy.types.Object, frames: np.ndarray) -> Poses:
    """Return the world poses of an object on these frames."""

    def pose() -> tuple[float, ...]:
        location, rotation, _ = staging.evaluated(obj).matrix_world.decompose()
        return (*location, *rotation)

    result = staging.on_frames(frames, pose)
    return Poses(result[:, :3], result[:, 3:])


def shake(poses: Poses, frames: np.ndarray) -> np.ndarray:
    """Return the vertical deviation of each view from the mean of its two neighbours, in degrees, shape (n,)."""
    aims = np.array([Quaternion(q) @ Vector((0.0, 0.0, -1.0)) for q in poses.quaternions])
    bends = aims[1:-1, 2] - (aims[2:, 2] + aims[:-2, 2]) / 2.0
    return np.degrees(bends[np.abs(frames[2:] - frames[:-2] - 2.0) < 1e-3])


def graph(view: bpy.types.Object, x: float, values: np.ndarray, colour: str) -> None:
    """Draw values, shape (n,), as a line below the lane's captions."""
    width = view.data.ortho_scale
    across, up = x + np.linspace(0.0, GRAPH[0], len(values)), 0.165 + GRAPH[1] * values
    points = width * np.stack((across, up, np.full(len(values), -1.0)), axis=-1)
    line = figure.trail("Shake", ink("Shake", colour), points, 0.0013 * width)
    line.parent, line.hide_select = view, True


def furnish(times: np.ndarray, solved: Poses, smooth: Poses, kept: np.ndarray) -> None:
    """Add the objects that the camera films, the solved path with its gaps, and the smooth path with its keys."""
    stone = surface("Stone", staging.STONE)
    for obj in (
        figure.boxes("Table", stone, ((0.0, 0.0, -0.02), (0.9, 0.9, 0.04))),
        figure.boxes("Boxes", surface("Boxes", staging.SKIN), ((0.1, 0.1, 0.15), (0.2, 0.2, 0.3))),
        figure.boxes("Brick", stone, ((-0.15, -0.1, 0.07), (0.2, 0.12, 0.14))),
    ):
        obj.hide_select = True
    gaps = 1 + np.flatnonzero(np.diff(times) > 1.5 / FPS)
    for number, piece in enumerate(np.split(solved.positions, gaps)):
        staging.path(f"Solved path {number}", piece, staging.BLENDER, 0.003)
    staging.path("Smooth path", smooth.positions, COLOUR, 0.006)
    for place in solved.positions[kept]:
        ball = figure.ball("Key", ink("Key", staging.WOOD), 0.018)
        ball.location, ball.hide_select = place, True


def body(smooth: bpy.types.Object) -> None:
    """Add a visible body to the smooth camera, because renders do not show cameras."""
    box = figure.boxes(
        "Body", surface("Body", COLOUR), ((0.0, 0.02, 0.16), (0.1, 0.16, 0.22)), ((0, 0, 0.03), (0.07, 0.07, 0.06))
    )
    box.parent, box.hide_select = smooth, True


if __name__ == "__main__":
    staging.run(main)
