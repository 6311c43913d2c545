"""Benchmark of modes in Blender: playback, editing, undo and file sizes, with modes and without.

    python scripts/research benchmark_live
    python scripts/research benchmark_live --rounds 10 --scale 0.2

The same work is done alternately with and without modes, in one run on this machine, so a slowdown affects both:
compare the ratios of the fastest. Figures are medians and the fastest, in milliseconds.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import bpy
import numpy as np

from research.studies import interleaved_seconds, publish, study_parser
from rigid_motion import animation
from rigid_motion_batch.scenes.body_scene import registered
from rigid_motion_batch.silencing import silenced

MODE, NATIVE = "dq_sclerp", "BLENDER"
CHAIN_BONES = 10  # bones from root to tip
EDIT_COUNT = 8  # edits of a key in a row, first unmeasured and then measured

Target = TypeVar("Target", bpy.types.Object, bpy.types.PoseBone)
Targets = Sequence[bpy.types.Object | bpy.types.PoseBone]


class Size(NamedTuple):
    """The number of objects or bones, the keys of each on all channels, and the frames from first to last key."""

    count: int
    key_count: int
    frames: int


SIZES = {"objects": Size(100, 10, 1000), "bones": Size(100, 10, 1000), "crowd": Size(400, 10, 1000)}
HELD_SIZE = Size(100, 4, 1000)  # keys: at the start, when picked up, when passed on, and at the end


def scaled(size: Size, scale: float) -> Size:
    """Return a size with a fraction of the objects and frames."""
    count, frames = max(1, round(scale * size.count)), max(2 * size.key_count, round(scale * size.frames))
    return Size(count, size.key_count, frames)


# -- scenes ------------------------------------------------------------------------------------------------------------


def new_object(name: str, data: bpy.types.ID | None = None) -> bpy.types.Object:
    """Return a new object in the scene; an empty if there is no data."""
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def frames_of(size: Size) -> list[int]:
    """Return the frames of keys, evenly spaced over the scene."""
    return np.linspace(1, size.frames, size.key_count).round().astype(int).tolist()


def keyed(targets: Sequence[Target], size: Size, frames: Sequence[int] | None = None) -> list[Target]:
    """Insert keys of random poses, at these frames or evenly spaced over the scene."""
    random = np.random.default_rng(5)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, size.frames
    for target in targets:
        target.rotation_mode = "QUATERNION"
        for frame in frames_of(size) if frames is None else frames:
            for channel in ("location", "rotation_quaternion"):
                setattr(target, channel, random.normal(size=len(getattr(target, channel))))
                target.keyframe_insert(channel, frame=frame)
    bpy.context.view_layer.update()
    return list(targets)


def objects_of(size: Size) -> list[bpy.types.Object]:
    """Return animated empties in a new file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return keyed([new_object(f"Tool {number}") for number in range(size.count)], size)


def bones_of(size: Size) -> list[bpy.types.PoseBone]:
    """Return the bones of an armature in a new file; all bones have keys of location and rotation."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    rig = bpy.context.view_layer.objects.active = new_object("Rig", bpy.data.armatures.new("Rig"))
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(size.count):
        chain, place = divmod(number, CHAIN_BONES)
        bone = rig.data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail = (chain, 0.0, place), (chain, 0.0, place + 1.0)
        bone.parent = rig.data.edit_bones[f"Bone {number - 1}"] if place else None
    bpy.ops.object.mode_set(mode="OBJECT")
    return keyed(list(rig.pose.bones), size)


def switch(targets: Targets, mode: str) -> None:
    """Switch all targets to a mode. For Blender's own, the extension's updates are also disabled, as without it."""
    animation.set_enabled(True)
    animation.set_mode(targets, mode)
    bpy.context.view_layer.update()
    animation.set_enabled(mode != NATIVE)


# -- what is measured --------------------------------------------------------------------------------------------------


def row(what: str, seconds: Sequence[float], native: Sequence[float], count: int = 1) -> dict[str, Any]:
    """Return the figures of a task from its seconds with and without modes; a measurement repeats it `count` times."""
    scale = 1e3 / count
    return {
        "what": what,
        "ms": scale * statistics.median(seconds),
        "fastest_ms": scale * min(seconds),
        "native_ms": scale * statistics.median(native),
        "native_fastest_ms": scale * min(native),
    }


def compared_to_native(
    what: str, targets: Targets, rounds: int, work: Callable[[], None], before: Callable[[], None], count: int = 1
) -> dict[str, Any]:
    """Return the figures of a task that each call repeats `count` times, with modes and without.

    The preparation `before` is not measured, and neither are switches of the mode. All targets end up with the mode.
    """
    runs: dict[str, Callable[[], object]] = {}
    for mode in (NATIVE, MODE):
        runs |= {f"to {mode}": partial(switch, targets, mode), f"before {mode}": before, mode: work}
    seconds = interleaved_seconds(runs, rounds)
    return row(what, seconds[MODE], seconds[NATIVE], count)


def channels(targets: Targets) -> Iterator[bpy.types.FCurve]:
    """Yield the F-curves of the targets' Actions."""
    for carrier in dict.fromkeys(target.id_data for target in targets):
        yield from animation.channelbag_of(carrier).fcurves


def edit(key: bpy.types.Keyframe) -> None:
    """Drag a key, and update the view."""
    key.co_ui.y += 0.01
    bpy.context.view_layer.update()


def edit_again(key: bpy.types.Keyframe) -> None:
    for _ in range(EDIT_COUNT):
        edit(key)


