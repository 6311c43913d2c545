"""Objects with keys, to be edited and played in tests. Frames are the scene's, angles radians."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import addon_utils
import bpy
import numpy as np
from mathutils import Quaternion

from rigid_motion.animation import key_frames, set_mode, write_channel
from rigid_motion.animation.actions.channels import replace_keys
from tests.animation.keyed import WIDTHS, Carrier, curves_of, rotation_path

FRAMES = (1.0, 11.0, 24.0, 40.0)


def new_object(name: str = "Tool", rotation_mode: str = "QUATERNION", data: bpy.types.ID | None = None):
    """Create an object in the scene: an empty, unless data is given."""
    obj = bpy.data.objects.new(name, data)
    obj.rotation_mode = rotation_mode
    bpy.context.scene.collection.objects.link(obj)
    return obj


def random_values(obj: Carrier, path: str, count: int, seed: int = 0, even: bool = True) -> np.ndarray:
    """Return values for the keys of a property, none of them half a turn apart."""
    random = np.random.default_rng((seed, sum(map(ord, path))))
    values = random.normal(size=(count, WIDTHS[path]))
    if path == "scale":
        return np.exp(0.5 * (np.repeat(values[:, :1], 3, axis=1) if even else values))
    if path == "rotation_euler":
        return 1.5 * np.tanh(values)
    return 3.0 * values if path == "location" else values


def key(
    carrier: Carrier,
    frames: Sequence[float] = FRAMES,
    *,
    seed: int = 0,
    location: bool = True,
    scale: str | None = None,
    interpolation: str = "BEZIER",
) -> Carrier:
    """Key location, rotation and (with scale "even" or "uneven") scale at random on these frames."""
    # Each bone of a rig moves differently.
    seed += 0 if isinstance(carrier, bpy.types.Object) else sum(map(ord, carrier.name))
    for path in (*(["location"] if location else []), rotation_path(carrier), *(["scale"] if scale else [])):
        values = random_values(carrier, path, len(frames), seed, scale == "even")
        write(carrier, path, np.array(frames), values, interpolation)
    return carrier


def write(carrier: Carrier, path: str, frames: np.ndarray, values: np.ndarray, interpolation: str = "LINEAR") -> None:
    """Replace a property's channels. Those of a bone get its group in the Dope Sheet, as with keys set by hand."""
    group = "" if isinstance(carrier, bpy.types.Object) else carrier.name
    write_channel(carrier.id_data, carrier.path_from_id(path), frames, values, interpolation=interpolation, group=group)


def turning(
    name: str, degrees: Sequence[float], frames: Sequence[float], rotation_mode: str = "QUATERNION", sign: float = 1.0
) -> bpy.types.Object:
    """Return an object that turns about z to these angles and moves 2 along x per key. Every second key has `sign`."""
    obj, angles, count = new_object(name, rotation_mode), np.radians(degrees), np.arange(len(frames))
    write_channel(obj, "location", np.array(frames), np.outer(count, (2.0, 0.0, 0.0)))
    if rotation_mode == "QUATERNION":
        columns = np.cos(angles / 2.0), 0.0 * angles, 0.0 * angles, np.sin(angles / 2.0)
        write_channel(
            obj,
            "rotation_quaternion",
            np.array(frames),
            np.transpose(columns) * np.where(count % 2, sign, 1.0)[:, None],
        )
    elif rotation_mode != "AXIS_ANGLE":
        write_channel(obj, "rotation_euler", np.array(frames), np.outer(angles, (0.0, 0.0, 1.0)))
    return obj


def key_densely(obj: Carrier) -> None:
    """Replace a carrier's keys by linear ones on all eighths of frames, at the displayed values, without modes."""
    curves = list(curves_of(obj).values())
    first, last = curves[0].range()
    frames = np.arange(first, last + 0.125, 0.125)
    shown = [[fcurve.evaluate(frame) for frame in frames] for fcurve in curves]
    set_mode(obj, "BLENDER", key_frames(obj))
    for fcurve, values in zip(curves, shown, strict=True):
        replace_keys(fcurve, frames, np.array(values))
        assert not fcurve.modifiers


def give_own_deltas(obj: bpy.types.Object, seed: int = 0) -> None:
    """Give the object random delta transforms of its own."""
    random = np.random.default_rng(seed)
    obj.delta_location = random.normal(size=3)
    obj.delta_scale = np.full(3, np.exp(0.3 * random.normal()))
    obj.delta_rotation_quaternion = Quaternion(random.normal(size=4)).normalized()
    obj.delta_rotation_euler = random.normal(size=3)


def push_down(obj: bpy.types.Object, start: int = 1, **settings: float) -> bpy.types.NlaStrip:
    """Put the object's Action into a strip of a new track."""
    data = obj.animation_data
    action, slot = data.action, data.action_slot
    data.action = None
    strip = data.nla_tracks.new().strips.new(action.name, start, action)
    strip.action_slot = slot
    for name, value in settings.items():
        setattr(strip, name, value)
    bpy.context.view_layer.update()
    return strip


def tweak(obj: bpy.types.Object, strip: bpy.types.NlaStrip) -> None:
    """Edit the Action of a strip, as Tab does in the NLA Editor."""
    data = obj.animation_data
    track = next(track for track in data.nla_tracks if strip.name in track.strips)
    data.nla_tracks.active = track
    track.select = strip.select = True
    data.use_tweak_mode = True
    bpy.context.view_layer.update()
    assert data.use_tweak_mode


def new_strip(
    obj: bpy.types.Object, start: int, action: bpy.types.Action, slot: bpy.types.ActionSlot, last: int = 40
) -> bpy.types.NlaStrip:
    """Add a strip of frames 1 to `last` in its own track. Blender makes it one frame long if several slots fit."""
    strip = obj.animation_data.nla_tracks.new().strips.new(slot.name_display, start, action)
    strip.action_slot, strip.action_frame_start, strip.action_frame_end = slot, 1, last
    return strip


def linked(library: Path, name: str) -> bpy.types.Object:
    """Link an object of another file into the scene."""
    with bpy.data.libraries.load(str(library), link=True) as (_, expected):
        expected.objects = [name]
    (obj,) = expected.objects
    bpy.context.scene.collection.objects.link(obj)
    bpy.context.view_layer.update()
    return obj


def put_into_library(obj: bpy.types.Object) -> bpy.types.Object:
    """Write an object to another file, and return it linked from there."""
    library, name = Path(bpy.app.tempdir) / "library.blend", obj.name
    bpy.data.libraries.write(str(library), {obj})
    bpy.data.objects.remove(obj)
    return linked(library, name)


@contextmanager
def enabled(*addons: str) -> Iterator[None]:
    """Switch on Blender's own add-ons of these names within the block. Those that were off are off again afterwards."""
    switched_on = [name for name in addons if addon_utils.check(name) != (True, True)]
    for name in switched_on:
        addon_utils.enable(name)
    try:
        yield
    finally:
        for name in switched_on:
            addon_utils.disable(name)


@contextmanager
def editor(kind: str, mode: str | None = None) -> Iterator[bpy.types.Space]:
    """Run operators within the block in an editor of this kind."""
    window = bpy.context.window_manager.windows[0]
    area = window.screen.areas[0]
    before, area.type = area.type, kind
    if mode is not None:
        area.spaces.active.mode = mode
    region = next(region for region in area.regions if region.type == "WINDOW")
    try:
        with bpy.context.temp_override(window=window, area=area, region=region):
            yield area.spaces.active
    finally:
        area.type = before
