"""What live in-betweens cost in Blender, beside its own baking and its own playback, in one run on this machine.

    python scripts/benchmark_live.py
    python scripts/benchmark_live.py --objects 20 --rounds 10
    python scripts/benchmark_live.py --output docs/benchmark_live.md

One scene of objects with location and rotation keys, as Blender inserts them, in the screw mode. The same work is done
in turns with and without rigid motion, so that a machine that slows down slows both; figures are medians, and the
fastest. What counts are the ratios.
"""

from __future__ import annotations

import argparse
import atexit
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
from bpy_extras import anim_utils

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from addon import animation
from scripts.publishing import opening, publish

MODE = "dq_sclerp"

WARMING = 8
"""Edits in a row, unmeasured and then measured."""

Seconds = dict[str, list[float]]


def scene_of(objects: int, keys: int, frames: int, rotation_mode: str) -> list[bpy.types.Object]:
    """A new file with animated empties, and one at rest."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, frames
    random = np.random.default_rng(5)
    rotation = "rotation_quaternion" if rotation_mode == "QUATERNION" else "rotation_euler"
    made = []
    for number in range(objects):
        obj = new_empty(f"Tool {number}")
        obj.rotation_mode = rotation_mode
        for frame in np.linspace(1, frames, keys).round():
            obj.location = random.normal(size=3)
            setattr(obj, rotation, random.normal(size=len(getattr(obj, rotation))))
            obj.keyframe_insert("location", frame=frame)
            obj.keyframe_insert(rotation, frame=frame)
        made.append(obj)
    bpy.context.view_layer.update()
    return made


def new_empty(name: str) -> bpy.types.Object:
    obj = bpy.data.objects.new(name, None)
    bpy.context.collection.objects.link(obj)
    return obj


def set_modes(objects: list[bpy.types.Object], mode: str) -> None:
    for obj in objects:
        animation.set_mode(obj, mode)
    bpy.context.view_layer.update()


def in_turns(rounds: int, **contestants: Callable[[], object]) -> Seconds:
    """Seconds of every round of each."""
    seconds: Seconds = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            start = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def refresh_all(objects: list[bpy.types.Object], rounds: int) -> Seconds:
    """All in-betweens anew, beside Blender's baking of the same objects as they are: what they show, to keys."""
    frames = range(bpy.context.scene.frame_start, bpy.context.scene.frame_end + 1)
    played = [(obj.animation_data.action, obj.animation_data.action_slot) for obj in objects]

    def refreshed() -> None:
        if animation.refresh() != len(objects):
            raise RuntimeError("not all objects were filled in")

    def forgotten() -> None:
        for action in bpy.data.actions:
            action.rigid_motion.slots.clear()

    def restored() -> None:
        for obj, (action, slot) in zip(objects, played, strict=True):
            baked = obj.animation_data.action
            obj.animation_data.action, obj.animation_data.action_slot = action, slot
            if baked != action:
                bpy.data.actions.remove(baked)
        bpy.context.view_layer.update()

    def baking(every_channel: bool) -> Callable[[], object]:
        options = anim_utils.BakeOptions(
            only_selected=False,
            do_pose=False,
            do_object=True,
            do_visual_keying=True,
            do_constraint_clear=False,
            do_parents_clear=False,
            do_clean=False,
            do_location=True,
            do_rotation=True,
            do_scale=every_channel,
            do_bbone=every_channel,
            do_custom_props=every_channel,
        )
        return lambda: anim_utils.bake_action_objects(
            [(obj, None) for obj in objects], frames=frames, bake_options=options
        )

    seconds = in_turns(rounds, forget=forgotten, refresh=refreshed)
    animation.set_enabled(False)
    contestants = {"same": baking(False), "restore": restored, "default": baking(True), "restore again": restored}
    seconds |= in_turns(max(3, rounds // 10), **contestants)
    animation.set_enabled(True)
    return seconds


def edit_one(objects: list[bpy.types.Object], rounds: int) -> Seconds:
    """A key dragged, with and without in-betweens following."""
    key = animation.channelbag_of(objects[len(objects) // 2]).fcurves[0].keyframe_points[4]
    update = bpy.context.view_layer.update

    def edited() -> None:
        key.co_ui.y += 0.01
        update()

    return _with_and_without(edited, rounds)


def edit_elsewhere(rounds: int) -> Seconds:
    """Something else moved, with and without in-betweens to look after."""
    other = new_empty("Lamp")
    bpy.context.view_layer.update()
    update = bpy.context.view_layer.update

    def edited() -> None:
        other.location.x += 0.01
        update()

    return _with_and_without(edited, rounds)


def _with_and_without(edited: Callable[[], None], rounds: int) -> Seconds:
    # What was not followed is caught up with outside of the measured time, and so are the caches that this costs.
    seconds: Seconds = {"live": [], "native": []}
    for _ in range(rounds):
        for name, enabled in (("live", True), ("native", False)):
            animation.set_enabled(enabled)
            for _ in range(WARMING):
                edited()
            start = time.perf_counter()
            for _ in range(WARMING):
                edited()
            seconds[name].append((time.perf_counter() - start) / WARMING)
    animation.set_enabled(True)
    animation.refresh()
    return seconds


def play(objects: list[bpy.types.Object], rounds: int) -> Seconds:
    """All frames one after the other, with in-betweens and without."""
    scene = bpy.context.scene

    def played() -> None:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)

    seconds: Seconds = {"live": [], "native": []}
    for _ in range(rounds):
        for name, mode in (("live", MODE), ("native", "BLENDER")):
            set_modes(objects, mode)
            start = time.perf_counter()
            played()
            seconds[name].append(time.perf_counter() - start)
    set_modes(objects, MODE)
    return seconds


def rows(objects: list[bpy.types.Object], rounds: int) -> list[str]:
    """The measurements of one scene as rows of a table."""

    def row(what: str, ours: list[float], peer: str, theirs: list[float], ratio: str) -> str:
        return (
            f"| {what} | {statistics.median(ours) * 1e3:.2f} ({min(ours) * 1e3:.2f}) "
            f"| {peer}: {statistics.median(theirs) * 1e3:.2f} ({min(theirs) * 1e3:.2f}) | {ratio} |"
        )

    set_modes(objects, MODE)
    lines = []
    edit = edit_one(objects, rounds)
    more = statistics.median(edit["live"]) - statistics.median(edit["native"])
    lines.append(
        row("one key edited, and the view updated", edit["live"], "native", edit["native"], f"{more * 1e3:.2f} ms more")
    )
    elsewhere = edit_elsewhere(rounds)
    more = statistics.median(elsewhere["live"]) - statistics.median(elsewhere["native"])
    lines.append(row("another object moved", elsewhere["live"], "native", elsewhere["native"], f"{more * 1e6:+.1f} µs"))
    playback = play(objects, max(3, rounds // 10))
    ratio = statistics.median(playback["live"]) / statistics.median(playback["native"])
    lines.append(row("all frames played", playback["live"], "native", playback["native"], f"{ratio:.2f} times as long"))
    everything = refresh_all(objects, rounds)
    for name, channels in (("same", "location and rotation"), ("default", "all channels, as *Bake Action* does")):
        ratio = statistics.median(everything[name]) / statistics.median(everything["refresh"])
        peer = f"`bake_action_objects`, {channels}"
        lines.append(
            row("all in-betweens anew", everything["refresh"], peer, everything[name], f"{ratio:.1f} times faster")
        )
    return lines


def main(arguments: list[str] | None = None) -> int:
    """Measure, print, and write where asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--objects", type=int, default=100, help="live objects in the scene (%(default)s)")
    parser.add_argument("--keys", type=int, default=10, help="keys of each, on all channels (%(default)s)")
    parser.add_argument("--frames", type=int, default=1000, help="frames from first key to last (%(default)s)")
    parser.add_argument("--rounds", type=int, default=40, help="rounds of the short measurements (%(default)s)")
    parser.add_argument("--output", type=Path, help="a Markdown file to write the tables to")
    options = parser.parse_args(arguments)
    animation.register()
    atexit.register(animation.unregister)
    command = f"python scripts/benchmark_live.py --rounds {options.rounds}"
    lines = opening("Benchmark of live in-betweens", command, __doc__, Blender=bpy.app.version_string)
    for rotation_mode in ("QUATERNION", "XYZ"):
        print(f"{options.objects} objects, {rotation_mode} ...", file=sys.stderr, flush=True)
        objects = scene_of(options.objects, options.keys, options.frames, rotation_mode)
        lines += [
            f"### {options.objects} objects, {options.keys} keys, {options.frames} frames, turned by {rotation_mode}",
            "",
            "| what | Rigid Motion, ms: median (fastest) | beside, ms: median (fastest) | |",
            "|---|---:|---:|---:|",
            *rows(objects, options.rounds),
            "",
        ]
    publish(lines, options.output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
