"""What live in-betweens cost in Blender, beside its own baking and its own playback, in one run on this machine.

    python scripts/research benchmark_live
    python scripts/research benchmark_live --rounds 10 --scale 0.2

The same work is done in turn with and without rigid motion, so that a machine that slows down slows both. Figures are
medians and the fastest, in milliseconds.
"""

from __future__ import annotations

import statistics
import tempfile
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import bpy
import numpy as np
from bpy_extras import anim_utils

from research.studies import interleaved_seconds, publish, study_parser
from rigid_motion import animation
from rigid_motion_batch.scenes.body_scene import registered
from rigid_motion_batch.silencing import silenced

MODE = "dq_sclerp"  # the mode that is measured: the screw mode
ROTATION_MODES = ("QUATERNION", "XYZ")
CHAIN = 10  # bones from root to tip
WARMING = 8  # edits in a row, unmeasured and then measured

Target = TypeVar("Target", bpy.types.Object, bpy.types.PoseBone)
Targets = Sequence[bpy.types.Object | bpy.types.PoseBone]
Seconds = Sequence[float]


class Size(NamedTuple):
    """Objects or bones, the keys of each on all channels, and the frames from the first key to the last."""

    objects: int
    key_count: int
    frames: int


SIZES = {
    "scene": Size(100, 10, 1000),  # one key of it is edited
    "shot": Size(300, 20, 2000),  # all get a mode, are edited, and saved
    "rig": Size(100, 10, 1000),
}


def scaled(size: Size, scale: float) -> Size:
    """Return a part of the objects and frames."""
    objects, frames = max(1, round(scale * size.objects)), max(2 * size.key_count, round(scale * size.frames))
    return Size(objects, size.key_count, frames)


# -- scenes ------------------------------------------------------------------------------------------------------------


def new_object(name: str, data: bpy.types.ID | None = None) -> bpy.types.Object:
    """Return a new object in the scene, an empty without data."""
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def keyed(targets: Sequence[Target], size: Size, rotation_mode: str) -> list[Target]:
    """Insert keys of poses drawn at random, evenly over the frames of the scene."""
    random = np.random.default_rng(5)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, size.frames
    rotation = "rotation_quaternion" if rotation_mode == "QUATERNION" else "rotation_euler"
    for target in targets:
        target.rotation_mode = rotation_mode
        for frame in np.linspace(1, size.frames, size.key_count).round():
            for channel in ("location", rotation):
                setattr(target, channel, random.normal(size=len(getattr(target, channel))))
                target.keyframe_insert(channel, frame=frame)
    bpy.context.view_layer.update()
    return list(targets)


def scene_of(size: Size, rotation_mode: str) -> list[bpy.types.Object]:
    """Return animated empties in a new file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return keyed([new_object(f"Tool {number}") for number in range(size.objects)], size, rotation_mode)


def rig_of(size: Size) -> list[bpy.types.PoseBone]:
    """Return the bones of an armature in a new file, all of which have keys of location and rotation."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    rig = bpy.context.view_layer.objects.active = new_object("Rig", bpy.data.armatures.new("Rig"))
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(size.objects):
        chain, place = divmod(number, CHAIN)
        bone = rig.data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail = (chain, 0.0, place), (chain, 0.0, place + 1.0)
        bone.parent = rig.data.edit_bones[f"Bone {number - 1}"] if place else None
    bpy.ops.object.mode_set(mode="OBJECT")
    return keyed(list(rig.pose.bones), size, "QUATERNION")


def set_modes(targets: Targets, mode: str) -> None:
    """Choose a mode, and update the view."""
    animation.set_mode(targets, mode)
    bpy.context.view_layer.update()


class NativeBaking:
    """Blender's own baking of objects or bones: what they show, to keys in new Actions. And the way back."""

    def __init__(self, targets: Targets, *, every_channel: bool = False) -> None:
        scene, bones = bpy.context.scene, isinstance(targets[0], bpy.types.PoseBone)
        self.objects, self.frames = list({it.id_data for it in targets}), range(scene.frame_start, scene.frame_end + 1)
        self.played = [(obj.animation_data.action, obj.animation_data.action_slot) for obj in self.objects]
        chosen = {"do_pose": bones, "do_object": not bones}
        chosen |= dict.fromkeys(("do_visual_keying", "do_location", "do_rotation"), True)
        chosen |= dict.fromkeys(("do_scale", "do_bbone", "do_custom_props"), every_channel)
        others = ("only_selected", "do_constraint_clear", "do_parents_clear", "do_clean")
        self.options = anim_utils.BakeOptions(**dict.fromkeys(others, False), **chosen)

    def bake(self) -> None:
        """Bake; following edits has to be off."""
        pairs = [(obj, None) for obj in self.objects]
        anim_utils.bake_action_objects(pairs, frames=self.frames, bake_options=self.options)

    def restore(self) -> None:
        """Have the objects move by what they moved by before, and remove what was baked."""
        for obj, (action, slot) in zip(self.objects, self.played, strict=True):
            baked = obj.animation_data.action
            obj.animation_data.action, obj.animation_data.action_slot = action, slot
            if baked != action:
                bpy.data.actions.remove(baked)
        bpy.context.view_layer.update()

    def seconds(self, rounds: int) -> Seconds:
        """Measure it, while nothing is followed."""
        animation.set_enabled(False)
        seconds = interleaved_seconds({"bake": self.bake, "restore": self.restore}, rounds)["bake"]
        animation.set_enabled(True)
        return seconds


