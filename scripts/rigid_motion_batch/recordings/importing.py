"""Bodies of files that Blender's importers read, in a scene of their own that is removed afterwards.

The open file stays unchanged. Times begin with 0 on the first key; axes and units are those that the importer produces.
A stranger's file is data: importers are written in Python, fail in any possible way, and may crash.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, cast

import numpy as np

from rigid_motion_batch.command_line import listed
from rigid_motion_batch.silencing import silenced

from .key_moments import BONE_CHANNEL, curves_that_move, fcurves_of, keys_of, moments_of, with_parents
from .looks import refuse_far_frames, single_motions
from .recordings import Selection, Trajectory, TrajectoryError
from .rigs import armature_of, body_of_objects, in_blender, joints_of, likely_unit, whole_body
from .sampling import JUMP_STEPS, OF_JOINTS, OF_OBJECTS, Moments, moments_between, rate_of
from .scene_bodies import MAX_LISTED_NAMES, SceneBodies, parents_among

if TYPE_CHECKING:
    import bpy

NUMBERED = re.compile(r"(?P<name>.+)\.\d{3,}", re.DOTALL)
"""A name that Blender has numbered because it was taken."""

LONGEST_REASON = 120
"""Characters quoted of an importer's error message."""


def read_imported(
    path: Path, selection: Selection, importer: Callable[[], object], addon: str, scale: float | None
) -> list[Trajectory]:
    """Read the largest whole body of a file, or else the first moving object; or the requested body, or all.

    Parameters
    ----------
    path : Path
    selection : Selection
    importer : callable
        Imports the file into the current scene.
    addon : str
        The Blender add-on of the importer.
    scale : float or None
        Metres per unit, if the user gives them.

    Raises
    ------
    TrajectoryError
        If this is not Blender, the file cannot be imported, or nothing in it moves.
    """
    with in_blender(path, "export it again"), _imported(path, importer, addon) as (scene, names):
        found = _Scene(path, scene, names, scale)
        return found.bodies.read(selection, found)


class _Scene:
    """An imported scene; its nodes are the objects, and the bones of the armatures."""

    def __init__(
        self, path: Path, scene: bpy.types.Scene, names: dict[bpy.types.Object, str], scale: float | None
    ) -> None:
        from bpy.utils import unescape_identifier

        self.path, self.scene, self.scale = path, scene, scale
        self.nodes: list[tuple[bpy.types.Object, str | None]] = [(obj, None) for obj in names]
        skeletons: dict[str, list[int]] = {}
        for obj, name in names.items():
            if obj.type == "ARMATURE" and obj.pose and (bones := joints_of(obj).names):
                skeletons[name] = [*range(len(self.nodes), len(self.nodes) + len(bones))]
                self.nodes += [(obj, bone) for bone in bones]
        self.names = [bone or names[obj] for obj, bone in self.nodes]
        numbers: dict[tuple[bpy.types.Object | None, str | None], int]
        numbers = {node: number for number, node in enumerate(self.nodes)}
        self.parents = np.array([numbers.get(_parent(*node), -1) for node in self.nodes], dtype=np.int64)
        keyed, moves = np.zeros((2, len(self.nodes)), dtype=bool)
        for obj in names:
            for fcurve in _curves_of(obj):
                channel = BONE_CHANNEL.match(fcurve.data_path)
                node = numbers.get((obj, unescape_identifier(channel["name"]) if channel else None))
                if node is not None and len((keys := keys_of(fcurve)).frames):
                    keyed[node] = True
                    moves[node] |= keys.varies
        self.bodies = SceneBodies.of(path, self.names, self.parents, moves, keyed, skeletons)

    def whole(self, name: str, own: Sequence[int], remark: str) -> Trajectory:
        moments = self._moments(own)
        obj, bone = self.nodes[own[0]]
        if bone is not None:
            body = whole_body(self.path, obj, name, moments, 1.0, self.scale, made_up=True)
        else:
            parents, names = parents_among(self.parents, own), [self.names[node] for node in own]
            objects = [self.nodes[node][0] for node in own]
            body = body_of_objects(self.path, objects, parents, names, name, moments, self.scale)
        return self._with_remarks(body, own, remark)

    def joints(self, chosen: Sequence[int], own: Sequence[int]) -> list[Trajectory]:
        obj, bone = self.nodes[chosen[0]]
        if bone is None:
            return [self.alone(node) for node in chosen]
        bones, metres = [self.names[node] for node in chosen], self.scale or likely_unit(obj)
        first, *others = single_motions(self.path, obj, bones, bones, self._moments(own), OF_JOINTS, metres)
        return [self._with_remarks(first, own), *others]

    def alone(self, node: int) -> Trajectory:
        obj, moments, metres = self.nodes[node][0], self._moments([node]), self.scale or 1.0
        (result,) = single_motions(self.path, obj, (), [self.names[node]], moments, OF_OBJECTS, metres)
        return self._with_remarks(result, [node])

    def _moments(self, own: Sequence[int]) -> Moments:
        """Return even frames from the first to the last key that moves these nodes, and all keys between."""
        objects = dict.fromkeys(above for node in own for above in with_parents(self.nodes[node][0]))
        # Nodes that do not move are sampled for as long as the other nodes move.
        keys = _keys_of(objects) or _keys_of(obj for obj, bone in self.nodes if bone is None)
        first, last = min(frames[0] for frames in keys), max(frames[-1] for frames in keys)
        refuse_far_frames(self.path, self.names[own[0]], np.array([first, last]))
        rate = self.scene.render.fps / self.scene.render.fps_base
        step = rate / max(rate, rate_of(keys, rate) or 0.0)
        looks = [moments_of(obj, JUMP_STEPS * step) for obj in objects]
        frames, straight = np.concatenate([frames for frames, _ in looks]), all(straight for _, straight in looks)
        return moments_between(first, last, rate, step, frames, straight=straight)

    def _with_remarks(self, trajectory: Trajectory, own: Sequence[int], remark: str = "") -> Trajectory:
        """Return the trajectory with remarks on parts of the file that were not read."""
        obj, data = self.nodes[own[0]][0], self.nodes[own[0]][0].animation_data
        left, takes = _other_takes(obj, data.action, self.scene) if data and data.action else [], ""
        if data and data.action and left:
            takes = f"took its take {data.action.name}; others: {listed(left, MAX_LISTED_NAMES)}"
        return replace(trajectory, remark="; ".join(filter(None, (trajectory.remark, remark, takes))))


