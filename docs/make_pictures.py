"""Make the pictures of these pages: stills of the comparison's own scene.

python docs/make_pictures.py
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS.parent))

from addon.motion import MODES
from scripts.comparison.choices import Uniform
from scripts.comparison.stage import StageSettings, build_stage
from scripts.comparison.study import read_clips, reconstruct

STILLS = {"comparison.png": ("screw", "5", 2.7)}
"""Picture to clip of the assets, keys a second, and the moment in seconds."""


def main() -> None:
    """Render every still anew."""
    settings = StageSettings(resolution=(1280, 720), antialiasing="8")
    for picture, (asset, rate, moment) in STILLS.items():
        (clip,), _ = read_clips([str(DOCS.parent / "assets" / f"{asset}.csv")], "blender")
        scene = build_stage(reconstruct(clip, Uniform(rate), MODES, radius=0.1), settings)
        if hasattr(scene.render.image_settings, "media_type"):
            scene.render.image_settings.media_type = "IMAGE"
        scene.render.image_settings.file_format = "PNG"
        scene.render.filepath = str(DOCS / picture)
        scene.frame_set(1 + round(moment * settings.fps))
        bpy.ops.render.render(write_still=True)


if __name__ == "__main__":
    main()
