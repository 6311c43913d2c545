"""Many objects: a mode for all of them at once, an edit of each, and the file."""

from __future__ import annotations

import statistics
import sys
import tempfile
import textwrap
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

import bpy

from rigid_motion import animation
from rigid_motion_batch.hushing import hushed

from .scenes import MODE, MOTIONS, ROTATION_MODES, NativeBaking, Size, all_frames, scene_of, set_modes
from .turns import TABLE, Seconds, against, in_turns, judged, told

SAMPLE, KEY = 16, 72
"""Bytes of one sample and of one key of an F-curve in a .blend file (`FPoint` and `BezTriple` of Blender's DNA)."""

CHOOSING_GOAL = 0.2
"""Seconds to choose a mode for all objects of the scene of `choosing`."""

EDIT_GOAL = 3
"""How many times as long as Blender's own an update may take after an edit of all objects."""

COMPRESSED_GOAL, PLAIN_GOAL = 6, 4
"""How many times as large a file may be as without modes."""


def choosing(size: Size, rounds: int) -> Iterator[str]:
    """A mode for many objects, beside Blender's baking of the same, as lines of Markdown."""
    for rotation_mode in ROTATION_MODES:
        objects = scene_of(size, rotation_mode)
        seconds = choose(objects, rounds)
        native = NativeBaking(objects, all_frames())
        animation.set_enabled(False)
        seconds |= in_turns(min(3, rounds), bake=native.bake, restore=native.restore)
        animation.set_enabled(True)
        yield f"## A mode for {size}, turned by {rotation_mode}"
        yield ""
        yield from TABLE
        yield from choosing_rows(seconds, goal=CHOOSING_GOAL)
        yield ""


def shots(size: Size, rounds: int) -> Iterator[str]:
    """Shots of every motion and rotation mode, as lines of Markdown."""
    for motion in MOTIONS:
        for rotation_mode in ROTATION_MODES:
            print(f"  {rotation_mode}, {motion} ...", file=sys.stderr, flush=True)
            yield from shot(size, rotation_mode, motion, rounds)


def shot(size: Size, rotation_mode: str, motion: str, rounds: int) -> Iterator[str]:
    """A whole shot: choosing a mode, edits of all objects, and the file, as lines of Markdown."""
    objects = scene_of(size, rotation_mode, MOTIONS[motion])
    plain = file_sizes()
    seconds = choose(objects, rounds)
    live = file_sizes()
    samples = samples_of(objects)
    seconds |= edit_all(objects, rounds)
    native = NativeBaking(objects, all_frames())
    animation.set_enabled(False)
    seconds |= in_turns(1, bake=native.bake)
    baked = file_sizes()
    animation.set_enabled(True)

    yield f"## A shot of {size}, turned by {rotation_mode}, {motion}"
    yield ""
    yield from TABLE
    yield from choosing_rows(seconds)
    ratio = statistics.median(seconds["live"]) / statistics.median(seconds["native"])
    yield (
        f"| the view updated after an edit of each | {told(seconds['live'])} | Blender's own update: "
        f"{told(seconds['native'])} | {ratio:.1f} times as long | {judged(ratio, EDIT_GOAL)} |"
    )
    for kind, goal, with_modes, without, as_keys in zip(
        ("compressed", "not compressed"), (COMPRESSED_GOAL, PLAIN_GOAL), live, plain, baked, strict=True
    ):
        ratio = with_modes / without
        yield (
            f"| the file, {kind} | {with_modes / 1e6:.2f} MB | without modes: {without / 1e6:.2f} MB | "
            f"{ratio:.1f} times as large | {judged(ratio, goal)} |"
        )
        yield (
            f"| the file, {kind} | {with_modes / 1e6:.2f} MB "
            f"| baked by `bake_action_objects`: {as_keys / 1e6:.2f} MB | {with_modes / as_keys:.2f} times as large | |"
        )
    yield ""
    yield from what_is_left(size, samples, live, plain, statistics.median(seconds["live"]))
    yield ""