def _parent(obj: bpy.types.Object, bone: str | None) -> tuple[bpy.types.Object | None, str | None]:
    """Return the parent of an object or of its bone: an object, or one of its bones."""
    if bone is None:
        return obj.parent, (obj.parent_bone or None) if obj.parent_type == "BONE" else None
    above = armature_of(obj).bones[bone].parent
    return obj, above.name if above else None


def _curves_of(obj: bpy.types.Object) -> Iterator[bpy.types.FCurve]:
    """Yield the F-curves that move an object or its bones."""
    if data := obj.animation_data:
        yield from curves_that_move(data.action, data.action_slot, bones=True)


def _keys_of(objects: Iterable[bpy.types.Object]) -> list[np.ndarray]:
    """Return the frames of the keys, increasing, of each F-curve that moves the objects or their bones."""
    keys = (keys_of(fcurve).frames for obj in objects for fcurve in _curves_of(obj))
    return [frames for frames in keys if len(frames)]


def _other_takes(obj: bpy.types.Object, own: bpy.types.Action, scene: bpy.types.Scene) -> list[str]:
    """Return the names of other imported Actions that move the object, or the bones of the rig."""
    if obj.type != "ARMATURE":
        return [action.name for action in _takes_of(obj, scene) if action != own]
    bones, result = {*armature_of(obj).bones.keys()}, []
    for action in _imported_actions(scene):
        if action != own:
            curves = (fcurve for slot in action.slots for fcurve in fcurves_of(action, slot))
            channels = (BONE_CHANNEL.match(fcurve.data_path) for fcurve in curves)
            if any(match["name"] in bones for match in channels if match):
                result.append(action.name)
    return result


def _takes_of(obj: bpy.types.Object, scene: bpy.types.Scene) -> list[bpy.types.Action]:
    """Return the imported Actions of an object that is not a rig: their names start with its name."""
    if obj.type == "ARMATURE":
        return []
    own = (
        action for action in _imported_actions(scene) if action.name.startswith(f"{obj.name}|") and len(action.slots)
    )
    return [action for action in own if any(curves_that_move(action, action.slots[0], bones=False))]


