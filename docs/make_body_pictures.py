"""Make the film of a whole body under several modes, a still of it, and the heat map of its errors.

python docs/make_body_pictures.py

The body is the dancer of the tests, clothed. Writes bodies.mp4, bodies.png and bodies-heat.svg beside this file.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from rigid_motion import animation
from rigid_motion_batch.analysis.bodies import reconstruct_body
from rigid_motion_batch.analysis.body_metrics import measure_modes
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.radii import JOINT
from rigid_motion_batch.cli import compare
from rigid_motion_batch.comparison.report.body_charts import heat_map_alone
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.scenes.film import render_still
from rigid_motion_batch.scenes.materials import surface
from tests.rigs import dancer, figure

RATE, MODES = "4", ("lerp_slerp", "dq_sclerp", "motor_spline")

MAPPED = "motor_spline"
"""The mode whose errors are mapped."""

MOMENT = 3.85
"""Seconds into the film: the still."""


def main() -> None:
    """Make everything anew."""
    with tempfile.TemporaryDirectory() as folder:
        recording = Path(folder) / "dancer.blend"
        save_dancer(recording)
        source = f"{recording}:Dancer"
        output = Path(folder) / "out"
        options = ["--rates", RATE, "--modes", ",".join(MODES), "--antialiasing", "5", "--output", str(output)]
        compare.main([source, *options])
        (film,) = output.glob(f"*/{RATE}/comparison.mp4")
        shutil.copy(film, DOCS / "bodies.mp4")

        bpy.ops.wm.open_mainfile(filepath=str(film.with_suffix(".blend")), use_scripts=False)
        scene = bpy.context.scene
        scene.frame_set(1 + round(MOMENT * scene.render.fps))
        render_still(scene, DOCS / "bodies.png")

        (clip,), _ = read_clips([source], None)
        made = reconstruct_body(clip, Uniform(RATE), MODES, JOINT)
        measured = measure_modes(made, np.full(len(clip.figure.joints), JOINT))
        (DOCS / "bodies-heat.svg").write_text(heat_map_alone(measured, MAPPED), encoding="utf-8")


def save_dancer(path: Path) -> None:
    """Write the dancer with a key on every frame, and a body."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    animation.register()
    try:
        rig = dancer.dancer()
        rig.name = "Dancer"
        figure.clothe(rig, surface("Cloth", "#93A0B3"))
        scene = bpy.context.scene
        scene.render.fps, scene.frame_end = dancer.FPS, int(dancer.FRAMES[-1])
        bpy.ops.wm.save_as_mainfile(filepath=str(path))
    finally:
        animation.unregister()


if __name__ == "__main__":
    main()
