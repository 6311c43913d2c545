"""Rigs: one bone edited, all bones anew, and playback of the bare armature and of a skin."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

import bpy
import numpy as np

from rigid_motion import animation

from .everyday import WARMING, play, with_and_without
from .scenes import MODE, NativeBaking, Size, all_frames, forget_digests, general, keyed, set_modes
from .shots import choose
from .turns import MILLISECONDS, Seconds, against, beyond, in_turns, judged, told_in_ms

CHAIN = 10
"""Bones from root to tip."""

RING = 20
"""Vertices around a bone."""

EDIT_GOAL = 3
"""Milliseconds that an edit of one bone may take beyond Blender's own update."""

ANEW_GOAL = 50
"""How many times faster than Blender's baking all bones are to be filled in."""

BARE_GOAL, SKINNED_GOAL = 2.0, 1.3
"""How many times as long the playback of an armature may take, and that of one with a skin."""


@dataclass(frozen=True)
class RigSize:
    """Of a rig: its bones in chains, the keys of each, and the frames from the first key to the last."""

    bones: int
    keys: int
    frames: int
    vertices: int
    """Of its skin, where it has one."""

    def __str__(self) -> str:
        return f"{self.bones} bones in chains of {CHAIN}, {self.keys} keys, {self.frames} frames"


