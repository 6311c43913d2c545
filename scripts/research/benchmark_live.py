"""What live in-betweens cost in Blender, beside its own baking and its own playback, in one run on this machine.

    python scripts/research benchmark_live
    python scripts/research benchmark_live --rounds 10 --scale 0.2

The same work is done in turn with and without rigid motion, so that a machine that slows down slows both. Figures are
medians and the fastest, in milliseconds.
"""

from __future__ import annotations

import math
import statistics
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any, TypeVar

import bpy
import numpy as np
from bpy_extras import anim_utils

from research.studies import publish, report, seconds_in_turns, study_parser
from rigid_motion import animation
from rigid_motion_batch.scenes.body_scene import registered
from rigid_motion_batch.silencing import silenced

MODE = "dq_sclerp"  # the mode that is measured: the screw mode
ROTATION_MODES = ("QUATERNION", "XYZ")
CHAIN, RING = 10, 20  # bones from root to tip, and vertices of the skin around a bone
WARMING = 8  # edits in a row, unmeasured and then measured

Target = TypeVar("Target", bpy.types.Object, bpy.types.PoseBone)
Targets = Sequence[bpy.types.Object | bpy.types.PoseBone]
Motion = Callable[[np.random.Generator, int], tuple[np.ndarray, np.ndarray]]
"""A location, and a rotation as a quaternion or Euler angles by its width."""


@dataclass(frozen=True)
class Size:
    """Objects or bones, the keys of each on all channels, the frames from the first key to the last, and the skin."""

    objects: int
    keys: int
    frames: int
    vertices: int = 0

    def scaled(self, scale: float) -> Size:
        """Return a part of its objects, frames and vertices."""
        objects, frames, vertices = (round(scale * count) for count in (self.objects, self.frames, self.vertices))
        return Size(max(1, objects), self.keys, max(2 * self.keys, frames), vertices)

    @property
    def figures(self) -> dict[str, int]:
        return {"objects": self.objects, "key_count": self.keys, "frames": self.frames, "vertices": self.vertices}


SIZES = {
    "scene": Size(100, 10, 1000),  # one key of it is edited
    "shot": Size(300, 20, 2000),  # all get a mode, are edited, and saved
    "rig": Size(100, 10, 1000, vertices=20_000),
}
LONG, LONG_FRAMES = 200, (50_000, 100_000)  # the keys of an object that is baked, and its frames


# -- scenes ------------------------------------------------------------------------------------------------------------


def general(random: np.random.Generator, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose that is turned about any axis."""
    return random.normal(size=3), random.normal(size=width)


def planar(random: np.random.Generator, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a pose in the plane of x and y, turned about z."""
    x, y, angle = random.normal(size=3)
    turned = (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)) if width == 4 else (0.0, 0.0, angle)
    return np.array((x, y, 0.0)), np.array(turned)


MOTIONS: dict[str, Motion] = {"about general axes": general, "in a plane": planar}


