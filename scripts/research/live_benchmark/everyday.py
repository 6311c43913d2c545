"""Everyday work: a key dragged, another object moved, playback, and all in-betweens anew."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator, Sequence

import bpy

from rigid_motion import animation

from .scenes import MODE, ROTATION_MODES, NativeBaking, Size, all_frames, forget_digests, new_empty, scene_of, set_modes
from .turns import Seconds, against, beyond, in_turns, told_in_ms

WARMING = 8
"""Edits in a row, unmeasured and then measured."""


def everyday(size: Size, rounds: int) -> Iterator[str]:
    """What everyday edits and playback cost, as lines of Markdown."""
    for rotation_mode in ROTATION_MODES:
        yield f"## {size}, turned by {rotation_mode}"
        yield ""
        yield "| what | Rigid Motion, ms: median (fastest) | beside, ms: median (fastest) | |"
        yield "|---|---:|---:|---:|"
        yield from rows(scene_of(size, rotation_mode), rounds)
        yield ""


def rows(objects: list[bpy.types.Object], rounds: int) -> list[str]:
    """The measurements of one scene as rows of a table."""

    def row(what: str, ours: list[float], peer: str, theirs: list[float], ratio: str) -> str:
        return f"| {what} | {told_in_ms(ours)} | {peer}: {told_in_ms(theirs)} | {ratio} |"

    set_modes(objects, MODE)
    lines = []
    edit = edit_one(objects, rounds)
    live, native = edit["live"], edit["native"]
    lines.append(row("one key edited, and the view updated", live, "native", native, beyond(live, native)))
    elsewhere = edit_elsewhere(rounds)
    live, native = elsewhere["live"], elsewhere["native"]
    lines.append(row("another object moved", live, "native", native, beyond(live, native, "µs", 1)))
    playback = play(objects, max(3, rounds // 10))
    ratio = statistics.median(playback["live"]) / statistics.median(playback["native"])
    lines.append(row("all frames played", playback["live"], "native", playback["native"], f"{ratio:.2f} times as long"))
    everything = refresh_all(objects, rounds)
    for name, channels in (("same", "location and rotation"), ("default", "all channels, as *Bake Action* does")):
        ours, theirs = everything["refresh"], everything[name]
        peer = f"`bake_action_objects`, {channels}"
        lines.append(row("all in-betweens anew", ours, peer, theirs, against(ours, theirs)))
    return lines


def refresh_all(objects: list[bpy.types.Object], rounds: int) -> Seconds:
    """All in-betweens anew, beside Blender's baking of the same objects as they are: what they show, to keys."""

    def refreshed() -> None:
        if animation.refresh() != len(objects):
            raise RuntimeError("not all objects were filled in")

    seconds = in_turns(rounds, forget=forget_digests, refresh=refreshed)
    same, default = (NativeBaking(objects, all_frames(), every_channel=every) for every in (False, True))
    contestants = {"same": same.bake, "restore": same.restore, "default": default.bake, "again": default.restore}
    animation.set_enabled(False)
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

    return with_and_without(edited, rounds)


def edit_elsewhere(rounds: int) -> Seconds:
    """Something else moved, with and without in-betweens to look after."""
    other = new_empty("Lamp")
    bpy.context.view_layer.update()
    update = bpy.context.view_layer.update

    def edited() -> None:
        other.location.x += 0.01
        update()

    return with_and_without(edited, rounds)


def with_and_without(edited: Callable[[], None], rounds: int, edits: int = WARMING) -> Seconds:
    """Seconds of an edit, as the mean of several in a row, with and without in-betweens following.

    What was not followed is caught up with outside of the measured time, and so are the caches that this costs.
    """
    seconds: Seconds = {"live": [], "native": []}
    for _ in range(rounds):
        for name, enabled in (("live", True), ("native", False)):
            animation.set_enabled(enabled)
            for _ in range(edits):
                edited()
            start = time.perf_counter()
            for _ in range(edits):
                edited()
            seconds[name].append((time.perf_counter() - start) / edits)
    animation.set_enabled(True)
    animation.refresh()
    return seconds


def play(targets: Sequence[bpy.types.Object | bpy.types.PoseBone], rounds: int) -> Seconds:
    """All frames one after the other, with in-betweens and without."""
    scene = bpy.context.scene

    def played() -> None:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)

    seconds: Seconds = {"live": [], "native": []}
    for _ in range(rounds):
        for name, mode in (("live", MODE), ("native", "BLENDER")):
            set_modes(targets, mode)
            start = time.perf_counter()
            played()
            seconds[name].append(time.perf_counter() - start)
    set_modes(targets, MODE)
    return seconds