def choose(objects: list[bpy.types.Object], rounds: int) -> Seconds:
    """A mode chosen for all objects in one call, and the view updated after it. They have it at the end."""
    return in_turns(
        rounds,
        back=partial(set_modes, objects, "BLENDER"),
        choose=partial(animation.set_mode, objects, MODE),
        update=bpy.context.view_layer.update,
    )


def choosing_rows(seconds: Seconds, goal: float | None = None) -> Iterator[str]:
    """A mode chosen, beside `bake` among the seconds."""
    both = [choose + update for choose, update in zip(seconds["choose"], seconds["update"], strict=True)]
    baked = f"`bake_action_objects`: {told(seconds['bake'])}"
    for what, ours, limit in (
        ("`set_mode` for all in one call", seconds["choose"], goal),
        ("the same, and the view updated", both, None),
    ):
        verdict = "" if limit is None else judged(statistics.median(ours), limit, " s")
        yield f"| {what} | {told(ours)} | {baked} | {against(ours, seconds['bake'])} | {verdict} |"


def edit_all(objects: list[bpy.types.Object], rounds: int) -> Seconds:
    """A key of each object edited, then the view updated, which is what is measured: with and without following.

    What was not followed is caught up with outside of the measured time.
    """
    keys = [animation.channelbag_of(obj).fcurves.find("location").keyframe_points for obj in objects]
    edited = [points[len(points) // 2] for points in keys]
    update = bpy.context.view_layer.update
    seconds: Seconds = {"live": [], "native": []}
    for _ in range(rounds):
        for name, enabled in (("live", True), ("native", False)):
            animation.set_enabled(enabled)
            for is_measured in (False, True):
                for key in edited:
                    key.co_ui.y += 0.01
                start = time.perf_counter()
                update()
                if is_measured:
                    seconds[name].append(time.perf_counter() - start)
    animation.set_enabled(True)
    animation.refresh()
    return seconds


def file_sizes() -> tuple[int, int]:
    """Bytes of the open file, compressed and not."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "shot.blend")
        sizes = []
        for is_compressed in (True, False):
            with hushed():
                bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=is_compressed)
            sizes.append(path.stat().st_size)
    return sizes[0], sizes[1]


def samples_of(objects: Sequence[bpy.types.Object]) -> list[int]:
    """How many samples each F-curve has that has any."""
    curves = (fcurve for obj in objects for fcurve in animation.channelbag_of(obj).fcurves)
    return [count for fcurve in curves if (count := len(fcurve.sampled_points))]


def what_is_left(
    size: Size, samples: Sequence[int], live: tuple[int, int], plain: tuple[int, int], refresh: float
) -> list[str]:
    """Why a shot costs what it costs, as lines.

    Parameters
    ----------
    size : Size
    samples : sequence of int
        Of each sampled F-curve.
    live, plain : tuple of int
        Bytes of the file with modes and without, compressed and not.
    refresh : float
        Seconds in which all in-betweens are brought up to date.
    """
    total, poses = sum(samples), size.objects * size.frames
    within = (PLAIN_GOAL * plain[1] - live[1] + SAMPLE * total) / (SAMPLE * poses)
    text = (
        "What is left, and why: samples are written of components that differ, here "
        f"{len(samples) / size.objects:.3g} of each object, and there is one a frame. A sample takes {SAMPLE} bytes in "
        f"Blender's file format: they are {SAMPLE * total / 1e6:.2f} MB of the {live[1] / 1e6:.2f} MB. Compressed, a "
        f"sample takes {(live[0] - plain[0]) / total:.1f} bytes. A native channel is {size.keys} keys of {KEY} bytes, "
        f"and nothing a frame. {PLAIN_GOAL} times the file without modes has room for the samples of {within:.1f} "
        "components of each object. In its own update Blender evaluates the frame that is shown. For in-betweens the "
        "keys of every object are read and compared, and the frames computed and written anew that the edit may have "
        f"changed: {refresh / size.objects * 1e3:.2f} ms an object, most of it Python."
    )
    return textwrap.wrap(text, 120, break_on_hyphens=False)
