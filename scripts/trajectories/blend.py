"""Animated objects of .blend files: their world poses on every whole frame, as Blender evaluates them.

The file's data is linked into the running Blender, a probe follows the object in a scene of its own, and all of it is
taken out again: what is open stays as it is. Python of the file (its text blocks, scripted drivers) is not run.
Times are frame / frame rate, positions are Blender units, axes are Blender's.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from .recordings import Selection, Trajectory, TrajectoryError, shown

if TYPE_CHECKING:
    import bpy

TRANSFORMS = ("location", "rotation_", "scale", "delta_")
"""How the data paths of the channels begin that move an object."""

LAST_FRAME = 1048574
"""Blender goes no further; a damaged file could, and would keep it at work for hours."""


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """The animated objects, in the order of their names. Any other object can be had by its name."""
    try:
        import bpy  # noqa: F401
    except ImportError:
        raise TrajectoryError(path, "this needs Blender", "run it in Blender, or pip install bpy") from None
    try:
        with _without_scripts(), _opened(path) as (objects, scenes):
            if not scenes:
                raise TrajectoryError(path, "no scene in this file", "save the file from Blender itself")
            animated = [name for name, obj in objects.items() if _frames_of_keys(obj) is not None]
            still = [name for name in objects if name not in animated]
            return [_sample(path, objects[name], scenes) for name in selection.of(animated, unlisted=still)]
    except (UnicodeDecodeError, SystemError):
        # Blender takes names as they are, and Python fails where it is handed one: with a SystemError on some ways.
        raise TrajectoryError(path, "a name in this file is no text", "save it again from Blender") from None


def _sample(path: Path, obj: bpy.types.Object, scenes: list[bpy.types.Scene]) -> Trajectory:
    import bpy

    from addon.animation import read_poses

    scene = next((scene for scene in scenes if scene in obj.users_scene), scenes[0])
    keyed = _frames_of_keys(obj)
    first, last = keyed if keyed and keyed[0] < keyed[1] else (scene.frame_start, scene.frame_end)
    if not -LAST_FRAME <= first <= last <= LAST_FRAME:
        problem = f"{shown(obj.name)} moves from frame {first:g} to {last:g}, where Blender does not go"
        raise TrajectoryError(path, problem, "delete the keys that are far off")
    rate, base = scene.render.fps, scene.render.fps_base
    if not (rate > 0 and base > 0.0):
        raise TrajectoryError(path, f"{rate} / {base:g} is no frame rate", "set it in the Output Properties")
    frames = np.arange(np.floor(first), np.ceil(last) + 1.0)
    # Blender evaluates a hidden object only for the sake of one that is shown: hence the probe.
    stage, probe = bpy.data.scenes.new("Reading"), bpy.data.objects.new("Probe", None)
    try:
        stage.collection.objects.link(probe)
        probe.constraints.new("COPY_TRANSFORMS").target = obj
        with bpy.context.temp_override(scene=stage, view_layer=stage.view_layers[0]):
            poses = read_poses(probe, frames)
    finally:
        bpy.data.objects.remove(probe)
        bpy.data.scenes.remove(stage)
    units = scene.unit_settings
    metres = 1.0 if units.system == "NONE" else units.scale_length
    return Trajectory(obj.name, frames * base / rate, poses, metres)


def _frames_of_keys(obj: bpy.types.Object) -> tuple[float, float] | None:
    """The first and last frame of what moves the object in its Action and NLA strips. None where it has neither."""
    from bpy_extras.anim_utils import action_get_channelbag_for_slot

    data = obj.animation_data
    if data is None:
        return None
    ranges = [(strip.frame_start, strip.frame_end) for track in data.nla_tracks for strip in track.strips]
    if data.action is not None and data.action_slot is not None:
        channelbag = action_get_channelbag_for_slot(data.action, data.action_slot)
        fcurves = channelbag.fcurves if channelbag else ()
        ranges += [tuple(fcurve.range()) for fcurve in fcurves if fcurve.data_path.startswith(TRANSFORMS)]
    return (min(first for first, _ in ranges), max(last for _, last in ranges)) if ranges else None


@contextmanager
def _opened(path: Path) -> Iterator[tuple[dict[str, bpy.types.Object], list[bpy.types.Scene]]]:
    """The objects by name, and the scenes, of the file: linked for as long as this lasts, or those of the open file."""
    import bpy

    if bpy.data.filepath and path.samefile(bpy.data.filepath):
        yield dict(sorted(bpy.data.objects.items())), list(bpy.data.scenes)
        return
    before = set(bpy.data.libraries)
    try:
        with bpy.data.libraries.load(str(path.resolve()), link=True) as (there, here):
            here.objects, here.scenes = sorted(there.objects), list(there.scenes)
    except (OSError, RuntimeError) as error:
        reason = " ".join(str(error).split())
        problem = f"Blender cannot open this file ({reason})"
        raise TrajectoryError(path, problem, "save it again from Blender") from None
    try:
        yield {obj.name: obj for obj in here.objects if obj}, [scene for scene in here.scenes if scene]
    finally:
        # A library takes those along that it alone needed, so they are looked for again each time.
        while added := [library for library in bpy.data.libraries if library not in before]:
            bpy.data.libraries.remove(added[0])


@contextmanager
def _without_scripts() -> Iterator[None]:
    """No Python of the file runs. The preference also switches off what Blender was started with (`-y`)."""
    import bpy

    preferences = bpy.context.preferences.filepaths
    allowed = preferences.use_scripts_auto_execute
    preferences.use_scripts_auto_execute = False
    try:
        yield
    finally:
        preferences.use_scripts_auto_execute = allowed