def new_scene(frames: int) -> np.random.Generator:
    """Open a new file with so many frames; return what its poses are drawn from."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, frames
    return np.random.default_rng(5)


def new_object(name: str, data: bpy.types.ID | None = None) -> bpy.types.Object:
    """Return a new object in the scene, an empty without data."""
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def keyed(target: Target, size: Size, rotation_mode: str, motion: Motion, random: np.random.Generator) -> Target:
    """Insert keys of poses drawn at random, evenly over the frames."""
    rotation = "rotation_quaternion" if rotation_mode == "QUATERNION" else "rotation_euler"
    target.rotation_mode = rotation_mode
    for frame in np.linspace(1, size.frames, size.keys).round():
        target.location, turned = motion(random, len(getattr(target, rotation)))
        setattr(target, rotation, turned)
        target.keyframe_insert("location", frame=frame)
        target.keyframe_insert(rotation, frame=frame)
    return target


def scene_of(size: Size, rotation_mode: str, motion: Motion = general) -> list[bpy.types.Object]:
    """Return animated empties in a new file."""
    random = new_scene(size.frames)
    objects = [keyed(new_object(f"Tool {i}"), size, rotation_mode, motion, random) for i in range(size.objects)]
    bpy.context.view_layer.update()
    return objects


def rig_of(size: Size) -> bpy.types.Object:
    """Return an armature in a new file whose bones all have keys of location and rotation."""
    random = new_scene(size.frames)
    rig = new_object("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(size.objects):
        chain, place = divmod(number, CHAIN)
        bone = rig.data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail = (chain, 0.0, place), (chain, 0.0, place + 1.0)
        bone.parent = rig.data.edit_bones[f"Bone {number - 1}"] if place else None
    bpy.ops.object.mode_set(mode="OBJECT")
    for bone in rig.pose.bones:
        keyed(bone, size, "QUATERNION", general, random)
    bpy.context.view_layer.update()
    return rig


def add_skin(rig: bpy.types.Object, count: int) -> bpy.types.Object:
    """Add a mesh of about so many vertices that the bones deform, two for each vertex: a tube along each chain."""
    bones = rig.data.bones
    rings = max(2, round(count / (RING * math.ceil(len(bones) / CHAIN))))
    turns = 2.0 * np.pi * np.arange(RING) / RING
    skin = new_object("Skin", bpy.data.meshes.new("Skin"))
    groups = [skin.vertex_groups.new(name=bone.name) for bone in bones]
    points, faces, weights = [], [], []
    for first in range(0, len(bones), CHAIN):
        length = min(CHAIN, len(bones) - first)
        for along in np.linspace(0.0, length, rings):
            # From the middle of a bone to the middle of the next, the one hands over to the other.
            behind = min(max(along - 0.5, 0.0), length - 1.0)
            lower = min(int(behind), max(length - 2, 0))
            ring = list(range(len(points), len(points) + RING))
            weights += [(first + lower, ring, 1.0 - behind + lower), (first + lower + 1, ring, behind - lower)]
            if along:
                faces += [(a - RING, a, b, b - RING) for a, b in pairwise([*ring, ring[0]])]
            points += [(first // CHAIN + 0.3 * np.cos(turn), 0.3 * np.sin(turn), along) for turn in turns]
    skin.data.from_pydata(points, [], faces)
    for bone, ring, weight in weights:
        if bone < len(groups):
            groups[bone].add(ring, weight, "REPLACE")
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.view_layer.update()
    return skin


def set_modes(targets: Targets, mode: str) -> None:
    """Choose a mode, and update the view."""
    animation.set_mode(targets, mode)
    bpy.context.view_layer.update()


class NativeBaking:
    """Blender's own baking of objects, or of their bones: what they show, to keys in new Actions. And the way back."""

    def __init__(
        self, objects: Sequence[bpy.types.Object], *, every_channel: bool = False, bones: bool = False
    ) -> None:
        scene = bpy.context.scene
        self.objects, self.frames = objects, range(scene.frame_start, scene.frame_end + 1)
        self.played = [(obj.animation_data.action, obj.animation_data.action_slot) for obj in objects]
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

    def seconds(self, rounds: int) -> list[float]:
        """Measure it, while nothing is followed."""
        animation.set_enabled(False)
        seconds = seconds_in_turns({"bake": self.bake, "restore": self.restore}, rounds)["bake"]
        animation.set_enabled(True)
        return seconds


# -- what is measured --------------------------------------------------------------------------------------------------


def row(what: str, live: Sequence[float], beside: str, native: Sequence[float]) -> dict[str, Any]:
    """Return the figures of one kind of work, from its seconds and those of what is beside."""
    return {
        "what": what,
        "ms": 1e3 * statistics.median(live),
        "fastest_ms": 1e3 * min(live),
        "beside": beside,
        "beside_ms": 1e3 * statistics.median(native),
        "beside_fastest_ms": 1e3 * min(native),
    }


