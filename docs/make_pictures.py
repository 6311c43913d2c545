"""Make the comparison pictures of these pages: stills of the comparison scene, and a film of it.

python docs/make_pictures.py
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.modes import COMPARED
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.cli import compare
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.scenes.findings import findings_of
from rigid_motion_batch.scenes.scene import SceneSettings, build_scene

SMOOTH = ("bezier", "lerp_slerp", "dq_sclerp", "motor_spline")


@dataclass(frozen=True)
class Still:
    """A still: a moment of an asset, in seconds, reconstructed from `rate` keys per second."""

    asset: str
    rate: str
    moment: float
    modes: Sequence[str]
    resolution: tuple[int, int]
    subject: str


STILLS = {
    "comparison.png": Still("screw", "5", 2.7, COMPARED, (1280, 720), "drill"),
    "smooth.png": Still("reach", "8", 3.32, SMOOTH, (1280, 480), "controller"),
}


def main() -> None:
    """Render the stills and the film."""
    for picture, still in STILLS.items():
        settings = SceneSettings(resolution=still.resolution, antialiasing="8", subject=still.subject, distinct=True)
        (clip,), _ = read_clips([str(DOCS.parent / "assets" / f"{still.asset}.csv")], "blender")
        made = reconstruct(clip, Uniform(still.rate), still.modes, radius=0.1)
        scene = build_scene(made, settings, findings_of(measured(made).rows))
        if hasattr(scene.render.image_settings, "media_type"):
            scene.render.image_settings.media_type = "IMAGE"
        scene.render.image_settings.file_format = "PNG"
        scene.render.filepath = str(DOCS / picture)
        scene.frame_set(1 + round(still.moment * settings.fps))
        bpy.ops.render.render(write_still=True)
    still = STILLS["smooth.png"]
    with tempfile.TemporaryDirectory() as folder:
        options = ["--rates", still.rate, "--modes", ",".join(still.modes), "--object", still.subject]
        options += ["--resolution", "960x360", "--slow-motion", "2", "--jobs", "0", "--output", folder]
        compare.main([str(DOCS.parent / "assets" / f"{still.asset}.csv"), *options])
        shutil.copy(Path(folder) / still.asset / still.rate / "comparison.mp4", DOCS / "smooth.mp4")


if __name__ == "__main__":
    main()
