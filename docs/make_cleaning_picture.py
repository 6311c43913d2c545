"""Draw recordings before and after `clean`: a hand with spikes, a camera, and the foot of a body.

python docs/make_cleaning_picture.py

writes cleaning.svg next to this file, and cleaning-film.svg, which every browser animates. The motions come from
assets/ and from the dancer of the examples, with noise added.
"""

from __future__ import annotations

import sys
import tempfile
import textwrap
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import bpy
import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from docs.drawing import drawing, element, polyline
from examples.dancer import dance
from rigid_motion.blender import existing
from rigid_motion.motion import Poses
from rigid_motion.motion.differences import turned_in_world
from rigid_motion.motion.quaternions import matrices
from rigid_motion_batch.files import write_text
from rigid_motion_batch.recordings import read_clips
from rigid_motion_batch.recordings.cleaning import cleaned_clip, described
from rigid_motion_batch.recordings.clips import Clip

WIDTH, HEIGHT, TOP, LEFT = 860, 200, 54, 12
FILM_PX = 260
"""The height of the film, in pixels."""

FILM_S, FILM_RATE_HZ = 4.0, 24
STYLE = "text{font:14px sans-serif;fill:#2b3440}.small{font-size:12px;fill:#5b6675}path{fill:none}"
RECORDED, CLEANED, TRUTH = "#e08a3c", "#3b73d1", "#2b3440"