def play(scene: bpy.types.Scene | None = None) -> None:
    """Show all frames of a scene in order; of the open scene by default."""
    scene = scene or bpy.context.scene
    # Blender does more work for the visible scene.
    bpy.context.window.scene = scene
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)


def push() -> None:
    """Push an undo step."""
    bpy.ops.ed.undo_push(message="Edit")


def costs(kind: str, targets: Targets, size: Size, rounds: int) -> list[dict[str, Any]]:
    """Measure playback, an edit of one key, and an undo step."""
    few, middle = max(3, rounds // 4), targets[len(targets) // 2]
    fcurve = animation.channelbag_of(middle.id_data).fcurves.find(middle.path_from_id("location"))
    key, all_of_them = fcurve.keyframe_points[size.key_count // 2], f"{size.count} {kind}"
    again = partial(edit_again, key)
    return [
        compared_to_native(f"{all_of_them} played, a frame", targets, few, play, lambda: None, size.frames),
        compared_to_native(
            f"one key edited of {all_of_them}, and the view updated", targets, rounds, again, again, EDIT_COUNT
        ),
        compared_to_native(f"a step of undo, {all_of_them}", targets, rounds, push, partial(edit, key)),
    ]


def choosing(size: Size, rounds: int) -> dict[str, Any]:
    """Measure setting a mode on all objects, compared with setting a native interpolation on all of their keys."""
    targets = objects_of(size)
    curves = list(channels(targets))

    def interpolate() -> None:
        for fcurve in curves:
            fcurve.keyframe_points.foreach_set("interpolation", np.full(size.key_count, 1, np.int32))
            fcurve.update()
        bpy.context.view_layer.update()

    def choose() -> None:
        animation.set_mode(targets, MODE)
        bpy.context.view_layer.update()

    follow = partial(animation.set_enabled, True)
    runs = {NATIVE: partial(switch, targets, NATIVE), "native": interpolate, "follow": follow, MODE: choose}
    seconds = interleaved_seconds(runs, rounds)
    what = f"a mode (natively an interpolation) given to {size.count} objects, and the view updated"
    return row(what, seconds[MODE], seconds["native"])


def holding(size: Size, rounds: int) -> dict[str, Any]:
    """Measure playback of objects that pass from hand to hand, compared with objects that only have keys."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    begins, picked_up, passed, ends = frames_of(size)
    runs: dict[str, Callable[[], object]] = {}
    for name in (NATIVE, MODE):
        scene = bpy.context.window.scene = bpy.data.scenes.new(name)
        hands = keyed([new_object(f"{name} hand {number}") for number in range(2)], size)
        props = [new_object(f"{name} tool {number}") for number in range(size.count)]
        if name == NATIVE:
            keyed(props, size)
        else:
            keyed(props, size, [begins])
            for frame, hand in ((picked_up, hands[0]), (passed, hands[1])):
                scene.frame_set(frame)
                for prop in props:
                    animation.hold_in(prop, hand)
            keyed(props, size, [ends])
        runs[name] = partial(play, scene)
    seconds = interleaved_seconds(runs, rounds)
    what = f"{size.count} objects in two hands, one after the other, (natively with keys alone) played, a frame"
    return row(what, seconds[MODE], seconds[NATIVE], size.frames)


def files(kind: str, targets: Targets, size: Size) -> dict[str, Any]:
    """Return the size of the open file in MB, compressed and uncompressed, with modes and without."""
    result: dict[str, Any] = {"what": f"{size.count} {kind}"}
    with tempfile.TemporaryDirectory() as folder, silenced():
        path = Path(folder, "scene.blend")
        for prefix, mode in (("native_", NATIVE), ("", MODE)):
            switch(targets, mode)
            for name in ("compressed", "uncompressed"):
                bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=name == "compressed")
                result[f"{prefix}{name}_mb"] = path.stat().st_size / 1e6
    return result


def measure(rounds: int, scale: float) -> dict[str, Any]:
    """Return all figures, for scenes with a fraction `scale` of the objects and frames."""
    sizes = {name: scaled(size, scale) for name, size in SIZES.items()}
    rows, written = [], []
    for kind, scene in (("objects", objects_of), ("bones", bones_of)):
        targets = scene(sizes[kind])
        written.append(files(kind, targets, sizes[kind]))
        rows += costs(kind, targets, sizes[kind], rounds)
    rows += [choosing(sizes["crowd"], max(3, rounds // 8)), holding(scaled(HELD_SIZE, scale), max(3, rounds // 4))]
    return {"sizes": {name: size._asdict() for name, size in sizes.items()}, "rows": rows, "files": written}


def main(arguments: list[str] | None = None) -> int:
    """Measure, print the ratios, and write the figures."""
    parser = study_parser("benchmark_live", __doc__)
    parser.add_argument("--rounds", type=int, default=40, help="rounds of the short measurements (%(default)s)")
    parser.add_argument("--scale", type=float, default=1.0, help="part of all objects and frames (%(default)g)")
    options = parser.parse_args(arguments)
    with registered():
        figures = measure(options.rounds, options.scale)
    for it in figures["rows"]:
        live, native = it["fastest_ms"], it["native_fastest_ms"]
        print(f"{it['what']}: {live:.3f} ms, native {native:.3f} ms, {live / native:.2f} times as long")
    for it in figures["files"]:
        for name in ("compressed", "uncompressed"):
            print(f"file of {it['what']}, {name}: {it[f'{name}_mb']:.2f} MB, native {it[f'native_{name}_mb']:.2f} MB")
    given = ["--rounds", options.rounds, *(["--scale", options.scale] if options.scale != 1.0 else [])]
    return publish("benchmark_live", figures, options, *given, Blender=bpy.app.version_string)
