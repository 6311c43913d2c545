"""Make the film of a whole body in several modes, a still of the film, and a heat map of the joint errors.

python docs/make_body_pictures.py

The body is the dancer of the examples, clothed. Writes bodies.mp4, bodies.png and bodies-heat.svg next to this file.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import bpy
import matplotlib.pyplot as plt
from matplotlib.colors import LinearSegmentedColormap

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from examples import figure
from examples.dancer import dance
from examples.stills import render_still
from rigid_motion import animation
from rigid_motion_batch.analysis.choices import EVERYWHERE, Uniform
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.analysis.results import ChoiceResult, measured
from rigid_motion_batch.cli import compare
from rigid_motion_batch.palette import ERROR_COLOURS, full_colour
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.rest_bodies import short_names
from rigid_motion_batch.scenes.materials import surface

RATE, MODES = "4", ("bezier", "dq_sclerp", "motor_spline")

MAPPED = "motor_spline"
"""The mode whose errors the heat map shows."""

MOMENT = 3.85
"""The time of the still, in seconds into the film."""


def main() -> None:
    """Make the film and both pictures."""
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "dancer.blend"
        save_dancer(recording)
        source = f"{recording}:Dancer"
        output = Path(folder) / "out"
        options = ["--rates", RATE, "--modes", ",".join(MODES), "--antialiasing", "5", "--output", str(output)]
        compare.main([source, *options, "--jobs", "0"])  # Workers cannot start from a process that has loaded Blender.
        (film,) = output.glob(f"*/{RATE}/comparison.mp4")
        shutil.copy(film, DOCS / "bodies.mp4")

        bpy.ops.wm.open_mainfile(filepath=str(film.with_suffix(".blend")), use_scripts=False)
        scene = bpy.context.scene
        scene.frame_set(1 + round(MOMENT * scene.render.fps))
        render_still(scene, DOCS / "bodies.png")

        (clip,), _ = read_clips([source], None)
        made = reconstruct(clip, Uniform(RATE), MODES, EVERYWHERE.of(clip))
        draw_errors(clip, measured(made), DOCS / "bodies-heat.svg")


def draw_errors(clip: Clip, result: ChoiceResult, path: Path) -> None:
    """Draw the error of each joint over time in the mode `MAPPED`, in the colours of the report."""
    top = 1e3 * full_colour(motion.joint_errors for motion in result.motions)
    errors = 1e3 * next(motion.joint_errors for motion in result.motions if MAPPED in motion.modes)
    joints, samples = errors.shape
    times = clip.times[result.first :][:samples] - clip.times[0]
    grey = dict.fromkeys(("text.color", "axes.labelcolor", "axes.edgecolor", "xtick.color", "ytick.color"), "#768390")
    with plt.rc_context({**grey, "svg.fonttype": "none", "svg.hashsalt": path.stem, "font.size": 7.5}):
        figure, axes = plt.subplots(figsize=(9.0, 3.0), layout="constrained")
        colours = LinearSegmentedColormap.from_list("errors", ERROR_COLOURS)
        place = (times[0], times[-1], joints - 0.5, -0.5)
        drawn = axes.imshow(errors, colours, vmin=0.0, vmax=top, aspect="auto", interpolation="nearest", extent=place)
        axes.set_yticks(range(joints), short_names(clip.rest_body.joints))
        axes.set_xlabel("seconds")
        figure.colorbar(drawn, label="shell error, mm", pad=0.01)
        figure.savefig(path, transparent=True, metadata={"Date": None})


def save_dancer(path: Path) -> None:
    """Save a .blend with the dancer: a key on every frame, and a body mesh."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    animation.register()
    try:
        rig = dance.dancer()
        rig.name = "Dancer"
        figure.clothe(rig, surface("Cloth", "#93A0B3"))
        scene = bpy.context.scene
        scene.render.fps, scene.frame_end = dance.FPS, int(dance.FRAMES[-1])
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    finally:
        animation.unregister()


if __name__ == "__main__":
    main()
