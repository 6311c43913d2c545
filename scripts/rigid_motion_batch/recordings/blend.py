"""Animated objects, rigs and pose bones of .blend files, evaluated by Blender on whole frames and at keys.

The data of the file is linked into the running Blender. In a scene of its own, a probe object follows the object or the
bones; then everything is removed again, and the open file stays unchanged. Python in the file (text blocks, scripted
drivers) is not run. An armature whose bones move is a whole body; a bone is named OBJECT/BONE. Times are frame / frame
rate, positions are Blender units, axes are Blender's. A bone has its own axes, with y along the bone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from .key_moments import BONE_CHANNEL, curves_that_move, fcurves_of, moments_of
from .looks import LAST_FRAME, single_motions
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import ALL, Selection, Trajectory, TrajectoryError, shown
from .rigs import armature_of, in_blender, whole_body
from .sampling import JUMP_STEPS, OF_OBJECTS, Moments, merged

if TYPE_CHECKING:
    import bpy

OF_BONES = "pose.bones["
"""Start of the data path of every bone property that a driver may drive."""

MAX_LISTED_BONES = 5
"""Bones listed per rig when the user has to name one."""


@dataclass(frozen=True)
class BlendBody:
    """An object to read, or one bone of its pose."""

    obj: bpy.types.Object
    bone: str | None = None

    @property
    def name(self) -> str:
        return self.obj.name if self.bone is None else f"{self.obj.name}/{self.bone}"

    def frames_of_keys(self) -> tuple[float, float] | None:
        """Return the first and last frame of the object's keys and NLA strips, or None if it has none.

        Keys of any bone count for all bones of the rig, because parents and constraints connect bones.
        """
        data = self.obj.animation_data
        if data is None:
            return None
        strips = [strip for track in data.nla_tracks for strip in track.strips]
        ranges: list[tuple[float, ...]] = [(strip.frame_start, strip.frame_end) for strip in strips]
        # An F-curve made by modifiers only has no keys, but reports a range at frame 0.
        ranges += [
            fcurve.range()[:]
            for fcurve in curves_that_move(data.action, data.action_slot, bones=self.bone is not None)
            if fcurve.keyframe_points or fcurve.sampled_points
        ]
        return (min(first for first, _ in ranges), max(last for _, last in ranges)) if ranges else None


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the first (by name) of the animated objects and the rigs with bone keys; or all animated objects.

    Any other object and any bone can be read by name.
    """
    with in_blender(path, "save it again from Blender"), _without_scripts(), _opened(path) as (objects, scenes):
        if not scenes:
            raise TrajectoryError(path, "no scene in this file", "save the file from Blender itself")
        bodies = {name: BlendBody(obj) for name, obj in objects.items()}
        bones = {
            f"{name}/{bone}": BlendBody(obj, bone)
            for name, obj in objects.items()
            if obj.type == "ARMATURE"
            for bone in armature_of(obj).bones.keys()  # noqa: SIM118 - it runs over bones
        }
        animated = [name for name, body in bodies.items() if body.frames_of_keys() is not None]
        selection.match([*bodies, *bones])
        requested = selection.requested or ""
        if requested in bones and requested not in bodies:
            selection.of(animated, unlisted=[requested])
            return [_sample(path, bones[requested], scenes, options.scale)]
        with_keys = {name: _bones_with_keys(obj) for name, obj in objects.items()}
        # For all objects: only animated ones. For a single one: also rigs with animated bones.
        every = selection.requested == ALL
        moving = [name for name in objects if name in animated or (with_keys[name] and not every)]
        few = [f"{name}/{bone}" for name, bones in with_keys.items() for bone in bones[:MAX_LISTED_BONES]]
        more = sum(map(len, with_keys.values())) - len(few)
        still = [name for name in objects if name not in moving]
        taken = selection.of(moving, unlisted=[*few, *still], more=more)
        if not every and (with_keys[taken[0]] or _bones_are_moved(objects[taken[0]])):
            return [_sample_whole(path, objects[taken[0]], scenes, options.scale)]
        return [_sample(path, bodies[name], scenes, options.scale) for name in taken]


def _sample(path: Path, body: BlendBody, scenes: list[bpy.types.Scene], scale: float | None) -> Trajectory:
    moments, metres = _moments(path, body, scenes)
    bones = [body.bone] if body.bone else []
    (result,) = single_motions(path, body.obj, bones, [body.name], moments, OF_OBJECTS, scale or metres)
    return replace(result, metres_per_unit=metres)


def _sample_whole(path: Path, rig: bpy.types.Object, scenes: list[bpy.types.Scene], scale: float | None) -> Trajectory:
    if not armature_of(rig).bones:
        raise TrajectoryError(path, f"{shown(rig.name)} has no bones at all", "name another object of the file")
    # Keys of any bone count, so the first bone will do.
    moments, metres = _moments(path, BlendBody(rig, armature_of(rig).bones[0].name), scenes, rig.name)
    return whole_body(path, rig, rig.name, moments, metres, scale)


