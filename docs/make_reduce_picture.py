"""Make the animated picture of a GLB file before and after `reduce`: the dancer, and all keys of both files.

python docs/make_reduce_picture.py

prints the size of the file before and after, and writes reduce.svg next to this file. Every browser animates it.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("", "addon", "scripts")]

from examples.dancer import dance
from rigid_motion.gltf import Options, read_document, reduce_file
from rigid_motion.gltf.nodes import Nodes, by_target
from rigid_motion.gltf.tracks import Clip, read_clips
from rigid_motion_batch.files import write_text

TOLERANCE, RADIUS = 0.005, 0.03
"""Metres."""

SECONDS, RATE = 5.0, 15
"""Length of the animation in seconds, and its frames per second."""

WIDTH, FIGURE, STRIP = 420, 300, 110
"""Width of each half, and heights of the dancer and of the keys, in pixels."""

METRE = 150.0
"""Pixels per metre."""

INK, PALE, KEY = "#2b3440", "#8a94a3", "#3b73d1"


def main() -> None:
    """Export, reduce, and draw both."""
    with tempfile.TemporaryDirectory() as folder:
        before, after = Path(folder, "dancer.glb"), Path(folder, "dancer-reduced.glb")
        _export(before)
        report = reduce_file(before, after, Options(TOLERANCE, RADIUS))
        (clip,) = report.clips
        sizes = [f"{when.keys} keys, {when.size / 1000:.0f} kB" for when in (clip.before, clip.after)]
        off = f"{1000 * clip.error:.1f} mm off at most"
        print(f"{sizes[0]} -> {sizes[1]}, {off}")
        halves = [
            _half(before, "As exported", sizes[0], 0),
            _half(after, "reduce --tolerance 5mm", f"{sizes[1]}, {off}", WIDTH),
        ]
    box = f'viewBox="0 0 {2 * WIDTH} {FIGURE + STRIP}" font-family="sans-serif"'
    background = f'<rect width="{2 * WIDTH}" height="{FIGURE + STRIP}" fill="#ffffff"/>'
    picture = f'<svg xmlns="http://www.w3.org/2000/svg" {box}>\n{background}\n{"".join(halves)}</svg>\n'
    write_text(DOCS / "reduce.svg", picture)


def _export(path: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    dance.dancer()
    scene = bpy.context.scene
    scene.render.fps, scene.frame_start, scene.frame_end = dance.FPS, 1, int(dance.FRAMES[-1])
    bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB")


def _half(path: Path, title: str, told: str, left: int) -> str:
    document = read_document(path)
    (clip,), nodes = read_clips(document), Nodes(document)
    texts = "".join(
        f'<text x="{left + WIDTH / 2}" y="{y}" text-anchor="middle" font-size="{size}" fill="{colour}">{text}</text>\n'
        for text, y, size, colour in ((title, 22, 16, INK), (told, FIGURE + STRIP - 8, 14, INK))
    )
    return texts + _figure(nodes, clip, left + WIDTH / 2) + _keys(clip, left)


def _figure(nodes: Nodes, clip: Clip, middle: float) -> str:
    """Return an animation of lines from each joint to its parent, seen from the front."""
    times = np.arange(SECONDS * RATE) / RATE + min(track.times[0] for track in clip.tracks)
    moved = nodes.below(np.unique([track.node for track in clip.tracks]))
    places = nodes.worlds(moved, by_target(clip.tracks), times).origins
    x, y = middle + METRE * places[..., 0], FIGURE - 12 - METRE * places[..., 1]
    rows = {node: row for row, node in enumerate(moved.tolist())}
    bones = [(rows[int(nodes.parents[node])], row) for node, row in rows.items() if int(nodes.parents[node]) in rows]
    poses = ";".join(
        "".join(f"M{x[one, t]:.0f} {y[one, t]:.0f}L{x[other, t]:.0f} {y[other, t]:.0f}" for one, other in bones)
        for t in range(len(times))
    )
    moving = (
        f'<animate attributeName="d" dur="{SECONDS}s" repeatCount="indefinite" calcMode="discrete" values="{poses}"/>'
    )
    line = f'fill="none" stroke="{INK}" stroke-width="5" stroke-linecap="round" d="{poses.partition(";")[0]}"'
    return f"<path {line}>{moving}</path>\n"


def _keys(clip: Clip, left: int) -> str:
    """Return a chart of keys: a row for each channel, a dot for each key, and a moving playhead."""
    first = min(track.times[0] for track in clip.tracks)
    height, across = (STRIP - 40) / len(clip.tracks), WIDTH - 40
    dots = "".join(
        f"M{left + 20 + across * (time - first) / SECONDS:.1f} {FIGURE + 8 + row * height:.1f}h1"
        for row, track in enumerate(clip.tracks)
        for time in track.times
        if time - first < SECONDS
    )
    marks = f'<path stroke="{KEY}" stroke-width="{0.7 * height:.2f}" d="{dots}"/>\n'
    start, end = left + 20, left + 20 + across
    playing = f'<animate attributeName="x" dur="{SECONDS}s" repeatCount="indefinite" values="{start};{end}"/>'
    return (
        marks + f'<rect x="{start}" y="{FIGURE + 4}" width="1" height="{STRIP - 34}" fill="{PALE}">{playing}</rect>\n'
    )


if __name__ == "__main__":
    main()
