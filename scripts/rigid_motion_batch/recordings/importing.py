"""Whole bodies of files that Blender imports: into a scene of their own, out of which all of it is taken again.

What is open stays as it is. A file may hold several armatures: that one is taken which moves and has the most bones,
unless another is named. Times begin with 0 on the first key, axes and units are those that the importer makes of the
file's. A stranger's file is data: importers are written in Python, fail in any way there is, and may crash.
"""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, cast

import numpy as np

from rigid_motion_batch.command_line import listed
from rigid_motion_batch.silencing import silenced

from .key_moments import BONE_CHANNEL, curves_that_move, fcurves_of, keys_of, moments_of, with_parents
from .recordings import ALL, NoMotion, Selection, Trajectory, TrajectoryError
from .rigs import LAST_FRAME, armature_of, in_blender, joints_of, refuse_too_many, single_joints, whole_body
from .sampling import LEAD, SAME, Moments, away, merged
from .tables import LARGEST_FILE

if TYPE_CHECKING:
    import bpy

FASTEST, SLOWEST = 240.0, 5.0
"""Keys a second that are taken to be the rate of the file."""

ROUND = 2e-4
"""Share by which a rate may be off a whole number that is one: 29.97 is none."""

ON_A_FRAME = 1e-4
"""Distance from a whole frame within which a key is on it."""

FINE = 1e-3
"""Share by which that is less fine for each frame from the first: F-curves keep frames in single precision."""

NONE = np.empty(0)

MULTIPLE = 0.05
"""Share of the least gap between keys by which others may miss its multiples."""

THINNED = 4.0
"""Number of samples that a key may stand for where keys were thinned."""

FEW = 5
"""Names of a kind that a remark tells."""

NUMBERED = re.compile(r"(?P<name>.+)\.\d{3,}", re.DOTALL)
"""A name that Blender has numbered, for there was one like it."""

LONGEST_REASON = 120
"""Characters of what an importer says."""


def refuse_too_large(path: Path, *others: Path) -> None:
    """Raise TrajectoryError where a file, and those that belong to it, have more bytes than are read."""
    size = sum(item.stat().st_size for item in (path, *others))
    if size > LARGEST_FILE:
        problem = f"{size} bytes are more than the {LARGEST_FILE} that are read"
        raise TrajectoryError(path, problem, "export the skeleton without its meshes, or split the recording")


def read_imported(
    path: Path,
    selection: Selection,
    importer: Callable[[], object],
    addon: str,
    scale: float | None,
    *,
    fps: int = 24,
    usual: float = 0.0,
    made: np.ndarray = NONE,
) -> list[Trajectory]:
    """Read the whole skeleton of a file; or bones that are named, or all.

    Parameters
    ----------
    path : Path
    selection : Selection
    importer : callable
        Imports the file into the current scene.
    addon : str
        The add-on of Blender that it is in.
    scale : float or None
        Metres of a unit, where the user says them.
    fps : int
        Frames a second of the scene to import into.
    usual : float
        Frames a second where keys tell no rate that is plausible; 0 for those of the scene, which are the fewest then.
    made : array, shape (n,)
        Frames, rising, at which curves have keys that the file has not.

    Raises
    ------
    TrajectoryError
        Where there is no Blender, the file cannot be imported, or has no armature that moves.
    """
    with in_blender(path, "export it again"), _imported(path, importer, addon, fps) as (scene, names):
        rigs = {name: obj for obj, name in names.items() if obj.type == "ARMATURE" and obj.pose}
        moving = {name: span for name, obj in rigs.items() if (span := _frames_of_keys(obj)) is not None}
        if not moving:
            problem = "no skeleton that moves" if rigs else "no skeleton"
            raise NoMotion(path, f"{problem} in this file", "export the armature together with its animation")
        bones = {name: armature_of(rig).bones.keys() for name, rig in rigs.items()}
        selection.match([*rigs, *(bone for own in bones.values() for bone in own)])
        selection.match(f"{name}/{bone}" for name, own in bones.items() for bone in own)
        name, bone = _requested(rigs, moving, selection.requested)
        rig, rate = rigs[name], scene.render.fps / scene.render.fps_base
        first, last = moving.get(name) or next(iter(moving.values()))
        keys = _rate_of_keys(rig, rate, made)
        if not (abs(first) <= LAST_FRAME and abs(last) <= LAST_FRAME):
            refuse_too_many(path, name, 1, np.array([first, last]))
        step = rate / (keys or usual if usual else max(rate, keys or 0.0))
        moments = _moments(rig, first, last, rate, step, made)
        remarks = _remarks(scene, rig, name, list(rigs), several=selection.requested in (None, ALL))
        if bone is None and selection.requested != ALL:
            called = path.stem if selection.requested is None else name
            body = whole_body(path, rig, called, moments, 1.0, scale, made_up=True)
            return [_with_remarks(body, *remarks)]
        joints = joints_of(rig)
        if bone is None:
            taken = selection.of(joints.names)
            several = single_joints(path, rig, taken, moments, scale)
            return [_with_remarks(several[0], joints.remark, *remarks), *several[1:]]
        known = bone in joints.names or bone in joints.left_out
        unlisted = [*joints.left_out, *([selection.requested or ""] if known else [])]
        (requested,) = selection.of(joints.names, unlisted)
        (motion,) = single_joints(path, rig, [bone], moments, scale)
        return [_with_remarks(replace(motion, name=requested), *remarks)]