def with_and_without(edit: Callable[[], None], rounds: int, edits: int = WARMING) -> tuple[list[float], list[float]]:
    """Return the seconds of an edit, as the mean of several in a row, with in-betweens following and not.

    What was not followed is caught up with outside of the measured time, and so are the caches that this costs.
    """

    def row_of_edits() -> None:
        for _ in range(edits):
            edit()

    switches = {"on": partial(animation.set_enabled, True), "off": partial(animation.set_enabled, False)}
    runs = {}
    for name, switch in switches.items():
        runs |= {name: switch, f"{name}, warm": row_of_edits, f"{name}, measured": row_of_edits}
    seconds = seconds_in_turns(runs, rounds)
    animation.set_enabled(True)
    animation.refresh()
    live, native = ([spent / edits for spent in seconds[f"{name}, measured"]] for name in switches)
    return live, native


def edit(keys: Sequence[bpy.types.Keyframe]) -> None:
    """Drag keys, and update the view."""
    for key in keys:
        key.co_ui.y += 0.01
    bpy.context.view_layer.update()


def play(targets: Targets, rounds: int) -> tuple[list[float], list[float]]:
    """Return the seconds of all frames one after the other, with modes and without."""
    scene = bpy.context.scene

    def show_all() -> None:
        for frame in range(scene.frame_start, scene.frame_end + 1):
            scene.frame_set(frame)

    runs = {}
    for mode in (MODE, "BLENDER"):
        runs |= {f"to {mode}": partial(set_modes, targets, mode), mode: show_all}
    seconds = seconds_in_turns(runs, rounds)
    set_modes(targets, MODE)
    return seconds[MODE], seconds["BLENDER"]


def fill_in(targets: Targets, rounds: int) -> list[float]:
    """Return the seconds of all in-betweens anew, for all that the extension knows."""

    def forget() -> None:
        for action in bpy.data.actions:
            for record in action.rigid_motion.slots:
                record.digest = ""

    def refresh() -> None:
        if animation.refresh() != len(targets):
            raise RuntimeError("not all were filled in")

    return seconds_in_turns({"forget": forget, "refresh": refresh}, rounds)["refresh"]


def choose(targets: Targets, rounds: int) -> tuple[list[float], list[float]]:
    """Return the seconds of a mode chosen for all in one call; and with the update of the view. They have it then."""
    back, chosen = partial(set_modes, targets, "BLENDER"), partial(animation.set_mode, targets, MODE)
    seconds = seconds_in_turns({"back": back, "choose": chosen, "update": bpy.context.view_layer.update}, rounds)
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

    works = {
        "one key edited, and the view updated": edited,
        "another object moved": with_and_without(move, rounds),
        "all frames played": play(objects, few),
    }
    rows = [row(what, live, "native", native) for what, (live, native) in works.items()]
    anew = fill_in(objects, rounds)
    for every, channels in ((False, "location and rotation"), (True, "all channels, as *Bake Action* does")):
        baked = NativeBaking(objects, every_channel=every).seconds(few)
        rows.append(row("all in-betweens anew", anew, f"`bake_action_objects`, {channels}", baked))
    return rows


