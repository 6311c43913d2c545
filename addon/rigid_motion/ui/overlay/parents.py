"""Where parents carry what hangs on them, frame by frame: as their keys and modes have it, without playing the scene.

That is known of parents that move by keys alone. Where a constraint, a driver, strips or a simulation has a part in it,
the overlay takes parents as they are on the current frame. Frames are those of the scene.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np
from mathutils import Matrix

from ...animation.actions.slots import SlotTransform
from ...animation.baking.channel_maps import shown
from ...animation.baking.followers import MOVING, NotPromised, not_promised
from ...animation.queries.keyed import active_places_of, sources_of
from ...animation.transforms import WIDTHS, Transform, shows_differences, transform_of
from ...animation.transforms.posing import Hierarchy
from ...motion.affine import AffineMaps

SAME = 1e-5
"""Components of directions that differ by less are the same in single precision."""

WHOLE_OBJECTS = ("OBJECT", "ARMATURE")
"""Types of parents that carry an object by their own transform."""

Followers = dict[bpy.types.Object, NotPromised]
"""The bones of rigs that follow constraints or drivers, as far as they were looked up."""


class Parents:
    """What carries an object or a bone, read from keys.

    Parameters
    ----------
    target : Transform
    followers : dict
        Looked up once for several targets.
    """

    def __init__(self, target: Transform, followers: Followers) -> None:
        self.target = target
        self.above = list(_above(target))
        places = active_places_of(self.above) if self.above else {}
        sources = dict(zip(places, sources_of(list(places.values())), strict=True))
        self.sources = {transform: source for transform, source in sources.items() if source is not None}
        self.move_by_keys = bool(self.sources) and all(
            _moves_by_keys(one, followers) and (one in self.sources or not _is_keyed(places.get(one)))
            for one in self.above
        )
        """Whether they move, and by keys alone."""
        self.ids = {one.animated.session_uid for one in self.above}
        self.ids |= {place.slot.action.session_uid for place in places.values()}
        """Session ids of the data-blocks that decide on it."""

    @property
    def digest(self) -> tuple:
        """Differs wherever anything differs that decides where they carry the target."""
        found: list[object] = [_hung(self.target)]
        for one in self.above:
            source = self.sources.get(one)
            keyed = source.keyed if source is not None else ()
            stands = [getattr(one.carrier, prop)[:] for name, prop in one.properties.items() if name not in keyed]
            rest = None if source is None else (source.digest, tuple(source.rest.items()))
            found.append((one.animated.session_uid, one.prefix, rest, tuple(stands), _hung(one)))
        return tuple(found)

    def spaces(self, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray | None]:
        """From the space of the target's location channels into the world.

        Parameters
        ----------
        frames : array, shape (n,)

        Returns
        -------
        maps : AffineMaps, shape (n,)
        turned : array, shape (n, 3, 3), or None
            What stands between the target's rotation and that space, see `space_of_bone`. None where nothing does.
        """
        if not self.target.is_part:
            return self._carrying(self.target.carrier, frames), None
        bone = self.target.carrier
        hierarchy, posed = self._posed(bone, frames, _identity(len(frames)))
        offset = hierarchy.offsets[-1]
        above = posed[-2] if bone.parent else _identity(len(frames))
        along = above.axes @ offset.axes if bone.bone.use_local_location else above.axes
        turned = np.linalg.inv(along) @ posed[-1].axes
        maps = self._world(self.target.animated, frames) @ AffineMaps(along, above.at(offset.origins))
        return maps, None if np.abs(turned - np.eye(3)).max() < SAME else turned

    def _world(self, obj: bpy.types.Object, frames: np.ndarray) -> AffineMaps:
        return self._carrying(obj, frames) @ self._channels(transform_of(obj), frames)

    def _carrying(self, obj: bpy.types.Object, frames: np.ndarray) -> AffineMaps:
        parent = obj.parent
        if parent is None:
            return _identity(len(frames))
        carried = self._world(parent, frames)
        if obj.parent_type == "BONE":
            bone = parent.pose.bones[obj.parent_bone]
            _, posed = self._posed(bone, frames, self._channels(transform_of(bone), frames))
            carried = carried @ posed[-1] @ _maps(Matrix.Translation((0.0, bone.bone.length, 0.0)))
        return carried @ _maps(obj.matrix_parent_inverse)

    def _posed(
        self, bone: bpy.types.PoseBone, frames: np.ndarray, channels: AffineMaps
    ) -> tuple[Hierarchy, AffineMaps]:
        """Where a bone with these channels (n,) and those above it are in the space of the rig, shape (bones, n)."""
        above = list(reversed(bone.parent_recursive))
        maps = [*(self._channels(transform_of(one), frames) for one in above), channels]
        hierarchy = Hierarchy([*above, bone])
        stacked = AffineMaps(np.stack([one.axes for one in maps]), np.stack([one.origins for one in maps]))
        return hierarchy, hierarchy.posed(stacked)

    def _channels(self, transform: Transform, frames: np.ndarray) -> AffineMaps:
        source = self.sources.get(transform)
        if source is not None:
            return shown(transform, source, frames)[1]
        return _identity(len(frames)) @ _maps(transform.carrier.matrix_basis)


def _above(target: Transform) -> Iterator[Transform]:
    """All that carries something: the bones that it hangs on, and the objects."""
    obj = target.animated
    if target.is_part:
        yield from map(transform_of, target.carrier.parent_recursive)
        yield transform_of(obj)
    while (parent := obj.parent) is not None:
        if obj.parent_type == "BONE" and (bone := parent.pose.bones.get(obj.parent_bone)) is not None:
            yield from map(transform_of, (bone, *bone.parent_recursive))
        yield transform_of(parent)
        obj = parent


def _moves_by_keys(transform: Transform, followers: Followers) -> bool:
    """Whether nothing but keys of its Action has a part in where something is."""
    obj = transform.animated
    if transform.is_part:
        if obj not in followers:
            followers[obj] = not_promised(obj)
        return transform.carrier.name not in followers[obj]
    data, body = obj.animation_data, obj.rigid_body
    in_strips = data is not None and (data.use_tweak_mode or any(track.strips for track in data.nla_tracks))
    driven = data is not None and any(driver.data_path.removeprefix("delta_") in MOVING for driver in data.drivers)
    constrained = any(not one.mute and one.influence > 0.0 and not shows_differences(one) for one in obj.constraints)
    return not (in_strips or driven or constrained or body is not None) and _hangs_on_a_whole(obj)


def _hangs_on_a_whole(obj: bpy.types.Object) -> bool:
    """Whether an object hangs on nothing, on an object or on a bone: on vertices it goes where these are deformed."""
    if obj.parent is None or obj.parent_type in WHOLE_OBJECTS:
        return True
    bones = obj.parent.pose.bones if obj.parent_type == "BONE" and obj.parent.pose is not None else {}
    return obj.parent_bone in bones and not bones[obj.parent_bone].bone.use_relative_parent


def _is_keyed(place: SlotTransform | None) -> bool:
    return place is not None and any(path.removeprefix(place.prefix) in WIDTHS for path, _ in place.curves)


def _hung(transform: Transform) -> tuple:
    """How something hangs on its parent."""
    if not transform.is_part:
        obj = transform.carrier
        return obj.parent_type, obj.parent_bone, tuple(map(tuple, obj.matrix_parent_inverse))
    bone = transform.carrier.bone
    settings = bone.use_inherit_rotation, bone.inherit_scale, bone.use_local_location, bone.use_connect
    return (*settings, bone.length, tuple(map(tuple, bone.matrix_local)))


def _identity(count: int) -> AffineMaps:
    return AffineMaps(np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 3)))


def _maps(matrix: Matrix) -> AffineMaps:
    numbers = np.array(matrix, dtype=np.float64)
    return AffineMaps(numbers[:3, :3], numbers[:3, 3])
