"""Ghosts of skinned meshes, recorded on frames that were shown, since they cannot be computed for other frames.

They are kept in the world, with few triangles, until keys of the armature or the mesh change. Unkeyed changes of the
pose do not count.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import bpy
import gpu
import numpy as np

from ...animation.actions.channels import key_points
from ...animation.actions.slots import active_fcurves
from ...animation.transforms import Transform, transform_of
from ...blender import existing, original_uid, persistent
from ...handlers import append_handlers, remove_handlers
from ..targets import selected_in_view
from .ghosts import fewer_triangles, ghost_frames
from .settings import overlay_settings

MAX_SEEN_BODIES = 16
"""The most meshes that are kept."""


class OnCard(NamedTuple):
    """The appearance of a ghost, on the graphics card."""

    triangles: gpu.types.GPUBatch | None
    edges: gpu.types.GPUBatch | None

    corners: np.ndarray
    """The homogeneous corners of its bounding box, shape (8, 4)."""


@dataclass(eq=False)
class SeenBody:
    """The recorded places of one mesh, in the world."""

    mesh: int
    """The session id of the mesh data."""

    keys: bytes
    """The digest of the armature's keys."""

    count: int
    """The number of vertices of the mesh."""

    kept: np.ndarray
    """The indices of the vertices that are kept, (v,)."""

    triangles: np.ndarray
    """The triangles, as indices into the kept vertices, (t, 3)."""

    places: dict[float, np.ndarray] = field(default_factory=dict)
    """The kept vertices in the world, (v, 3), by the frame of the scene."""

    batches: dict[float, OnCard] = field(default_factory=dict)
    """Their batches, by the frame of the scene."""


_seen: dict[int, SeenBody] = {}
"""Recorded meshes by the session id of their object; the last recorded come last."""

_known_keys: dict[int, tuple[bytes, np.ndarray]] = {}
"""Results of `_keys` by the session ids of armatures."""


def bodies_of(transform: Transform) -> list[bpy.types.Object]:
    """Return the mesh objects that an armature deforms: the armature of a bone, or of one of these objects."""
    obj = transform.animated
    rig = obj if obj.type == "ARMATURE" else obj.find_armature()
    if rig is None:
        return []
    # A skinned mesh is a child of the rig, or in one of its collections.
    neighbours = [item for collection in rig.users_collection for item in collection.objects]
    return [
        item
        for item in dict.fromkeys((*rig.children, *neighbours))
        if item.type == "MESH" and item.find_armature() == rig
    ]


def _rigs(context: Any) -> dict[bpy.types.Object, list[bpy.types.Object]]:
    """Return the selected armatures with the visible objects that they deform."""
    transforms = {one.animated: one for one in map(transform_of, selected_in_view(context))}
    found = {bodies[0].find_armature(): bodies for one in transforms.values() if (bodies := bodies_of(one))}
    return {rig: [body for body in bodies if body.visible_get()] for rig, bodies in found.items() if rig is not None}


def _keys(rig: bpy.types.Object) -> tuple[bytes, np.ndarray]:
    """Return a digest of the keys in an armature's Action, and their frames (k,); read again only after an edit."""
    if rig.session_uid not in _known_keys:
        summary, frames = hashlib.blake2b(digest_size=16), [np.empty(0)]
        for fcurve in active_fcurves(rig):
            frames.append(key_points(fcurve)[:, 0].round(2))
            for name in ("co", "handle_left", "handle_right"):
                summary.update(key_points(fcurve, name).tobytes())
        _known_keys[rig.session_uid] = summary.digest(), np.unique(np.concatenate(frames))
    return _known_keys[rig.session_uid]


def _frames_with_ghosts(rig: bpy.types.Object, scene: bpy.types.Scene) -> np.ndarray:
    """Return the frames of the scene that have ghosts."""
    step = overlay_settings(scene).frames_between_ghosts
    return ghost_frames(scene.frame_start, scene.frame_end, step, _keys(rig)[1])


def note(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Record the meshes of the selected armatures on the frame that is shown, if it has a ghost."""
    settings, now = overlay_settings(scene), float(scene.frame_current_final)
    if settings.show_ghosts and settings.show_bodies and depsgraph.mode == "VIEWPORT":
        for rig, bodies in _rigs(bpy.context).items():
            for body in bodies if np.any(np.abs(_frames_with_ghosts(rig, scene) - now) < 1e-3) else ():
                _record_body(body, now, _keys(rig)[0], depsgraph)


def _record_body(body: bpy.types.Object, now: float, keys: bytes, depsgraph: bpy.types.Depsgraph) -> None:
    evaluated: Any = body.evaluated_get(depsgraph)
    mesh = evaluated.data
    mesh.calc_loop_triangles()
    if not len(mesh.loop_triangles):  # for example in Edit Mode
        return
    places: np.ndarray = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", places)
    places = places.reshape(-1, 3)
    seen = _seen.pop(body.session_uid, None)
    if seen is None or seen.keys != keys or seen.count != len(places):
        corners: np.ndarray = np.empty(3 * len(mesh.loop_triangles), np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        seen = SeenBody(
            existing(body.data).session_uid, keys, len(places), *fewer_triangles(places, corners.reshape(-1, 3))
        )
    matrix = np.array(evaluated.matrix_world, dtype=np.float32)
    seen.places[now] = places[seen.kept] @ matrix[:3, :3].T + matrix[:3, 3]
    seen.batches.pop(now, None)
    _seen[body.session_uid] = seen
    while len(_seen) > MAX_SEEN_BODIES:
        del _seen[next(iter(_seen))]


def seen_bodies(context: Any) -> Iterator[tuple[bpy.types.Object, SeenBody, np.ndarray]]:
    """Yield the meshes of the selected armatures that were recorded with the present keys.

    Each comes as the armature, the recorded mesh, and the frames that have ghosts.
    """
    for rig, bodies in _rigs(context).items():
        for body in bodies:
            seen = _seen.get(body.session_uid)
            if seen is not None and seen.keys == _keys(rig)[0]:
                yield rig, seen, _frames_with_ghosts(rig, context.scene)


@persistent
def _on_update(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    if any(isinstance(update.id, bpy.types.Action | bpy.types.Object) for update in depsgraph.updates):
        _known_keys.clear()
    meshes = {original_uid(update) for update in depsgraph.updates if isinstance(update.id, bpy.types.Mesh)}
    for uid in [uid for uid, seen in _seen.items() if seen.mesh in meshes]:
        del _seen[uid]


@persistent
def _on_undo(*_: object) -> None:
    _known_keys.clear()


@persistent
def _on_file(*_: object) -> None:
    _known_keys.clear()
    _seen.clear()


HANDLERS: dict[str, Callable] = {
    "frame_change_post": persistent(note),
    "depsgraph_update_post": _on_update,
    "undo_post": _on_undo,
    "redo_post": _on_undo,
    "load_post": _on_file,
}


def register() -> None:
    append_handlers(HANDLERS)


def unregister() -> None:
    remove_handlers(HANDLERS)
    _on_file()
