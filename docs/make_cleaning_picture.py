"""Draw recordings before and after `clean`: a hand with spikes, a camera, and the foot of a body.

python docs/make_cleaning_picture.py

writes cleaning.svg beside this file. The motions are those of assets/ and of the dancer among the examples, with noise.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from docs.drawing import drawing, element, polyline
from examples.dancer import dance
from rigid_motion.motion import Poses
from rigid_motion.motion.differences import turned_in_world
from rigid_motion_batch.files import write_text
from rigid_motion_batch.recordings import read_clips
from rigid_motion_batch.recordings.cleaning import cleaned_clip, described
from rigid_motion_batch.recordings.clips import Clip

WIDTH, HEIGHT, TOP, LEFT = 860, 190, 44, 12
STYLE = "text{font:14px sans-serif;fill:#2b3440}.small{font-size:12px;fill:#5b6675}path{fill:none}"
RECORDED, CLEANED, TRUTH = "#e08a3c", "#3b73d1", "#2b3440"


def shaken(poses: Poses, place: float, degrees: float, seed: int) -> Poses:
    """Return poses with white noise, of a body places of the root alone."""
    random = np.random.default_rng(seed)
    noise, turns = (
        random.normal(size=(2, *poses.positions.shape))
        * np.array([place, np.radians(degrees)])[(slice(None), *[None] * poses.positions.ndim)]
    )
    if noise.ndim > 2:
        noise[1:] = 0.0
    quaternions = turned_in_world(poses.quaternions, turns)
    return Poses(poses.positions + noise, quaternions)


def asset(name: str) -> Clip:
    (clip,), _ = read_clips([str(DOCS.parent / "assets" / f"{name}.csv")])
    return clip


def dancer() -> Clip:
    """Return the dancer as motion capture would have her."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.view_layer.objects.active = dance.dancer()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dancer.bvh"
        bpy.ops.export_anim.bvh(filepath=str(path), frame_start=1, frame_end=int(dance.FRAMES[-1]))
        (clip,), _ = read_clips([str(path)])
    return clip


def panel(row: int, title: str, truth: Clip, shaky: Clip, tolerance: float, part: slice, **joint: str) -> str:
    """Return the graph of a height, or of an angle about the axis up of what is no body, in a part of a clip."""
    cleaned, found = cleaned_clip(shaky, tolerance)
    lines, seconds = [], truth.times[part] - truth.times[part][0]
    for clip in (shaky, truth, cleaned):
        if clip.rest_body:
            number = clip.rest_body.joints.index(joint["joint"])
            values = clip.in_blender(clip.rest_body.skeleton.in_root_space(clip.poses)[number]).positions[:, 2]
        elif joint:
            w, _, _, z = clip.poses.quaternions.T
            values = np.unwrap(2.0 * np.arctan2(z, w))
        else:
            values = clip.in_blender(clip.poses).positions[:, 2]
        lines.append(values[part])
    low, high = np.quantile(np.concatenate(lines), (0.0, 1.0))
    top = row * HEIGHT + TOP
    x = LEFT + (WIDTH - 2 * LEFT) * seconds / seconds[-1]
    paths = [
        element("path", d=polyline(np.column_stack([x, top + (HEIGHT - TOP - 14) * (high - y) / (high - low)])), **look)
        for y, look in zip(
            lines,
            (
                {"stroke": RECORDED, "stroke_width": 1},
                {"stroke": TRUTH, "stroke_width": 4, "stroke_opacity": 0.2},
                {"stroke": CLEANED, "stroke_width": 1.5},
            ),
            strict=True,
        )
    ]
    said = element("text", "; ".join(described(shaky, found)), x=LEFT, y=top - 8, class_="small")
    return element("text", title, x=LEFT, y=top - 24) + said + "".join(paths)


def main() -> None:
    """Draw the three."""
    hand, camera, body = asset("throw"), asset("reach"), dancer()
    shaky = shaken(hand.poses, 0.006, 0.5, 1)
    for first, off in ((60, 0.2), (180, -0.15)):
        shaky.positions[first : first + 2] += off
    foot = next(name for name in body.whole_body.joints if "foot" in name.lower() or "toe" in name.lower())
    panels = (
        panel(0, "A hand: its height", hand, replace(hand, poses=shaky), 0.03, slice(20, 220)),
        panel(
            1,
            "A camera: how far it is turned",
            camera,
            replace(camera, poses=shaken(camera.poses, 0.004, 1.0, 2)),
            0.02,
            slice(0, 100),
            joint="",
        ),
        panel(
            2,
            f"A body: the height of {foot}",
            body,
            replace(body, poses=shaken(body.poses, 0.002, 0.4, 3)),
            0.03,
            slice(0, 120),
            joint=foot,
        ),
    )
    about = "As recorded (orange), cleaned (blue), and as it was before noise was put in (grey)"
    write_text(DOCS / "cleaning.svg", drawing(about, STYLE, WIDTH, 3 * HEIGHT + 4, *panels))


if __name__ == "__main__":
    main()