def _imported_actions(scene: bpy.types.Scene) -> Iterator[bpy.types.Action]:
    """Yield the Actions that the importer created, which are those newer than the scene."""
    import bpy

    return (action for action in bpy.data.actions if action.session_uid > scene.session_uid)


# -- Blender ----------------------------------------------------------------------------------------------------------


@contextmanager
def _imported(
    path: Path, importer: Callable[[], object], addon: str
) -> Iterator[tuple[bpy.types.Scene, dict[bpy.types.Object, str]]]:
    """Yield a scene with the imported data, and its objects with their names; all are removed afterwards."""
    import bpy

    before = {block.session_uid for block in bpy.data.user_map()}
    taken = {obj.name for obj in bpy.data.objects}
    window = bpy.context.window
    if window is None:
        raise TrajectoryError(path, "the open .blend has no window", "save it from Blender's own window, or open none")
    shown_scene = window.scene
    scene = bpy.data.scenes.new("Importing")
    try:
        scene.render.fps, scene.render.fps_base = 24, 1.0
        # Importers use the scene of the window: a context override is not enough for entering Edit Mode.
        window.scene = scene
        with enabled(path, addon):
            run_operator(path, "import", importer)
        for obj in scene.objects:
            _only_its_action(obj, scene)
        yield scene, {obj: _own_name(obj.name, taken) for obj in scene.objects}
    finally:
        window.scene = shown_scene
        new = [block for block in bpy.data.user_map() if block.session_uid not in before]
        bpy.data.batch_remove(new)


def run_operator(path: Path, what: str, do: Callable[[], object]) -> None:
    """Have Blender "import" or "export" a file. On failure, raises TrajectoryError with Blender's message."""
    try:
        with silenced(), redirect_stderr(io.StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            do()
    except TrajectoryError:
        raise
    except Exception as error:
        if "KeyboardInterrupt" in str(error):  # Blender makes an error of it.
            raise KeyboardInterrupt from None
        problem = f"Blender cannot {what} this file ({_reason(path, error)})"
        raise TrajectoryError(path, problem, "export it again") from None


def _reason(path: Path, error: Exception) -> str:
    """Return the last line of an importer's error message or traceback, without Blender's note of the calling code."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    lines = [line for line in lines if not line.startswith("Location:")]
    said = lines[-1].removeprefix("Error: ") if lines else ""
    if not isinstance(error, RuntimeError):
        said = f"{type(error).__name__}: {said}"
    said = said.replace(repr(str(path)), "it").replace(str(path), "it")
    return said if len(said) <= LONGEST_REASON else f"{said[:LONGEST_REASON]}..."


@contextmanager
def enabled(path: Path, addon: str) -> Iterator[None]:
    """Enable one of Blender's bundled add-ons during the context."""
    import addon_utils

    _, loaded = addon_utils.check(addon)
    if not loaded:
        with silenced():
            enable = cast("Callable[..., ModuleType | None]", addon_utils.enable)
            module = enable(addon, default_set=False)
        if module is None:
            raise TrajectoryError(path, f"this Blender has no add-on {addon}", "take a Blender that has it")
    try:
        yield
    finally:
        if not loaded:
            addon_utils.disable(addon, default_set=False)


def _only_its_action(obj: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Keep the Action of an object (or else that of its first strip), and remove its NLA tracks.

    Blender writes the Actions of all objects into an FBX for each object. Of these, the object gets the one with the
    default name that Blender gives to its new Actions.
    """
    data = obj.animation_data
    if data is None:
        return
    strips = [strip for track in data.nla_tracks for strip in track.strips if strip.action]
    if data.action is None and strips:
        action, slot = strips[0].action, strips[0].action_slot
        data.action = action
        data.action_slot = slot
    for action in _takes_of(obj, scene):
        if action.name.rpartition("|")[2].partition(".")[0] == f"{obj.name.partition('.')[0]}Action":
            data.action = action
            data.action_slot = action.slots[0]
    for track in list(data.nla_tracks):
        data.nla_tracks.remove(track)


def _own_name(name: str, taken: set[str]) -> str:
    """Return the name of an object in the file, if Blender numbered it because the name was taken."""
    numbered = NUMBERED.fullmatch(name)
    return numbered["name"] if numbered and numbered["name"] in taken else name