def rigs(size: RigSize, rounds: int) -> Iterator[str]:
    """What modes of bones cost, as lines of Markdown."""
    rig = rig_of(size)
    few = max(5, rounds // 8)
    bones = list(rig.pose.bones)
    with as_in_a_window():
        edit = edits(rig, bones[len(bones) // 2 :][:1], rounds, WARMING)
        each = edits(rig, bones, few, 1)
        chosen = choose(bones, few)
        finished = finish(rig, few)
    anew = fill_all(rig, few)
    bare = play(bones, few)
    add_skin(rig, size.vertices)
    skinned = play(list(rig.pose.bones), few)

    yield f"## A rig of {size}, turned by QUATERNION"
    yield ""
    yield "Edits are as in a window, where so large a rig has one sample a frame until more are needed; the others are"
    yield "made before the rig is saved, rendered, or shown between frames. Everything else is with all samples."
    yield ""
    yield from MILLISECONDS
    for what, ours, peer, theirs in (
        ("one bone edited, and the view updated", "live", "native, no modes", "native"),
        ("one bone edited, and the view updated", "live", "not followed", "paused"),
        ("one bone edited of a rig without modes, and the view updated", "without", "native", "native"),
    ):
        more = (statistics.median(edit[ours]) - statistics.median(edit[theirs])) * 1e3
        yield (
            f"| {what} | {told_in_ms(edit[ours])} | {peer}: {told_in_ms(edit[theirs])} "
            f"| {beyond(edit[ours], edit[theirs])} | {judged(more, EDIT_GOAL, ' ms')} |"
        )
    peer = f"`bake_action_objects`, as *Bake Action* does: {told_in_ms(anew['bake'])}"
    updated = [choose + update for choose, update in zip(chosen["choose"], chosen["update"], strict=True)]
    for what, ours, goal in (
        ("all in-betweens anew", anew["refresh"], ANEW_GOAL),
        ("a mode chosen for all bones, and the view updated", updated, None),
        ("a key of each bone edited, and the view updated", each["live"], None),
        ("samples between frames after an edit, for all bones", finished, None),
    ):
        ratio = statistics.median(anew["bake"]) / statistics.median(ours)
        verdict = "" if goal is None else judged(ratio, goal, at_least=True)
        yield f"| {what} | {told_in_ms(ours)} | {peer} | {against(ours, anew['bake'])} | {verdict} |"
    for what, seconds, goal in (
        ("all frames played, bare armature", bare, BARE_GOAL),
        (f"all frames played, skin of {size.vertices} vertices", skinned, SKINNED_GOAL),
    ):
        ratio = statistics.median(seconds["live"]) / statistics.median(seconds["native"])
        yield (
            f"| {what} | {told_in_ms(seconds['live'])} | native: {told_in_ms(seconds['native'])} "
            f"| {ratio:.2f} times as long | {judged(ratio, goal)} |"
        )
    yield ""


def rig_of(size: RigSize) -> bpy.types.Object:
    """A new file with an armature whose bones all have keys of location and rotation."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, size.frames
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    scene.collection.objects.link(rig)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    for number in range(size.bones):
        chain, place = divmod(number, CHAIN)
        bone = rig.data.edit_bones.new(f"Bone {number}")
        bone.head, bone.tail = (chain, 0.0, place), (chain, 0.0, place + 1.0)
        bone.parent = rig.data.edit_bones[f"Bone {number - 1}"] if place else None
    bpy.ops.object.mode_set(mode="OBJECT")
    random = np.random.default_rng(5)
    for bone in rig.pose.bones:
        keyed(bone, Size(1, size.keys, size.frames), "QUATERNION", partial(general, random))
    bpy.context.view_layer.update()
    return rig


def add_skin(rig: bpy.types.Object, count: int) -> bpy.types.Object:
    """A mesh of about so many vertices that the bones deform, two for each vertex: tubes along the chains."""
    bones = rig.data.bones
    rings = max(2, round(count / (RING * math.ceil(len(bones) / CHAIN))))
    mesh = bpy.data.meshes.new("Skin")
    skin = bpy.data.objects.new("Skin", mesh)
    weights: dict[str, list[tuple[int, float]]] = {bone.name: [] for bone in bones}
    points, faces = [], []
    for root in (bone for bone in bones if bone.parent is None):
        chain = [root, *root.children_recursive]
        first = len(points)
        for ring, along in enumerate(np.linspace(0.0, len(chain), rings)):
            # From the middle of a bone to the middle of the next, the one hands over to the other.
            behind = min(max(along - 0.5, 0.0), len(chain) - 1.0)
            lower = min(int(behind), len(chain) - 2) if len(chain) > 1 else 0
            for turn in range(RING):
                angle = 2.0 * math.pi * turn / RING
                number = len(points)
                points.append(
                    (root.head_local.x + 0.3 * math.cos(angle), 0.3 * math.sin(angle), root.head_local.z + along)
                )
                weights[chain[lower].name].append((number, 1.0 - (behind - lower)))
                if len(chain) > 1:
                    weights[chain[lower + 1].name].append((number, behind - lower))
                if ring:
                    beside = first + RING * ring + (turn + 1) % RING
                    faces.append((number - RING, number, beside, beside - RING))
    mesh.from_pydata(points, [], faces)
    for name, weighted in weights.items():
        group = skin.vertex_groups.new(name=name)
        for number, weight in weighted:
            group.add([number], weight, "REPLACE")
    skin.modifiers.new("Armature", "ARMATURE").object = rig
    bpy.context.scene.collection.objects.link(skin)
    bpy.context.view_layer.update()
    return skin


def edits(rig: bpy.types.Object, bones: Sequence[bpy.types.PoseBone], rounds: int, repeats: int) -> Seconds:
    """A key of each of these bones dragged, where bones have modes and where none has.

    `live`, in-betweens follow; `paused`, they do not, but are evaluated; `without`, no bone has a mode; `native`, and
    the extension is switched off.
    """
    seconds: Seconds = {}
    for names, mode in ((("without", "native"), "BLENDER"), (("live", "paused"), MODE)):
        set_modes(list(rig.pose.bones), mode)
        edited = with_and_without(partial(_edit_and_update, _middle_keys(rig, bones)), rounds, repeats)
        seconds |= zip(names, (edited["live"], edited["native"]), strict=True)
    return seconds


def _middle_keys(rig: bpy.types.Object, bones: Sequence[bpy.types.PoseBone]) -> list[bpy.types.Keyframe]:
    fcurves = animation.channelbag_of(rig).fcurves
    keys = [fcurves.find(bone.path_from_id("location")).keyframe_points for bone in bones]
    return [points[len(points) // 2] for points in keys]


def _edit_and_update(keys: Sequence[bpy.types.Keyframe]) -> None:
    for key in keys:
        key.co_ui.y += 0.01
    bpy.context.view_layer.update()


@contextmanager
def as_in_a_window() -> Iterator[None]:
    """Have large rigs be edited in draft, as they are where Blender has a window."""
    animation.follower.set_drafts(True)
    try:
        yield
    finally:
        animation.follower.set_drafts(False)


def finish(rig: bpy.types.Object, rounds: int) -> list[float]:
    """Seconds to make a rig that was edited exact between frames."""
    bones = list(rig.pose.bones)
    set_modes(bones, MODE)
    contestants: dict[str, Callable[[], object]] = {
        "edit": partial(_edit_and_update, _middle_keys(rig, bones[:1])),
        "finish": animation.follower.follower.finish_drafts,
    }
    return in_turns(rounds, **contestants)["finish"]


def fill_all(rig: bpy.types.Object, rounds: int) -> Seconds:
    """All bones anew, beside Blender's baking of them as they are: what they show, to keys."""
    bones = list(rig.pose.bones)

    def refreshed() -> None:
        if animation.refresh() != len(bones):
            raise RuntimeError("not all bones were filled in")

    native = NativeBaking([rig], all_frames(), every_channel=True, of_bones=True)
    contestants: dict[str, Callable[[], object]] = {
        "forget": forget_digests,
        "refresh": refreshed,
        "off": partial(animation.set_enabled, False),
        "bake": native.bake,
        "restore": native.restore,
        "on": partial(animation.set_enabled, True),
    }
    return in_turns(rounds, **contestants)