def shaken(poses: Poses, place: float, degrees: float, seed: int) -> Poses:
    """Return poses with white noise added (metres, degrees). In a body, only the root's position gets noise."""
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
    """Return the dancer as motion capture would record her, read from a BVH file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.view_layer.objects.active = dance.dancer()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "dancer.bvh"
        bpy.ops.export_anim.bvh(filepath=str(path), frame_start=1, frame_end=int(dance.FRAMES[-1]))
        (clip,), _ = read_clips([str(path)])
    return replace(clip, axes="blender")


def panel(row: int, title: str, truth: Clip, shaky: Clip, cleaned: Clip, said: str, part: slice, **joint: str) -> str:
    """Return a graph of part of a clip: the height of an object or of a body's joint, or an object's turn about Z."""
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
    texts = [
        element("text", text, x=LEFT, y=top - 34 + 16 * line, class_="small" if line else "")
        for line, text in enumerate((title, *textwrap.wrap(said, 130)))
    ]
    return "".join((*texts, *paths))


def strokes_of_body(clip: Clip) -> np.ndarray:
    """Return lines from joints to their parents, seen from the front, in metres, shape (t, n, 2, 2)."""
    skeleton = existing(clip.rest_body).skeleton
    places = np.stack([clip.in_blender(pose).positions for pose in skeleton.in_root_space(clip.poses)], axis=1)
    child = np.flatnonzero(np.asarray(skeleton.parents) >= 0)
    return np.stack((places[:, child], places[:, np.asarray(skeleton.parents)[child]]), axis=2)[..., [0, 2]]


def strokes_of_hand(clip: Clip) -> np.ndarray:
    """Return the axes of a hand, seen from a corner, in metres, shape (t, 3, 2, 2)."""
    poses = clip.in_blender(clip.poses)
    tips = poses.positions[:, None] + 0.25 * np.moveaxis(matrices(poses.quaternions), -1, 0).swapaxes(1, 2)
    ends = np.stack((np.repeat(poses.positions[:, None], 3, axis=1), tips), axis=2)
    return ends @ np.array(((0.8, -0.6, 0.0), (0.3, 0.4, 0.85))).T


def strokes_of_camera(clip: Clip, placed: Poses) -> np.ndarray:
    """Return the edges of a cube in front of the placed camera, as a camera clip sees them, shape (t, 12, 2, 2)."""
    corners = np.array(list(np.ndindex(2, 2, 2)), dtype=float) - 0.5
    edges = [
        (one, other) for one in range(8) for other in range(one) if np.abs(corners[one] - corners[other]).sum() == 1.0
    ]
    turned, turns = (np.moveaxis(matrices(poses.quaternions), -1, 0) for poses in (placed, clip.poses))
    cube = placed.positions + (0.6 * corners + (0.0, 0.0, -1.6)) @ turned[0].T
    seen = np.einsum("tji,tkj->tki", turns, cube - clip.poses.positions[:, None])
    return (seen[..., :2] / -seen[..., 2:])[:, edges]


def film(row: int, title: str, clips: tuple[Clip, Clip], strokes_of: Callable[[Clip], np.ndarray], part: slice) -> str:
    """Return an animation of the same part of both clips, side by side, looping after at most `FILM_S` seconds."""
    times = clips[0].times[part] - clips[0].times[part][0]
    shown = np.searchsorted(times, np.arange(0.0, min(times[-1], FILM_S), 1.0 / FILM_RATE_HZ))
    drawn = [strokes_of(clip)[part][shown] for clip in clips]
    points = np.concatenate(drawn).reshape(-1, 2)
    low, high = np.quantile(points, 0.002, axis=0), np.quantile(points, 0.998, axis=0)
    width, height = WIDTH / 6 - 2 * LEFT, FILM_PX - TOP - 30
    size = min(width / (high - low)[0], height / (high - low)[1])
    result = [element("text", title, x=row * WIDTH / 3 + LEFT, y=20)]
    for half, (lines, colour) in enumerate(zip(drawn, (RECORDED, CLEANED), strict=True)):
        middle = np.array(((row + 0.25 + 0.5 * half) * WIDTH / 3, TOP + height / 2))
        pixels = middle + size * (lines - (low + high) / 2) * (1.0, -1.0)
        pictures = [
            "".join(f"M{a[0]:.1f} {a[1]:.1f}L{b[0]:.1f} {b[1]:.1f}" for a, b in picture) for picture in pixels.tolist()
        ]
        moving = element(
            "animate",
            attributeName="d",
            dur=f"{len(pictures) / FILM_RATE_HZ:.3f}s",
            repeatCount="indefinite",
            calcMode="discrete",
            values=";".join(pictures),
        )
        result.append(element("path", moving, d=pictures[0], stroke=colour, stroke_width=3, stroke_linecap="round"))
        name = ("as recorded", "cleaned")[half]
        result.append(element("text", name, x=middle[0], y=FILM_PX - 8, text_anchor="middle", class_="small"))
    return "".join(result)


def main() -> None:
    """Draw all three recordings."""
    hand, camera, body = asset("throw"), asset("reach"), dancer()
    shaky = shaken(hand.poses, 0.006, 0.5, 1)
    for first, off in ((60, 0.2), (180, -0.15)):
        shaky.positions[first : first + 2] += off
    foot = next(name for name in body.whole_body.joints if "foot" in name.lower() or "toe" in name.lower())
    shown = (
        ("A hand: its height", hand, replace(hand, poses=shaky), 0.03, slice(20, 220), {}),
        (
            "A camera: how far it is turned",
            camera,
            replace(camera, poses=shaken(camera.poses, 0.004, 1.0, 2)),
            0.02,
            slice(0, 100),
            {"joint": ""},
        ),
        (
            f"A body: the height of {foot}",
            body,
            replace(body, poses=shaken(body.poses, 0.002, 0.4, 3)),
            0.03,
            slice(0, 120),
            {"joint": foot},
        ),
    )
    strokes = (strokes_of_hand, partial(strokes_of_camera, placed=camera.poses[50:51]), strokes_of_body)
    panels, films = [], []
    for row, (title, truth, recorded, tolerance, part, joint) in enumerate(shown):
        cleaned, found = cleaned_clip(recorded, tolerance)
        said = "; ".join(described(recorded, found))
        panels.append(panel(row, title, truth, recorded, cleaned, said, part, **joint))
        films.append(film(row, title.partition(":")[0], (recorded, cleaned), strokes[row], part))
    about = "As recorded (orange), cleaned (blue), and as it was before noise was put in (grey)"
    write_text(DOCS / "cleaning.svg", drawing(about, STYLE, WIDTH, 3 * HEIGHT + 4, *panels))
    about = "A hand, what a camera sees, and a body: as recorded (orange) and cleaned (blue)"
    write_text(DOCS / "cleaning-film.svg", drawing(about, STYLE, WIDTH, FILM_PX, *films))


if __name__ == "__main__":
    main()