def _requested(
    rigs: dict[str, bpy.types.Object], moving: Mapping[str, object], requested: str | None
) -> tuple[str, str | None]:
    """Return the armature that is meant and its bone, or None for the whole."""
    largest = max(moving, key=lambda name: len(armature_of(rigs[name]).bones))
    if requested in (None, ALL):
        return largest, None
    in_order = sorted(rigs, key=lambda name: name != largest)
    for name in in_order:
        if requested in armature_of(rigs[name]).bones:
            return name, requested
    if requested in rigs:
        return requested, None
    for name in in_order:
        if requested.startswith(f"{name}/") and requested[len(name) + 1 :] in armature_of(rigs[name]).bones:
            return name, requested[len(name) + 1 :]
    return largest, requested


def _remarks(
    scene: bpy.types.Scene, rig: bpy.types.Object, name: str, rigs: list[str], *, several: bool
) -> Iterator[str]:
    """Yield remarks on what is left of the file."""
    if several and len(rigs) > 1:
        others = listed([other for other in rigs if other != name], FEW)
        yield f"took {name} of {len(rigs)} armatures; others: {others}"
    data = rig.animation_data
    if data and data.action and (takes := _other_takes(rig, data.action, scene)):
        yield f"took its take {data.action.name}; others: {listed(takes, FEW)}"


def _with_remarks(trajectory: Trajectory, *remarks: str) -> Trajectory:
    return replace(trajectory, remark="; ".join(filter(None, (trajectory.remark, *remarks))))


# -- keys -------------------------------------------------------------------------------------------------------------


def _keys_of_curves(rig: bpy.types.Object) -> list[np.ndarray]:
    """Return the frames of the keys, rising, of each curve that moves the bones, the armature, or what it hangs on."""
    keys = []
    for obj in with_parents(rig):
        if data := obj.animation_data:
            curves = curves_that_move(data.action, data.action_slot, bones=obj == rig)
            keys += [own.frames for fcurve in curves if len((own := keys_of(fcurve)).frames)]
    return keys


def _frames_of_keys(rig: bpy.types.Object) -> tuple[float, float] | None:
    """Return the first and last frame of what moves an armature. None where nothing does."""
    keys = _keys_of_curves(rig)
    return (min(own[0] for own in keys), max(own[-1] for own in keys)) if keys else None


def _rate_of_keys(rig: bpy.types.Object, fps: float, made: np.ndarray) -> float | None:
    """Return how many keys a second the densest curve has; None where that is no rate that anything is recorded at.

    A curve with even gaps, or a thinned one whose gaps are multiples of the least, goes before uneven ones.
    """
    rates: dict[bool, list[float]] = {True: [], False: []}
    for keys in _keys_of_curves(rig):
        gaps = np.diff(_less(keys, made))
        if len(gaps := gaps[gaps > ON_A_FRAME]):
            times = gaps / gaps.min()
            even = np.abs(times - np.rint(times)).max() < MULTIPLE and times.mean() < THINNED
            rate = fps / (gaps.sum() / np.rint(times).sum() if even else float(np.median(gaps)))
            rates[bool(even)].append(float(round(rate)) if abs(rate - round(rate)) < ROUND * rate else rate)
    of_recordings = [[rate for rate in some if SLOWEST <= rate <= FASTEST] for some in rates.values()]
    return max(of_recordings[0] or of_recordings[1], default=None)


