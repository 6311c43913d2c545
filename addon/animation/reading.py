"""From Blender's data to sources: which slots move an object, what is keyed there, and why it may not do.

Objects are what can be filled in. A pose bone has its channels in its armature's Action, under a prefix of its own, and
no delta transforms: `Transformable` is where it will come in, for what is baked.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import bpy
import numpy as np
from bpy_extras.anim_utils import action_get_channelbag_for_slot

from ..motion.eulers import ORDERS, quaternions_from_eulers
from .fcurves import Keys, read_keys
from .sources import LOCATION, MODE_IDS, ROTATION, SCALE, Source

MODE_PATH = "rigid_motion.mode"

GROUP = "Rigid Motion"
"""The group of F-curves that the mode channel and the delta transforms are in."""

MOST_FRAMES = 250_000
"""The longest motion that is filled in: two hours and a quarter at 30 frames a second."""

COMPONENTS = (
    *(f"Location {axis}" for axis in "XYZ"),
    *(f"Rotation {axis}" for axis in "WXYZ"),
    *(f"Scale {axis}" for axis in "XYZ"),
)
"""What the rows of a source are called."""

UNKNOWN = -1
"""The mode of an object from a file that is damaged, or of a later version."""

WIDTHS = {LOCATION: 3, "rotation_quaternion": 4, "rotation_euler": 3, SCALE: 3}

Curves = dict[tuple[str, int], bpy.types.FCurve]


class Refused(ValueError):
    """Why rigid motion cannot act on something: names it, and the way out."""


@dataclass(frozen=True)
class Transformable:
    """What has location, rotation and scale, told apart from the object whose Action holds the channels."""

    animated: bpy.types.Object
    carrier: bpy.types.Object | bpy.types.PoseBone
    prefix: str = ""
    """From the object to the carrier, in data paths."""

    @classmethod
    def of(cls, obj: bpy.types.Object) -> Transformable:
        return cls(obj, obj)

    @property
    def name(self) -> str:
        return self.carrier.name

    @property
    def rotation(self) -> str:
        """The property that turns it. `Refused` where that is an axis and an angle."""
        mode = self.carrier.rotation_mode
        if mode == "QUATERNION":
            return "rotation_quaternion"
        if mode in ORDERS:
            return "rotation_euler"
        raise Refused(
            f"{self.name} turns by axis and angle, which has no rigid in-betweens: "
            "set its rotation mode to Quaternion first (sidebar, Item)"
        )

    @property
    def properties(self) -> dict[str, str]:
        """Location, rotation and scale, and which property each of them is."""
        return {LOCATION: "location", ROTATION: self.rotation, SCALE: "scale"}


@dataclass(frozen=True)
class Slot:
    """One of the slots that move an object, with everything else that it moves."""

    action: bpy.types.Action
    handle: int
    users: tuple[bpy.types.Object, ...]
    strip: tuple[int, int] | None
    """The frames that are seen of an Action in a strip; None for one that plays by itself."""

    @property
    def span(self) -> tuple[int, int]:
        """The frames that are seen: those of the strip, or of all scenes that have one of the users."""
        if self.strip is not None:
            return self.strip
        scenes = {scene for obj in self.users for scene in obj.users_scene} or set(bpy.data.scenes)
        return min(scene.frame_start for scene in scenes), max(scene.frame_end for scene in scenes)

    @property
    def channelbag(self) -> bpy.types.ActionChannelbag | None:
        slot = next((slot for slot in self.action.slots if slot.handle == self.handle), None)
        return None if slot is None else action_get_channelbag_for_slot(self.action, slot)


def slots_of(objects: Iterable[bpy.types.Object]) -> list[Slot]:
    """The slots that move these objects, in Actions of their own and in NLA strips; each once."""
    wanted = {key for obj in objects for key in _uses(obj)}
    return _slots(lambda key: key in wanted) if wanted else []


def slots_in(actions: Iterable[bpy.types.Action]) -> list[Slot]:
    """The slots of these Actions that move an object."""
    wanted = {action.as_pointer() for action in actions}
    return _slots(lambda key: key[0] in wanted)


def _slots(is_wanted: Callable[[tuple[int, int]], bool]) -> list[Slot]:
    users: dict[tuple[int, int], list[bpy.types.Object]] = {}
    places = {}
    for obj in bpy.data.objects:
        for key, place in _uses(obj).items():
            if is_wanted(key):
                users.setdefault(key, []).append(obj)
                places[key] = place
    return [Slot(action, handle, tuple(users[key]), strip) for key, (action, handle, strip) in places.items()]


def _uses(obj: bpy.types.Object) -> dict[tuple[int, int], tuple[bpy.types.Action, int, tuple[int, int] | None]]:
    """The slots that move an object: Action, handle, and the frames a strip shows, None outside of the NLA."""
    data = obj.animation_data
    if data is None:
        return {}
    found = {}
    action = data.action
    if action is not None and (handle := data.action_slot_handle):
        found[action.as_pointer(), handle] = (action, handle, None)
    if len(data.nla_tracks):
        for strip in _strips(strip for track in data.nla_tracks for strip in track.strips):
            if (action := strip.action) is not None and (handle := strip.action_slot_handle):
                span = int(np.floor(strip.action_frame_start)), int(np.ceil(strip.action_frame_end))
                found.setdefault((action.as_pointer(), handle), (action, handle, span))
    return found


def _strips(strips: Iterable[bpy.types.NlaStrip]) -> Iterator[bpy.types.NlaStrip]:
    for strip in strips:
        yield strip
        yield from _strips(strip.strips)


def curves_in(channelbag: bpy.types.ActionChannelbag | None) -> Curves:
    """The F-curves of a slot, by data path and index."""
    if channelbag is None:
        return {}
    return {(fcurve.data_path, fcurve.array_index): fcurve for fcurve in channelbag.fcurves}


def is_filled_in(fcurve: bpy.types.FCurve) -> bool:
    """Whether an F-curve is one that in-betweens are in: sampled, and in the group of them."""
    return fcurve.group is not None and fcurve.group.name == GROUP and not fcurve.keyframe_points


def read(slot: Slot, curves: Curves, mode: int | None = None) -> Source:
    """What is keyed in a slot, for all of its users together.

    Parameters
    ----------
    slot : Slot
    curves : dict
        Its F-curves, see `curves_in`.
    mode : int, optional
        Read it as if it had this mode throughout.

    Raises
    ------
    Refused
        Where that cannot be filled in.
    """
    source, *others = (_read_for(Transformable.of(obj), slot, curves) for obj in slot.users)
    if mode is not None:
        source, *others = (replace(one, mode=mode) for one in (source, *others))
    else:
        _refuse_modes(slot.users[0].name, source.mode)
    for obj, other in zip(slot.users[1:], others, strict=True):
        if other.digest != source.digest:
            raise Refused(
                f"{obj.name} moves by the same Action slot as {slot.users[0].name}, but has another mode, rotation "
                "mode or delta transform: give it an Action of its own (Object > Relations > Make Single User)"
            )
    return source


def _read_for(what: Transformable, slot: Slot, curves: Curves) -> Source:
    """What is keyed in a slot, as one of its users has it."""
    _refuse_what_is_taken(what, slot, curves)
    keyed = {}
    for name, prop in what.properties.items():
        channels = [_keys(what, curves.get((what.prefix + prop, index))) for index in range(WIDTHS[prop])]
        if any(keys is not None for keys in channels):
            rest = getattr(what.carrier, prop) if None in channels else channels
            keyed[name] = tuple(rest[i] if keys is None else keys for i, keys in enumerate(channels))
    keyed_mode = _keys(what, curves.get((what.prefix + MODE_PATH, 0)))
    source = Source(
        order=what.carrier.rotation_mode if what.rotation == "rotation_euler" else None,
        keyed=keyed,
        own=own_deltas(what.carrier),
        mode=mode_of(what.carrier) if keyed_mode is None else keyed_mode,
        span=None,
    )
    if any(keys.linear or keys.cycles is not None for keys in source.curves):
        source = replace(source, span=slot.span)
    _refuse_numbers(what, source)
    return source


def mode_of(obj: bpy.types.Object) -> int:
    """The mode of an object as it is now, as `MODE_IDS` counts them; `UNKNOWN` where it is none of them."""
    mode = obj.rigid_motion.mode
    return MODE_IDS.index(mode) if mode in MODE_IDS else UNKNOWN


def own_deltas(obj: bpy.types.Object) -> np.ndarray:
    """The delta transforms that an object has of its own, (10,): remembered while in-betweens are in their place."""
    motion = obj.rigid_motion
    location, quaternion, euler, scale = motion.filled
    own = np.empty(10)
    own[:3] = motion.own_location if location else obj.delta_location
    own[7:] = motion.own_scale if scale else obj.delta_scale
    if obj.rotation_mode in ORDERS:
        angles = np.array(motion.own_euler if euler else obj.delta_rotation_euler)
        own[3:7] = quaternions_from_eulers(angles[None], obj.rotation_mode)[0]
    else:
        own[3:7] = motion.own_quaternion if quaternion else obj.delta_rotation_quaternion
        length = np.sqrt(own[3:7] @ own[3:7])
        own[3:7] = own[3:7] / length if length != 0.0 else (1.0, 0.0, 0.0, 0.0)
    return own


def _keys(what: Transformable, fcurve: bpy.types.FCurve | None) -> Keys | None:
    """The keys of a channel, None where it has no say."""
    if fcurve is None or fcurve.mute:
        return None
    if len(fcurve.modifiers):
        for modifier in fcurve.modifiers:
            plain = modifier.type == "CYCLES" and not modifier.use_restricted_range and not modifier.use_influence
            if not plain and not modifier.mute:
                raise Refused(
                    f"{what.name}: {_label(fcurve)} has a modifier of type {modifier.type.title()}"
                    f"{' with a restricted range or influence' if modifier.type == 'CYCLES' else ''}, which rigid "
                    "in-betweens cannot follow: mute or remove it, or bake the channel (Graph Editor, Channel)"
                )
    if not fcurve.keyframe_points:
        if fcurve.sampled_points:
            raise Refused(
                f"{what.name}: {_label(fcurve)} is sampled and has no keys: turn its samples into keys "
                "(Graph Editor, Channel > Samples to Keys)"
            )
        return None
    return read_keys(fcurve)


def _refuse_what_is_taken(what: Transformable, slot: Slot, curves: Curves) -> None:
    """Raise `Refused` where the delta transforms are not to be had."""
    for block in (what.animated, slot.action):
        if not block.is_editable:
            raise Refused(
                f"{block.name} is linked from another file: make it local first (Object > Relations > Make Local)"
            )
    names = (*what.properties.values(), *(f"delta_{prop}" for prop in what.properties.values()))
    paths = {what.prefix + name for name in names}
    for driver in what.animated.animation_data.drivers:
        if driver.data_path in paths:
            raise Refused(f"{what.name}: {_label(driver)} is driven: remove the driver, or bake it to keys")
    for prop in what.properties.values():
        for index in range(WIDTHS[prop]):
            fcurve = curves.get((f"{what.prefix}delta_{prop}", index))
            if fcurve is not None and not is_filled_in(fcurve):
                if fcurve.group is not None and fcurve.group.name == GROUP:
                    raise Refused(
                        f"{what.name}: {_label(fcurve)} has in-betweens that were turned into keys: "
                        "delete that channel, and they are made anew (Dope Sheet, X)"
                    )
                raise Refused(
                    f"{what.name}: {_label(fcurve)} is animated already: move that animation to a parent, or to "
                    f"{prop.replace('_', ' ')} (Object > Apply > Animated Transforms to Deltas does the reverse)"
                )


def _refuse_numbers(what: Transformable, source: Source) -> None:
    """Raise `Refused` where the keys make no motion, or too long a one."""
    curves = source.curves
    if not curves:
        return
    points = np.concatenate([keys.points for keys in curves])
    shapes = [keys.left for keys in curves] + [keys.right for keys in curves] + [keys.easing_settings for keys in curves]
    values = [value for _, value in source.components() if not isinstance(value, Keys)]
    falls = np.flatnonzero(points[1:, 0] < points[:-1, 0]) + 1
    # From one channel to the next, frames start over.
    in_order = set(falls.tolist()) <= set(itertools.accumulate(len(keys.points) for keys in curves))
    numbers = (points, source.own, values, *(shape for shape in shapes if shape is not None))
    if not (in_order and np.isfinite(np.concatenate([np.ravel(some) for some in numbers])).all()):
        _explain_numbers(what, source)
    keyed = float(points[:, 0].max() - points[:, 0].min())
    first, last = source.frame_range
    if keyed > MOST_FRAMES:
        raise Refused(
            f"{what.name} has keys over {keyed:.0f} frames, at most {MOST_FRAMES} can be filled in: "
            "delete the keys that are far off"
        )
    if last - first > MOST_FRAMES:
        raise Refused(
            f"{what.name} goes on outside of its keys for all {last - first} frames of its scene, at most {MOST_FRAMES} "
            "can be filled in: give the scene fewer frames, or the channels constant extrapolation and no cycles"
        )
    try:
        source.key_frames  # noqa: B018 - raises where cycles make too many
    except ValueError as problem:
        raise Refused(f"{what.name}: {problem}") from None


def _explain_numbers(what: Transformable, source: Source) -> None:
    """Raise `Refused` with the first number of a source that is not finite, or the first channel out of order."""
    for row, keys in source.components():
        label = f"Rotation {'XYZ'[row - 3]}" if source.order is not None and 3 <= row < 6 else COMPONENTS[row]
        if not isinstance(keys, Keys):
            if not math.isfinite(keys):
                raise Refused(f"{what.name}: {label} is not a finite number: set it anew (sidebar, Item)")
            continue
        parts = {
            "": keys.points,
            "left handle of ": keys.left,
            "right handle of ": keys.right,
            "easing of ": None if keys.easing_settings is None else keys.easing_settings.T,
        }
        for part, numbers in parts.items():
            if numbers is not None and not np.isfinite(numbers).all():
                key = int(np.argwhere(~np.isfinite(numbers))[0, 0]) + 1
                raise Refused(
                    f"{what.name}: {part}key {key} of {label} is not a finite number: delete it (Dope Sheet, X)"
                )
        if np.any(np.diff(keys.times) < 0.0):
            raise Refused(
                f"{what.name}: the keys of {label} are not in the order of their frames: "
                "move one of them and back (Dope Sheet, G)"
            )
    raise Refused(
        f"{what.name}: a delta transform is not a finite number: set it anew (Object Properties, Delta Transform)"
    )


def _refuse_modes(name: str, mode: int | Keys) -> None:
    """Raise `Refused` where an object, or a key of its mode channel, has what is no mode."""
    if not isinstance(mode, Keys):
        if mode == UNKNOWN:
            raise Refused(f"{name} has a mode that this version does not know: choose another")
        return
    known = (mode.values > -0.5) & (mode.values < len(MODE_IDS) - 0.5) & np.isfinite(mode.times)
    if not known.all():
        raise Refused(
            f"{name}: key {int(np.argmin(known)) + 1} of the mode channel has no mode that this version knows: "
            "delete it (Dope Sheet, X), or choose a mode for the whole object"
        )


def _label(fcurve: bpy.types.FCurve) -> str:
    """A channel as the Dope Sheet names it."""
    name = fcurve.data_path.rpartition(".")[2]
    axes = "WXYZ" if name.endswith("quaternion") else "XYZ"
    return f"{name.replace('_', ' ').title()} {axes[fcurve.array_index]}" if fcurve.array_index < len(axes) else name
