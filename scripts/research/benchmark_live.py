"""What live in-betweens cost in Blender, beside its own baking and its own playback, in one run on this machine.

    python scripts/research benchmark_live
    python scripts/research benchmark_live --rounds 10 --scale 0.2

The same work is done in turn with and without rigid motion, so that a machine that slows down slows both. Figures are
medians and the fastest, in milliseconds.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from research.live_scenes import (
    MODE,
    MOTIONS,
    ROTATION_MODES,
    NativeBaking,
    Size,
    add_skin,
    general,
    keyed,
    new_empty,
    rig_of,
    scene_of,
    set_modes,
)
from research.publishing import publish, say, study_parser
from rigid_motion import animation
from rigid_motion_batch.silencing import silenced

EVERYDAY, CHOOSING, SHOT = Size(100, 10, 1000), Size(400, 10, 1000), Size(300, 20, 2000)
"""Scenes: one key of it is edited; all get a mode; all are edited, and saved."""

RIG = Size(100, 10, 1000, vertices=20_000)

LONG, LONG_FRAMES = 200, (50_000, 100_000)
"""The keys of an object that is baked, and its frames."""

WARMING = 8
"""Edits in a row, unmeasured and then measured."""

Seconds = dict[str, list[float]]


def row(what: str, ours: Sequence[float], beside: str, theirs: Sequence[float]) -> dict[str, Any]:
    """The figures of one kind of work."""
    return {
        "what": what,
        "ms": 1e3 * statistics.median(ours),
        "fastest_ms": 1e3 * min(ours),
        "beside": beside,
        "beside_ms": 1e3 * statistics.median(theirs),
        "beside_fastest_ms": 1e3 * min(theirs),
    }


def in_turns(rounds: int, **contestants: Callable[[], object]) -> Seconds:
    """Seconds of every round of each."""
    seconds: Seconds = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            start = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def with_and_without(edited: Callable[[], None], rounds: int, edits: int = WARMING) -> Seconds:
    """Seconds of an edit, as the mean of several in a row, with in-betweens following (`live`) and not (`native`).

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


def edit(keys: Sequence[bpy.types.Keyframe]) -> None:
    """Drag keys, and update the view."""
    for key in keys:
        key.co_ui.y += 0.01
    bpy.context.view_layer.update()


def play(targets: Sequence[bpy.types.Object | bpy.types.PoseBone], rounds: int) -> Seconds:
    """All frames one after the other, with modes and without."""
    scene = bpy.context.scene
    seconds: Seconds = {"live": [], "native": []}
    for _ in range(rounds):
        for name, mode in (("live", MODE), ("native", "BLENDER")):
            set_modes(targets, mode)
            start = time.perf_counter()
            for frame in range(scene.frame_start, scene.frame_end + 1):
                scene.frame_set(frame)
            seconds[name].append(time.perf_counter() - start)
    set_modes(targets, MODE)
    return seconds


def bake(native: NativeBaking, rounds: int) -> list[float]:
    """Blender's own baking, while nothing is followed."""
    animation.set_enabled(False)
    seconds = in_turns(rounds, bake=native.bake, restore=native.restore)["bake"]
    animation.set_enabled(True)
    return seconds


def fill_in(targets: Sequence[bpy.types.Object | bpy.types.PoseBone], rounds: int) -> list[float]:
    """All in-betweens anew, for all that the extension knows."""

    def forget() -> None:
        for action in bpy.data.actions:
            for record in action.rigid_motion.slots:
                record.digest = ""

    def refreshed() -> None:
        if animation.refresh() != len(targets):
            raise RuntimeError("not all were filled in")

    return in_turns(rounds, forget=forget, refresh=refreshed)["refresh"]