def _less(keys: np.ndarray, made: np.ndarray) -> np.ndarray:
    """Return frames of keys without those that were made."""
    return keys[away(keys, made) > ON_A_FRAME * (1.0 + FINE * np.abs(keys))]


def _moments(rig: bpy.types.Object, first: float, last: float, fps: float, step: float, made: np.ndarray) -> Moments:
    """Return even frames from the first key to the last one, and all keys between."""
    even = first + step * np.arange(int((last - first) / step + SAME) + 1)
    if last - even[-1] > SAME * step:
        even = np.append(even, last)
    keys, straight = moments_of(rig, LEAD * step)
    frames = merged(even, _less(keys, made), step)
    whole = np.rint(frames)
    frames = np.where(np.abs(frames - whole) < ON_A_FRAME, whole, frames)
    return Moments(frames, fps, first, step, straight and not len(made))


def _other_takes(rig: bpy.types.Object, own: bpy.types.Action, scene: bpy.types.Scene) -> list[str]:
    """Return other Actions that move its bones, of those that the importer has made after the scene."""
    import bpy

    bones, result = set(armature_of(rig).bones.keys()), []
    for action in bpy.data.actions:
        if action != own and action.session_uid > scene.session_uid:
            curves = (fcurve for slot in action.slots for fcurve in fcurves_of(action, slot))
            channels = (BONE_CHANNEL.match(fcurve.data_path) for fcurve in curves)
            if any(match["name"] in bones for match in channels if match):
                result.append(action.name)
    return result


# -- Blender ----------------------------------------------------------------------------------------------------------


@contextmanager
def _imported(
    path: Path, importer: Callable[[], object], addon: str, fps: int
) -> Iterator[tuple[bpy.types.Scene, dict[bpy.types.Object, str]]]:
    """Yield a scene with what was imported, and its objects with their names; all of it gone afterwards."""
    import bpy

    before = {block.session_uid for block in bpy.data.user_map()}
    taken = {obj.name for obj in bpy.data.objects}
    window = bpy.context.window
    if window is None:
        raise TrajectoryError(path, "the open .blend has no window", "save it from Blender's own window, or open none")
    shown_scene = window.scene
    scene = bpy.data.scenes.new("Importing")
    try:
        scene.render.fps, scene.render.fps_base = fps, 1.0
        # Importers go by what the window shows: an override is not enough for the mode that they edit bones in.
        window.scene = scene
        with enabled(path, addon):
            told(path, "import", importer)
        for obj in scene.objects:
            _only_its_action(obj)
        yield scene, {obj: _own_name(obj.name, taken) for obj in scene.objects}
    finally:
        window.scene = shown_scene
        new = [block for block in bpy.data.user_map() if block.session_uid not in before]
        bpy.data.batch_remove(new)


def told(path: Path, what: str, do: Callable[[], object]) -> None:
    """Have Blender "import" or "export" a file. Raises TrajectoryError with what it says where it cannot."""
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
    """Return what an importer says: in its own words, or the last line of a traceback."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    if not lines:
        return type(error).__name__
    if any("Traceback (most recent call last)" in line for line in lines):
        # Blender adds where it was called from.
        lines = [line for line in lines if not line.startswith("Location:")]
        said = lines[-1]
    else:
        said = " ".join(lines).removeprefix("Error: ").strip()
        if not isinstance(error, RuntimeError):
            said = f"{type(error).__name__}: {said}"
    said = said.replace(repr(str(path)), "it").replace(str(path), "it")
    return said if len(said) <= LONGEST_REASON else f"{said[:LONGEST_REASON]}..."


@contextmanager
def enabled(path: Path, addon: str) -> Iterator[None]:
    """Switch on an add-on of Blender's own for as long as this lasts."""
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


def _only_its_action(obj: bpy.types.Object) -> None:
    """Keep the Action that an object has, or else that of its first strip, and nothing else of its NLA."""
    data = obj.animation_data
    if data is None:
        return
    strips = [strip for track in data.nla_tracks for strip in track.strips if strip.action]
    if data.action is None and strips:
        action, slot = strips[0].action, strips[0].action_slot
        data.action = action
        data.action_slot = slot
    for track in list(data.nla_tracks):
        data.nla_tracks.remove(track)


def _own_name(name: str, taken: set[str]) -> str:
    """Return what the file calls an object that was numbered, for there is one of that name in what is open."""
    numbered = NUMBERED.fullmatch(name)
    return numbered["name"] if numbered and numbered["name"] in taken else name