# -- what is measured --------------------------------------------------------------------------------------------------


def row(what: str, live: Seconds, beside: str, native: Seconds) -> dict[str, Any]:
    """Return the figures of one kind of work, from its seconds and those of what is beside."""
    return {
        "what": what,
        "ms": 1e3 * statistics.median(live),
        "fastest_ms": 1e3 * min(live),
        "beside": beside,
        "beside_ms": 1e3 * statistics.median(native),
        "beside_fastest_ms": 1e3 * min(native),
    }


def with_and_without(
    edit: Callable[[], None], rounds: int, edits: int = WARMING, modes_of: Targets = ()
) -> tuple[Seconds, Seconds]:
    """Return the seconds of an edit, as the mean of several in a row, with in-betweens following and not.

    Where targets are given they have no mode for the second, and have one again then. What was not followed is caught
    up with outside of the measured time, and so are the caches that this costs.
    """

    def row_of_edits() -> None:
        for _ in range(edits):
            edit()

    switch = partial(set_modes, modes_of) if modes_of else animation.set_enabled
    states = (MODE, "BLENDER") if modes_of else (True, False)
    runs = {}
    for state in states:
        runs |= {state: partial(switch, state), f"{state}, warm": row_of_edits, f"{state}, measured": row_of_edits}
    seconds = interleaved_seconds(runs, rounds)
    switch(states[0])
    animation.refresh()
    live, native = ([spent / edits for spent in seconds[f"{state}, measured"]] for state in states)
    return live, native


def edit(keys: Sequence[bpy.types.Keyframe]) -> None:
    """Drag keys, and update the view."""
    for key in keys:
        key.co_ui.y += 0.01
    bpy.context.view_layer.update()


def play(targets: Targets, rounds: int) -> tuple[Seconds, Seconds]:
    """Return the seconds of all frames one after the other, with modes and without."""
    scene = bpy.context.scene

    def show_all() -> None:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)

    runs = {}
    for mode in (MODE, "BLENDER"):
        runs |= {f"to {mode}": partial(set_modes, targets, mode), mode: show_all}
    seconds = interleaved_seconds(runs, rounds)
    set_modes(targets, MODE)
    return seconds[MODE], seconds["BLENDER"]


def fill_in(targets: Targets, rounds: int) -> Seconds:
    """Return the seconds of all in-betweens anew, for all that the extension knows."""

    def forget() -> None:
        for action in bpy.data.actions:
            for record in action.rigid_motion.slots:
                record.digest = ""

    def refresh() -> None:
        if animation.refresh() != len(targets):
            raise RuntimeError("not all were filled in")

    return interleaved_seconds({"forget": forget, "refresh": refresh}, rounds)["refresh"]


def choose(targets: Targets, rounds: int) -> tuple[Seconds, Seconds]:
    """Return the seconds of a mode chosen for all in one call; and with the update of the view. They have it then."""
    back, chosen = partial(set_modes, targets, "BLENDER"), partial(animation.set_mode, targets, MODE)
    seconds = interleaved_seconds({"back": back, "choose": chosen, "update": bpy.context.view_layer.update}, rounds)
    return seconds["choose"], np.add(seconds["choose"], seconds["update"]).tolist()


def middle_keys(targets: Targets, number: int) -> list[bpy.types.Keyframe]:
    """Return a key by its number of the first location channel of each."""
    curves = [animation.channelbag_of(it.id_data).fcurves.find(it.path_from_id("location")) for it in targets]
    return [fcurve.keyframe_points[number] for fcurve in curves]