def _moments(path: Path, body: BlendBody, scenes: list[bpy.types.Scene], name: str = "") -> tuple[Moments, float]:
    """Return the frames at which to sample a body, and the metres per unit."""
    scene = next((scene for scene in scenes if scene in body.obj.users_scene), scenes[0])
    keyed = body.frames_of_keys()
    first, last = keyed if keyed and keyed[0] < keyed[1] else (scene.frame_start, scene.frame_end)
    if not -LAST_FRAME <= first <= last <= LAST_FRAME:
        problem = f"{shown(name or body.name)} moves from frame {first:g} to {last:g}, where Blender does not go"
        raise TrajectoryError(path, problem, "delete the keys that are far off")
    rate, base = scene.render.fps, scene.render.fps_base
    if not (rate > 0 and base > 0.0):
        raise TrajectoryError(path, f"{rate} / {base:g} is not a frame rate", "set it in the Output Properties")
    whole = np.arange(np.floor(first), np.ceil(last) + 1.0)
    keys, straight = moments_of(body.obj, JUMP_STEPS)
    units = scene.unit_settings
    return Moments(
        merged(whole, keys, 1.0), rate / base, straight=straight
    ), 1.0 if units.system == "NONE" else units.scale_length


def _bones_are_moved(obj: bpy.types.Object) -> bool:
    """Return whether the object is an armature whose bones may be moved by drivers or constraints."""
    if obj.type != "ARMATURE" or not obj.pose:
        return False
    data = obj.animation_data
    drivers = data.drivers if data else ()
    return any(bone.constraints for bone in obj.pose.bones) or any(
        driver.data_path.startswith(OF_BONES) for driver in drivers
    )


def _bones_with_keys(obj: bpy.types.Object) -> list[str]:
    """Return the bones moved by the object's Action or NLA strips, in the order of the armature."""
    from bpy.utils import unescape_identifier

    data = obj.animation_data
    if obj.type != "ARMATURE" or data is None:
        return []
    actions = [(strip.action, strip.action_slot) for track in data.nla_tracks for strip in track.strips]
    result = {
        unescape_identifier(channel["name"])
        for action, slot in [(data.action, data.action_slot), *actions]
        for fcurve in fcurves_of(action, slot)
        if (channel := BONE_CHANNEL.match(fcurve.data_path))
    }
    return [bone.name for bone in armature_of(obj).bones if bone.name in result]


@contextmanager
def _opened(path: Path) -> Iterator[tuple[dict[str, bpy.types.Object], list[bpy.types.Scene]]]:
    """Yield the objects by name and the scenes of the file: linked during the context, or those of the open file.

    Objects that the file itself links are included if a scene contains them. Local objects win over linked ones of the
    same name.
    """
    import bpy

    if bpy.data.filepath and path.samefile(bpy.data.filepath):
        own = [obj for obj in bpy.data.objects if obj.library is None]
        scenes = [scene for scene in bpy.data.scenes if scene.library is None]
        yield _by_name(own, scenes), scenes
        return
    before = set(bpy.data.libraries)
    load = cast("Callable[..., AbstractContextManager[tuple[Any, Any]]]", bpy.data.libraries.load)
    try:
        with load(str(path.resolve()), link=True) as (there, here):
            here.objects, here.scenes = list(there.objects), list(there.scenes)
    except (OSError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        problem = f"Blender cannot open this file ({reason})"
        raise TrajectoryError(path, problem, "save it again from Blender") from None
    try:
        scenes = [scene for scene in here.scenes if scene]
        yield _by_name([obj for obj in here.objects if obj], scenes), scenes
    finally:
        # Removing a library also removes libraries that only it used, so list them again each time.
        while added := [library for library in bpy.data.libraries if library not in before]:
            bpy.data.libraries.remove(added[0])


def _by_name(own: list[bpy.types.Object], scenes: list[bpy.types.Scene]) -> dict[str, bpy.types.Object]:
    """Return the objects of the file, then those of libraries, each sorted by name."""
    # In a damaged file, a scene may have no collection.
    linked = (obj for scene in scenes if scene.collection for obj in scene.collection.all_objects)
    objects = {obj.name: obj for obj in sorted(own, key=lambda obj: obj.name)}
    for obj in sorted(linked, key=lambda obj: obj.name):
        objects.setdefault(obj.name, obj)
    return objects


@contextmanager
def _without_scripts() -> Iterator[None]:
    """Keep the Python code of the file from running. The preference also overrides the command line option `-y`."""
    import bpy

    preferences = cast("bpy.types.Preferences", bpy.context.preferences).filepaths
    allowed = preferences.use_scripts_auto_execute
    preferences.use_scripts_auto_execute = False
    try:
        yield
    finally:
        preferences.use_scripts_auto_execute = allowed