def everyday(objects: list[bpy.types.Object], rounds: int) -> list[dict[str, Any]]:
    """An edit of one key, something else moved, playback, and all in-betweens anew."""
    few = max(3, rounds // 10)
    set_modes(objects, MODE)
    key = animation.channelbag_of(objects[len(objects) // 2]).fcurves[0].keyframe_points[4]
    edited = with_and_without(partial(edit, [key]), rounds)
    lamp = new_empty("Lamp")
    bpy.context.view_layer.update()

    def move() -> None:
        lamp.location.x += 0.01
        bpy.context.view_layer.update()

    moved, played = with_and_without(move, rounds), play(objects, few)
    rows = [
        row("one key edited, and the view updated", edited["live"], "native", edited["native"]),
        row("another object moved", moved["live"], "native", moved["native"]),
        row("all frames played", played["live"], "native", played["native"]),
    ]
    anew = fill_in(objects, rounds)
    for every, channels in ((False, "location and rotation"), (True, "all channels, as *Bake Action* does")):
        baked = bake(NativeBaking(objects, every_channel=every), few)
        rows.append(row("all in-betweens anew", anew, f"`bake_action_objects`, {channels}", baked))
    return rows


def choose(targets: Sequence[bpy.types.Object | bpy.types.PoseBone], rounds: int) -> tuple[list[float], list[float]]:
    """A mode chosen for all in one call; and with the update of the view. They have it at the end."""
    back, chosen = partial(set_modes, targets, "BLENDER"), partial(animation.set_mode, targets, MODE)
    seconds = in_turns(rounds, back=back, choose=chosen, update=bpy.context.view_layer.update)
    return seconds["choose"], [sum(both) for both in zip(seconds["choose"], seconds["update"], strict=True)]


def choosing(objects: list[bpy.types.Object], rounds: int) -> list[dict[str, Any]]:
    """A mode for many objects, beside Blender's baking of the same."""
    chosen, updated = choose(objects, rounds)
    baked = bake(NativeBaking(objects), min(3, rounds))
    return [
        row("`set_mode` for all in one call", chosen, "`bake_action_objects`", baked),
        row("the same, and the view updated", updated, "`bake_action_objects`", baked),
    ]


def shot(size: Size, rotation_mode: str, motion: str, rounds: int) -> dict[str, Any]:
    """A mode chosen for all objects, an edit of each, and the file."""
    objects = scene_of(size, rotation_mode, MOTIONS[motion])
    without = file_sizes()
    rows = choosing(objects, rounds)
    live = file_sizes()
    sampled = sum(len(f.sampled_points) > 0 for obj in objects for f in animation.channelbag_of(obj).fcurves)
    curves = [animation.channelbag_of(obj).fcurves.find("location").keyframe_points for obj in objects]
    edited = with_and_without(partial(edit, [points[len(points) // 2] for points in curves]), rounds, 1)
    rows.append(row("the view updated after an edit of each", edited["live"], "Blender's own update", edited["native"]))
    animation.set_enabled(False)
    NativeBaking(objects).bake()
    baked = file_sizes()
    animation.set_enabled(True)
    files = {
        kind: {"mb": live[kind] / 1e6, "without_mb": without[kind] / 1e6, "baked_mb": baked[kind] / 1e6}
        for kind in live
    }
    about = {"rotation": rotation_mode, "motion": motion, "components": sampled / len(objects)}
    return {**about, "rows": rows, **files}


def file_sizes() -> dict[str, int]:
    """Bytes of the open file, compressed and not."""
    sizes = {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "shot.blend")
        for kind in ("compressed", "uncompressed"):
            with silenced():
                bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=kind == "compressed")
            sizes[kind] = path.stat().st_size
    return sizes


def rigs(size: Size, rounds: int) -> list[dict[str, Any]]:
    """Bones edited as in a window, where large rigs are edited in draft; all anew; and playback, bare and with a skin.

    `without`: no bone has a mode; `native`: and the extension is switched off; `paused`: modes are not followed.
    """
    rig, few = rig_of(size), max(5, rounds // 8)
    bones = list(rig.pose.bones)
    curves = [animation.channelbag_of(rig).fcurves.find(bone.path_from_id("location")) for bone in bones]
    keys = [fcurve.keyframe_points[size.keys // 2] for fcurve in curves]
    animation.follower.set_drafts(True)
    try:
        without, native = with_and_without(partial(edit, keys[len(keys) // 2 :][:1]), rounds).values()
        set_modes(bones, MODE)
        live, paused = with_and_without(partial(edit, keys[len(keys) // 2 :][:1]), rounds).values()
        each = with_and_without(partial(edit, keys), few, 1)["live"]
        _, chosen = choose(bones, few)
        drafted = partial(edit, keys[:1])
        finished = in_turns(few, edit=drafted, finish=animation.follower.follower.finish_drafts)["finish"]
    finally:
        animation.follower.set_drafts(False)
    anew = fill_in(bones, few)
    baked = bake(NativeBaking([rig], every_channel=True, bones=True), few)
    bare = play(bones, few)
    add_skin(rig, size.vertices)
    skinned = play(list(rig.pose.bones), few)
    baking = "`bake_action_objects`, as *Bake Action* does"
    return [
        row("one bone edited, and the view updated", live, "native, no modes", native),
        row("one bone edited, and the view updated", live, "not followed", paused),
        row("one bone edited of a rig without modes, and the view updated", without, "native", native),
        row("all in-betweens anew", anew, baking, baked),
        row("a mode chosen for all bones, and the view updated", chosen, baking, baked),
        row("a key of each bone edited, and the view updated", each, baking, baked),
        row("samples between frames after an edit, for all bones", finished, baking, baked),
        row("all frames played, bare armature", bare["live"], "native", bare["native"]),
        row(f"all frames played, skin of {size.vertices} vertices", skinned["live"], "native", skinned["native"]),
    ]


def long_bakes(sizes: Sequence[Size], rounds: int) -> list[dict[str, Any]]:
    """Baking an object over many frames."""
    rows, random = [], np.random.default_rng(5)
    for size in sizes:
        scene_of(Size(0, size.keys, size.frames), "QUATERNION")
        obj = keyed(new_empty("Long"), size, "QUATERNION", partial(general, random))
        set_modes([obj], MODE)
        ours = in_turns(rounds, bake=partial(animation.bake, obj), back=partial(animation.unbake, obj))["bake"]
        theirs = bake(NativeBaking([obj]), min(3, rounds))
        rows.append(row(f"{size.frames} frames", ours, "`bake_action_objects`", theirs))
    return rows


def measure(rounds: int, scale: float) -> dict[str, Any]:
    """All figures, of scenes with a part of their objects, frames and vertices."""

    def scaled(size: Size) -> Size:
        parts = [max(least, round(scale * count)) for count, least in ((size.objects, 1), (size.frames, 2 * size.keys))]
        return Size(parts[0], size.keys, parts[1], round(scale * size.vertices))

    few = max(3, rounds // 8)
    scene, many, whole, rig = map(scaled, (EVERYDAY, CHOOSING, SHOT, RIG))
    figures: dict[str, Any] = {"everyday": {}, "choosing": {}, "shots": [], "baking_keys": LONG}
    for name, size in {"scene": scene, "many": many, "shot": whole, "rig": rig}.items():
        figures[name] = {{"keys": "key_count"}.get(key, key): value for key, value in asdict(size).items()}
    for rotation in ROTATION_MODES:
        say(f"everyday work and choosing a mode, {rotation}")
        figures["everyday"][rotation] = everyday(scene_of(scene, rotation), rounds)
        figures["choosing"][rotation] = choosing(scene_of(many, rotation), few)
    for motion in MOTIONS:
        for rotation in ROTATION_MODES:
            say(f"a shot, {rotation}, {motion}")
            figures["shots"].append(shot(whole, rotation, motion, few))
    say("a rig")
    figures["rigs"] = rigs(rig, rounds)
    say("long baking")
    figures["baking"] = long_bakes([Size(1, LONG, max(2 * LONG, round(scale * count))) for count in LONG_FRAMES], few)
    return figures


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("benchmark_live", __doc__)
    parser.add_argument("--rounds", type=int, default=40, help="rounds of the short measurements (%(default)s)")
    parser.add_argument("--scale", type=float, default=1.0, help="part of all objects and frames (%(default)g)")
    options = parser.parse_args(arguments)
    animation.register()
    try:
        figures = measure(options.rounds, options.scale)
    finally:
        animation.unregister()
    given = ["--rounds", options.rounds, *(["--scale", options.scale] if options.scale != 1.0 else [])]
    return publish("benchmark_live", figures, options, *given, Blender=bpy.app.version_string)
