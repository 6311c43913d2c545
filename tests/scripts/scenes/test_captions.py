"""Every caption that a film has, as it is rendered, beside the outlines of its letters filled by Matplotlib."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from matplotlib.path import Path as Outline

from rigid_motion.motion import KEYFRAME_MODES, MODES
from rigid_motion_batch.analysis.modes import BEST_OF, label_of
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.materials import ink
from rigid_motion_batch.scenes.scene import build_stage, make_camera, set_up_render
from rigid_motion_batch.scenes.settings import StageSettings
from tests.scripts.clips.dancers import dancing_clip
from tests.scripts.clips.recordings import reconstruct, swinging_clip
from tests.scripts.scenes.stills import pixels_of, render_still
from tests.scripts.scenes.test_body_scene import RADII, made_of

HEIGHT, WIDTH = 40, 1400
"""Pixels of a line; letters are `SIZE` of that."""

SIZE = 0.6


def sentences() -> list[str]:
    """All that films of a rigid object and of a body say, the names of all modes, and every number."""
    from rigid_motion_batch.scenes.body_scene import build_body_stage

    said = [label_of(mode) for mode in (*MODES, BEST_OF)]
    settings = StageSettings(slow_motion=2.0, deviation=20.0)
    clip = swinging_clip(seconds=0.5)
    build_stage(reconstruct(clip, "5", tuple(KEYFRAME_MODES)), settings)
    said += [curve.body for curve in bpy.data.curves]
    build_body_stage(made_of(dancing_clip()), settings, RADII)
    said += [curve.body for curve in bpy.data.curves]
    lines = [line for text in said for line in text.split("\n")]
    return [*dict.fromkeys(lines), "0123456789.", "ABCDEFGHIJKLMNOPQRSTUVWXYZ", "abcdefghijklmnopqrstuvwxyz"]


def outlines(text: str) -> list[np.ndarray]:
    """The closed outlines of a line of letters of size 1, as the font has them, each of shape (n, 2)."""
    curve = bpy.data.curves.new("Outline", "FONT")
    curve.body, curve.fill_mode, curve.resolution_u = text, "NONE", 4
    obj = bpy.data.objects.new("Outline", curve)
    bpy.context.scene.collection.objects.link(obj)
    mesh = bpy.data.meshes.new_from_object(obj.evaluated_get(bpy.context.evaluated_depsgraph_get()))
    following: dict[int, list[int]] = {}
    for one, other in (edge.vertices for edge in mesh.edges):
        following.setdefault(one, []).append(other)
        following.setdefault(other, []).append(one)
    loops = []
    while following:
        loop = [next(iter(following))]
        while open_ends := [vertex for vertex in following.pop(loop[-1]) if vertex in following]:
            loop.append(open_ends[0])
        loops.append(np.array([mesh.vertices[vertex].co[:2] for vertex in loop]))
    bpy.data.objects.remove(obj)
    return loops


def drawn(text: str) -> np.ndarray:
    """The pixels whose middle is inside of its letters, by filling their outlines: shape (HEIGHT, WIDTH)."""
    x, y = np.meshgrid(np.arange(WIDTH) + 0.5, np.arange(HEIGHT) + 0.5)
    points = np.stack((x.ravel(), y.ravel()), axis=-1) / (HEIGHT * SIZE) - (0.2, 0.35)
    inside = np.zeros(len(points), dtype=bool)
    for loop in outlines(text):
        near = ((points >= loop.min(axis=0)) & (points <= loop.max(axis=0))).all(axis=1)
        inside[near] ^= Outline(np.append(loop, loop[:1], axis=0)).contains_points(points[near])
    return inside.reshape(HEIGHT, WIDTH)


@pytest.fixture(scope="module")
def said() -> list[str]:
    return sentences()


@pytest.mark.parametrize("written", ["words", "choices"])
def test_every_caption_is_rendered_as_its_outlines_are(said: list[str], written: str, tmp_path: Path) -> None:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    white, lines = ink("White", "#FFFFFF"), len(said)
    unit = 1.0 / lines  # The picture is one high.
    group = captions.choice_group("All", said, white)
    frame = bpy.data.objects.new("Frame", None)
    scene.collection.objects.link(frame)
    for line, text in enumerate(said):
        if written == "words":
            obj = captions.words(text, text, SIZE * unit, white)
        else:
            obj = captions.choice(text, group, SIZE * unit, np.array((1.0,)), np.array((float(line),)))
        x, y = 0.2 * SIZE * unit - 0.5 * WIDTH / HEIGHT * unit, (lines - 1 - line + 0.35 * SIZE) * unit - 0.5
        captions.put(obj, frame, scene.collection, x, y)
    make_camera(scene, 1.0, 1.0)
    scene.camera.location, scene.camera.rotation_euler = (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    settings = StageSettings(resolution=(WIDTH, HEIGHT * lines), antialiasing="OFF")
    set_up_render(scene, settings, 1, "#000000")
    render_still(scene, tmp_path / "captions.png", 1)
    found = pixels_of(tmp_path / "captions.png").reshape(lines, HEIGHT, WIDTH, 4)[::-1, ..., 0]
    for text, line in zip(said, found > 0.5, strict=True):
        wanted = drawn(text)
        assert np.count_nonzero(line ^ wanted) < 0.04 * np.count_nonzero(wanted), text
