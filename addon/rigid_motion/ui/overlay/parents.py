"""Motion of parents, frame by frame: computed from their keys and modes, without playing the scene.

This works for parents that move by keys alone. If constraints, drivers, NLA strips or a simulation take part, the
overlay uses the parents as they are on the current frame. Frames are those of the scene.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator
from dataclasses import replace

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.actions.slots import Binding
from ...animation.baking.layers import binding_below, is_plain, strips_of
from ...animation.baking.motions import MOVING_CHANNELS, not_promised, shown
from ...animation.evaluation.sources import KeyedTransform
from ...animation.queries.keyed import active_bindings, sources_of
from ...animation.transforms import Transform, transform_of
from ...animation.transforms.posing import Hierarchy
from ...blender import existing, pose_bones
from ...motion.affine import AffineMaps

MAX_DIRECTION_ROUNDING = 1e-5
"""Directions whose components differ by less are the same in single precision."""

MOST_SPACES = 32
"""The most results of `Parents.spaces` that are kept: while an object is dragged, its parents stay the same."""

_spaces: dict[tuple, tuple[AffineMaps, np.ndarray | None]] = {}
"""Results of `Parents.spaces` by everything they depend on."""

WHOLE_OBJECTS = ("OBJECT", "ARMATURE")
"""Types of parents whose own transform carries a child object."""


class CarriedTargets:
    """Several targets and their parents, each read once, and computed once for the same frames."""

    def __init__(self) -> None:
        self._not_promised = functools.cache(not_promised)
        self.hierarchy = functools.cache(_hierarchy)
        self._read: dict[Transform, tuple[Binding | None, KeyedTransform | None]] = {}
        self._channels: dict[tuple[Transform, bytes], AffineMaps] = {}
        self._posed: dict[tuple[Transform, bytes], AffineMaps] = {}

    def read(self, transforms: Iterable[Transform]) -> dict[Transform, tuple[Binding | None, KeyedTransform | None]]:
        """Return the binding and the source of each transform, None where it has none."""
        transforms = list(transforms)
        if missing := [transform for transform in transforms if transform not in self._read]:
            bindings = active_bindings(missing)
            for item in missing:
                # Other bones of a rig with a layer are keyed in the strip below.
                keyed = (binding := bindings.get(item)) is not None and binding.is_keyed
                if item.motion.base is None and not keyed and is_plain(item.animated):
                    bindings[item] = binding_below(item, existing(strips_of(item.animated)))
            sources = dict(zip(bindings, sources_of(list(bindings.values())), strict=True))
            for item, source in sources.items():
                if source is not None and item.motion.base is not None:
                    (_, below), *_ = self.read([transform_of(item.motion.base)]).values()
                    sources[item] = source if below is None else replace(source, carried=below.seen_range)
            self._read |= {item: (bindings.get(item), sources.get(item)) for item in missing}
        return {transform: self._read[transform] for transform in transforms}

    def follows(self, bone: Transform) -> bool:
        """Return whether a bone, or a bone above it, follows constraints or drivers."""
        return bone.carrier.name in self._not_promised(bone.animated)

    def channels(self, transform: Transform, frames: np.ndarray) -> AffineMaps:
        """Return the maps of an object's or a bone's own channels on frames (n,), in its mode."""
        key = transform, frames.tobytes()
        if key not in self._channels:
            _, source = self._read[transform]
            if source is None:
                self._channels[key] = identity(len(frames)) @ maps_of(transform.carrier.matrix_basis)
            else:
                self._channels[key] = shown(transform, source, frames)[1]
        return self._channels[key]

    def posed(self, bone: bpy.types.PoseBone, frames: np.ndarray) -> AffineMaps:
        """Return the maps of a bone in the space of its rig on frames (n,)."""
        transform = transform_of(bone)
        key = transform, frames.tobytes()
        if key not in self._posed:
            hierarchy, numbers = self.hierarchy(bone.id_data)
            above = None if bone.parent is None else self.posed(bone.parent, frames)
            self._posed[key] = hierarchy.placed(numbers[bone.name], self.channels(transform, frames), above)
        return self._posed[key]


def _hierarchy(rig: bpy.types.Object) -> tuple[Hierarchy, dict[str, int]]:
    """Return the bones of a rig, and their indices by name."""
    return Hierarchy(list(pose_bones(rig))), {bone.name: number for number, bone in enumerate(pose_bones(rig))}


class Parents:
    """The parents of an object or a bone, read from keys.

    Parameters
    ----------
    target : Transform
    carried : CarriedTargets
        Shared by all targets that are drawn together.
    itself : bool
        Also read the target, to know where it is itself.
    """

    def __init__(self, target: Transform, carried: CarriedTargets, *, itself: bool = False) -> None:
        self.target, self._carried = target, carried
        self._read = carried.read((target, *_ancestors(target)) if itself else _ancestors(target))
        self.known = all(
            _moves_by_keys(one, carried) and (source is not None or binding is None or not binding.is_keyed)
            for one, (binding, source) in self._read.items()
        )
        """True if nothing but keys moves the parents."""
        self.move_by_keys = self.known and any(source is not None for _, source in self._read.values())
        """True if the parents move, and by keys alone."""
        self.carriers = frozenset(self._read)
        """All its parents, with the target if that is read, too."""
        self.ids = {item.animated.session_uid for item in self._read}
        self.ids |= {binding.slot.action.session_uid for binding, _ in self._read.values() if binding is not None}
        """Session ids of the data-blocks that determine the motion of the parents."""

    @property
    def digest(self) -> tuple:
        """A digest of everything that determines where the parents carry the target."""
        result: list[object] = [_parenting(self.target)]
        for one, (_, source) in self._read.items():
            keyed = source.keyed if source is not None else ()
            stands = [getattr(one.carrier, prop)[:] for name, prop in one.properties.items() if name not in keyed]
            rest = None if source is None else (source.digest, tuple(source.rest.items()))
            result.append((*one.identity, one.order, rest, tuple(stands), one.original().tobytes(), _parenting(one)))
        return tuple(result)

    def spaces(self, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray | None]:
        """Return the maps from the space of the target's location channels into the world.

        Parameters
        ----------
        frames : array, shape (n,)

        Returns
        -------
        maps : AffineMaps, shape (n,)
        turned : array, shape (n, 3, 3), or None
            Rotations from the axes of that space to those of the target's rotation, see `kinds.Space`; None if all are
            the identity.
        """
        key = self.target.identity, self.digest, frames.tobytes()
        if key not in _spaces:
            if len(_spaces) >= MOST_SPACES:
                _spaces.clear()
            _spaces[key] = self._spaces(frames)
        return _spaces[key]

    def _spaces(self, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray | None]:
        if not self.target.is_part:
            return self._parent_maps(self.target.animated, frames), None
        if (base := self.target.motion.base) is not None:
            return self._world(base, frames), None
        bone, stands = self.target.pose_bone, identity(len(frames))
        hierarchy, numbers = self._carried.hierarchy(self.target.animated)
        number = numbers[bone.name]
        above = None if bone.parent is None else self._carried.posed(bone.parent, frames)
        placed, offset = hierarchy.placed(number, stands, above), hierarchy.offsets[number]
        above = stands if above is None else above
        along = above.axes @ offset.axes if bone.bone.use_local_location else above.axes
        turned = np.linalg.inv(along) @ placed.axes
        maps = self._world(self.target.animated, frames) @ AffineMaps(along, above.at(offset.origins))
        return maps, unless_same(turned)

    def places(self, frames: np.ndarray) -> AffineMaps:
        """Return the maps of the target itself in the world on frames (n,)."""
        world = self._world(self.target.animated, frames)
        return world @ self._carried.posed(self.target.pose_bone, frames) if self.target.is_part else world

    def _world(self, obj: bpy.types.Object, frames: np.ndarray) -> AffineMaps:
        return self._parent_maps(obj, frames) @ self._carried.channels(transform_of(obj), frames)

    def _parent_maps(self, obj: bpy.types.Object, frames: np.ndarray) -> AffineMaps:
        parent = obj.parent
        if parent is None:
            return identity(len(frames))
        carried = self._world(parent, frames)
        if obj.parent_type == "BONE":
            bone = pose_bones(parent)[obj.parent_bone]
            tail = maps_of(Matrix.Translation((0.0, bone.bone.length, 0.0)))
            carried = carried @ self._carried.posed(bone, frames) @ tail
        return carried @ maps_of(obj.matrix_parent_inverse)


def follows_keys(target: Transform, parents: Parents) -> bool:
    """Return whether the parents' keys alone carry a target along while its own keys are edited.

    The times of a tweaked strip may differ from those of the scene. So its object is drawn with the parents of the
    current frame, except in layers.
    """
    obj = target.animated
    is_in_strip = existing(obj.animation_data).use_tweak_mode and not (target.motion.base and is_plain(obj))
    return parents.move_by_keys and not is_in_strip


def unless_same(turned: np.ndarray) -> np.ndarray | None:
    """Return rotations (..., 3, 3), or None if all of them are the identity."""
    return None if np.abs(turned - np.eye(3)).max() < MAX_DIRECTION_ROUNDING else turned


def _ancestors(target: Transform) -> Iterator[Transform]:
    """Yield all parents of a transform: bones, and objects."""
    obj = target.animated
    if target.is_part and (base := target.motion.base) is not None:
        yield from (transform_of(base), *_ancestors(transform_of(base)))
        return
    if target.is_part:
        yield from map(transform_of, target.pose_bone.parent_recursive)
        yield transform_of(obj)
    while (parent := obj.parent) is not None:
        if obj.parent_type == "BONE" and (bone := pose_bones(parent).get(obj.parent_bone)) is not None:
            yield from map(transform_of, (bone, *bone.parent_recursive))
        yield transform_of(parent)
        obj = parent


def _moves_by_keys(transform: Transform, carried: CarriedTargets) -> bool:
    """Return whether keys of its Action alone determine the motion of a transform."""
    obj = transform.animated
    if transform.is_part:
        return not carried.follows(transform)
    data, body = obj.animation_data, obj.rigid_body
    in_strips = data is not None and (data.use_tweak_mode or any(track.strips for track in data.nla_tracks))
    in_strips = in_strips and not is_plain(obj)
    driven = data is not None and any(
        driver.data_path.removeprefix("delta_") in MOVING_CHANNELS for driver in data.drivers
    )
    constrained = any(not constraint.mute and constraint.influence > 0.0 for constraint in obj.constraints)
    return not (in_strips or driven or constrained or body is not None) and _has_no_deforming_parent(obj)


def _has_no_deforming_parent(obj: bpy.types.Object) -> bool:
    """Return whether an object has no parent, or an object or bone as a parent that carries it as a whole.

    An object parented to vertices follows their deformation.
    """
    if obj.parent is None or obj.parent_type in WHOLE_OBJECTS:
        return True
    pose = obj.parent.pose if obj.parent_type == "BONE" else None
    bone = None if pose is None else pose.bones.get(obj.parent_bone)
    return bone is not None and not bone.bone.use_relative_parent


def _parenting(transform: Transform) -> tuple:
    """Return the settings of the parenting of an object or bone."""
    if not transform.is_part:
        obj = transform.animated
        return obj.parent_type, obj.parent_bone, tuple(row[:] for row in obj.matrix_parent_inverse[:])
    bone = transform.pose_bone.bone
    settings = bone.use_inherit_rotation, bone.inherit_scale, bone.use_local_location, bone.use_connect
    return (*settings, bone.length, tuple(row[:] for row in bone.matrix_local[:]))


def identity(*shape: int) -> AffineMaps:
    """Return identity maps of this shape."""
    return AffineMaps(np.tile(np.eye(3), (*shape, 1, 1)), np.zeros((*shape, 3)))


def maps_of(matrix: Matrix) -> AffineMaps:
    """Return a matrix as a map."""
    numbers = np.array(matrix, dtype=np.float64)
    return AffineMaps(numbers[:3, :3], numbers[:3, 3])