def everyday(size: Size, rotation: str, rounds: int) -> list[dict[str, Any]]:
    """Measure an edit of one key, something else moved, playback, and all in-betweens anew."""
    objects, few = scene_of(size, rotation), max(3, rounds // 10)
    set_modes(objects, MODE)
    edited = with_and_without(partial(edit, middle_keys(objects, 4)[len(objects) // 2 :][:1]), rounds)
    lamp = new_object("Lamp")
    bpy.context.view_layer.update()

    def move() -> None:
        lamp.location.x += 0.01
        bpy.context.view_layer.update()

    moved, played = with_and_without(move, rounds), play(objects, few)
    baking = "`bake_action_objects`, all channels, as *Bake Action* does"
    anew, baked = fill_in(objects, rounds), NativeBaking(objects, every_channel=True).seconds(few)
    return [
        row("one key edited, and the view updated", edited[0], "native", edited[1]),
        row("another object moved", moved[0], "native", moved[1]),
        row("all frames played", played[0], "native", played[1]),
        row("all in-betweens anew", anew, baking, baked),
    ]


def shot(size: Size, rotation: str, rounds: int) -> dict[str, Any]:
    """Measure a mode chosen for all objects, an edit of each, and the file."""
    objects = scene_of(size, rotation)
    files = {"without_mb": file_sizes()}
    (chosen, updated), baking = choose(objects, rounds), NativeBaking(objects)
    baked = baking.seconds(min(3, rounds))
    files["mb"] = file_sizes()
    edited, native = with_and_without(partial(edit, middle_keys(objects, size.key_count // 2)), rounds, 1)
    animation.set_enabled(False)
    baking.bake()
    files["baked_mb"] = file_sizes()
    animation.set_enabled(True)
    rows = [
        row("`set_mode` for all in one call", chosen, "`bake_action_objects`", baked),
        row("the same, and the view updated", updated, "`bake_action_objects`", baked),
        row("the view updated after an edit of each", edited, "Blender's own update", native),
    ]
    sizes = {kind: {name: of_kind[kind] for name, of_kind in files.items()} for kind in files["mb"]}
    return {"rotation": rotation, "rows": rows, **sizes}


def file_sizes() -> dict[str, float]:
    """Return the size of the open file in MB, compressed and not."""
    sizes = {}
    with tempfile.TemporaryDirectory() as folder, silenced():
        path = Path(folder, "shot.blend")
        for kind in ("compressed", "uncompressed"):
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=kind == "compressed")
            sizes[kind] = path.stat().st_size / 1e6
    return sizes


def rigs(size: Size, rounds: int) -> list[dict[str, Any]]:
    """Measure edits as in a window, where large rigs are edited in draft; all anew; and playback."""
    bones, few = rig_of(size), max(5, rounds // 8)
    keys = middle_keys(bones, size.key_count // 2)
    set_modes(bones, MODE)
    animation.follower.set_drafts(True)
    try:
        one, native_one = with_and_without(partial(edit, keys[len(keys) // 2 :][:1]), rounds, modes_of=bones)
        each, _ = with_and_without(partial(edit, keys), few, 1)
        _, chosen = choose(bones, few)
        drafts = {"edit": partial(edit, keys[:1]), "finish": animation.follower.follower.finish_drafts}
        finished = interleaved_seconds(drafts, few)["finish"]
    finally:
        animation.follower.set_drafts(False)
    works = {
        "all in-betweens anew": fill_in(bones, few),
        "a mode chosen for all bones, and the view updated": chosen,
        "a key of each bone edited, and the view updated": each,
        "samples between frames after an edit, for all bones": finished,
    }
    baked = NativeBaking(bones, every_channel=True).seconds(few)
    played, native = play(bones, few)
    return [
        row("one bone edited, and the view updated", one, "native", native_one),
        *(row(what, live, "`bake_action_objects`, as *Bake Action* does", baked) for what, live in works.items()),
        row("all frames played", played, "native", native),
    ]


def measure(rounds: int, scale: float) -> dict[str, Any]:
    """Return all figures, of scenes with a part of their objects and frames."""
    few, sizes = max(3, rounds // 8), {name: scaled(size, scale) for name, size in SIZES.items()}
    return {
        **{name: size._asdict() for name, size in sizes.items()},
        "everyday": {rotation: everyday(sizes["scene"], rotation, rounds) for rotation in ROTATION_MODES},
        "shots": [shot(sizes["shot"], rotation, few) for rotation in ROTATION_MODES],
        "rigs": rigs(sizes["rig"], rounds),
    }


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("benchmark_live", __doc__)
    parser.add_argument("--rounds", type=int, default=40, help="rounds of the short measurements (%(default)s)")
    parser.add_argument("--scale", type=float, default=1.0, help="part of all objects and frames (%(default)g)")
    options = parser.parse_args(arguments)
    with registered():
        figures = measure(options.rounds, options.scale)
    given = ["--rounds", options.rounds, *(["--scale", options.scale] if options.scale != 1.0 else [])]
    return publish("benchmark_live", figures, options, *given, Blender=bpy.app.version_string)