def shot(size: Size, rotation: str, motion: str, rounds: int) -> dict[str, Any]:
    """Measure a mode chosen for all objects, an edit of each, and the file."""
    objects = scene_of(size, rotation, MOTIONS[motion])
    without = file_sizes()
    (chosen, updated), baking = choose(objects, rounds), NativeBaking(objects).seconds(min(3, rounds))
    live = file_sizes()
    sampled = sum(len(f.sampled_points) > 0 for obj in objects for f in animation.channelbag_of(obj).fcurves)
    edited, native = with_and_without(partial(edit, middle_keys(objects, size.keys // 2)), rounds, 1)
    rows = [
        row("`set_mode` for all in one call", chosen, "`bake_action_objects`", baking),
        row("the same, and the view updated", updated, "`bake_action_objects`", baking),
        row("the view updated after an edit of each", edited, "Blender's own update", native),
    ]
    animation.set_enabled(False)
    NativeBaking(objects).bake()
    baked = file_sizes()
    animation.set_enabled(True)
    files = {
        kind: {"mb": live[kind] / 1e6, "without_mb": without[kind] / 1e6, "baked_mb": baked[kind] / 1e6}
        for kind in live
    }
    return {"rotation": rotation, "motion": motion, "components": sampled / len(objects), "rows": rows, **files}


def file_sizes() -> dict[str, int]:
    """Return the bytes of the open file, compressed and not."""
    sizes = {}
    with tempfile.TemporaryDirectory() as folder, silenced():
        path = Path(folder, "shot.blend")
        for kind in ("compressed", "uncompressed"):
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, compress=kind == "compressed")
            sizes[kind] = path.stat().st_size
    return sizes


def rigs(size: Size, rounds: int) -> list[dict[str, Any]]:
    """Measure edits as in a window, where large rigs are edited in draft; all anew; and playback, bare and with a skin.

    `without`: no bone has a mode; `native`: and the extension is switched off; `paused`: modes are not followed.
    """
    rig, few = rig_of(size), max(5, rounds // 8)
    bones = list(rig.pose.bones)
    keys = middle_keys(bones, size.keys // 2)
    edit_one = partial(edit, keys[len(keys) // 2 :][:1])
    animation.follower.set_drafts(True)
    try:
        without, native = with_and_without(edit_one, rounds)
        set_modes(bones, MODE)
        live, paused = with_and_without(edit_one, rounds)
        each, _ = with_and_without(partial(edit, keys), few, 1)
        _, chosen = choose(bones, few)
        drafts = {"edit": partial(edit, keys[:1]), "finish": animation.follower.follower.finish_drafts}
        finished = seconds_in_turns(drafts, few)["finish"]
    finally:
        animation.follower.set_drafts(False)
    anew = fill_in(bones, few)
    baked = NativeBaking([rig], every_channel=True, bones=True).seconds(few)
    bare, bare_native = play(bones, few)
    add_skin(rig, size.vertices)
    skinned, skinned_native = play(list(rig.pose.bones), few)
    baking = "`bake_action_objects`, as *Bake Action* does"
    return [
        row("one bone edited, and the view updated", live, "native, no modes", native),
        row("one bone edited, and the view updated", live, "not followed", paused),
        row("one bone edited of a rig without modes, and the view updated", without, "native", native),
        row("all in-betweens anew", anew, baking, baked),
        row("a mode chosen for all bones, and the view updated", chosen, baking, baked),
        row("a key of each bone edited, and the view updated", each, baking, baked),
        row("samples between frames after an edit, for all bones", finished, baking, baked),
        row("all frames played, bare armature", bare, "native", bare_native),
        row(f"all frames played, skin of {size.vertices} vertices", skinned, "native", skinned_native),
    ]


def long_baking(size: Size, rounds: int) -> dict[str, Any]:
    """Measure baking an object over many frames."""
    (obj,) = scene_of(size, "QUATERNION")
    set_modes([obj], MODE)
    runs = {"bake": partial(animation.bake, obj), "back": partial(animation.unbake, obj)}
    seconds = seconds_in_turns(runs, rounds)["bake"]
    return row(f"{size.frames} frames", seconds, "`bake_action_objects`", NativeBaking([obj]).seconds(min(3, rounds)))


def measure(rounds: int, scale: float) -> dict[str, Any]:
    """Return all figures, of scenes with a part of their objects, frames and vertices."""
    few, sizes = max(3, rounds // 8), {name: size.scaled(scale) for name, size in SIZES.items()}
    figures: dict[str, Any] = {"everyday": {}, "shots": [], "baking_keys": LONG}
    figures |= {name: size.figures for name, size in sizes.items()}
    for rotation in ROTATION_MODES:
        report(f"everyday work, {rotation}")
        figures["everyday"][rotation] = everyday(sizes["scene"], rotation, rounds)
    for motion in MOTIONS:
        for rotation in ROTATION_MODES:
            report(f"a shot, {rotation}, {motion}")
            figures["shots"].append(shot(sizes["shot"], rotation, motion, few))
    report("a rig")
    figures["rigs"] = rigs(sizes["rig"], rounds)
    report("long baking")
    figures["baking"] = [long_baking(Size(1, LONG, frames).scaled(scale), few) for frames in LONG_FRAMES]
    return figures


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
