"""Whole bodies evaluated by the running Blender: the bones of armatures, or hierarchies of objects.

The skin of an armature is the surface of all its meshes together, in the rest pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import conjugate, rotate

from .looks import looking, matrix_of, unscaled
from .matrices import filled, rigid
from .recordings import Trajectory, TrajectoryError, shown
from .rest_bodies import MAX_JOINTS_PER_VERTEX, MOST_VERTICES, RestBody, Skin, likely_metres, tails_of
from .sampling import OF_JOINTS, Moments, sampled

if TYPE_CHECKING:
    import bpy

AT_CHILD = 0.01
"""A bone ends at its child if the distance is within this fraction of the bone's length."""


@contextmanager
def in_blender(path: Path, again: str) -> Iterator[None]:
    """Raise TrajectoryError if this is not Blender, or reading a file fails in a way that no importer handles.

    `again` is the advice for names that are not valid text: Blender accepts them, but Python fails, sometimes with a
    SystemError.
    """
    try:
        import bpy  # noqa: F401
    except ImportError:
        raise TrajectoryError(path, "this needs Blender", "run it in Blender, or pip install bpy") from None
    try:
        yield
    except (UnicodeDecodeError, SystemError):
        raise TrajectoryError(path, "a name in this file is not text", again) from None
    except MemoryError:
        raise TrajectoryError(path, "this file needs more memory than there is", "split the recording") from None


@dataclass(frozen=True)
class RigJoints:
    """The bones of an armature that are read as joints."""

    names: tuple[str, ...]
    parents: np.ndarray
    """Shape (joints,): the index of the nearest ancestor that is a joint, -1 for none."""

    left_out: tuple[str, ...] = ()
    """Bones that do not deform, and only control others."""

    @property
    def remark(self) -> str:
        count = len(self.names)
        return f"took the {count} bones that deform of {count + len(self.left_out)}" if self.left_out else ""


def armature_of(rig: bpy.types.Object) -> bpy.types.Armature:
    """Return the data of an armature object."""
    return cast("bpy.types.Armature", rig.data)


def joints_of(rig: bpy.types.Object) -> RigJoints:
    """Return the deforming bones, or all bones if none deforms; parents before their children."""
    bones = list(armature_of(rig).bones)  # Blender lists parents before children.
    kept = [bone for bone in bones if bone.use_deform] or bones
    numbers = {bone.name: number for number, bone in enumerate(kept)}
    nearest: dict[str, int] = {}
    for bone in bones:
        above = nearest[bone.parent.name] if bone.parent else -1
        nearest[bone.name] = numbers.get(bone.name, above)
    parents = [nearest[bone.parent.name] if bone.parent else -1 for bone in kept]
    left = tuple(bone.name for bone in bones if bone.name not in numbers)
    return RigJoints(tuple(numbers), np.array(parents, dtype=np.int64), left)


def whole_body(
    path: Path,
    rig: bpy.types.Object,
    name: str,
    moments: Moments,
    metres_per_unit: float = 1.0,
    scale: float | None = None,
    *,
    made_up: bool = False,
) -> Trajectory:
    """Return the whole skeleton of an armature, and its skin.

    Parameters
    ----------
    path : Path
        The file of the armature, for errors.
    rig : bpy.types.Object
        An armature, of the open file or linked.
    name : str
        The name of the body.
    moments : Moments
        The moments to sample; more are added where the motion bends in between.
    metres_per_unit : float
    scale : float, optional
        Metres per unit as given by the user. Without it, the size shows whether `metres_per_unit` is likely.
    made_up : bool
        Whether an importer made up the ends of the bones.

    Raises
    ------
    TrajectoryError
        If the armature has no bones, or too many for the number of frames.
    """
    joints = joints_of(rig)
    if not joints.names:
        raise TrajectoryError(path, f"{shown(rig.name)} has no bones at all", "export it again with its skeleton")
    meshes, metres = carried_by(rig), scale or likely_unit(rig, metres_per_unit)
    with looking(path, meshes, rig, joints.names) as look:
        seen = sampled(moments, lambda frames: unscaled(look(frames)), joints.parents, OF_JOINTS, metres)
    # Numbers of a damaged file that are not finite or too large are reported by the repair.
    with np.errstate(invalid="ignore", over="ignore"):
        rest_body = _rest_body(rig, joints, look.first, meshes, made_up=made_up)
    return seen.as_body(name, moments, metres, rest_body, metres_per_unit, joints.remark)


def body_of_objects(
    path: Path,
    objects: Sequence[bpy.types.Object],
    parents: np.ndarray,
    names: Sequence[str],
    title: str,
    moments: Moments,
    scale: float | None,
) -> Trajectory:
    """Return objects as the joints of a whole body, with the rest pose on the first frame.

    `parents` holds the index of each object's parent among them, -1 for none, shape (objects,).
    """
    with looking(path, objects) as look:
        first = look(moments.frames[:1])
        rest = filled(Poses(first.positions, first.quaternions))[:, 0]
        metres = scale or likely_metres(parents, rest.positions)
        seen = sampled(moments, lambda frames: unscaled(look(frames)), parents, OF_JOINTS, metres)
    rest_body = RestBody(tuple(names), parents, rest, tails_of(rest, parents))
    return seen.as_body(title, moments, metres, rest_body)


def likely_unit(rig: bpy.types.Object, metres_per_unit: float = 1.0) -> float:
    """Return the likely length of the unit of a rig, judged by the rest positions of its joints."""
    joints, there = joints_of(rig), matrix_of(rig)
    with np.errstate(invalid="ignore", over="ignore"):
        heads = np.array([armature_of(rig).bones[name].head_local for name in joints.names]) @ there[:3, :3].T
    return likely_metres(joints.parents, heads, metres_per_unit)


def _rest_body(
    rig: bpy.types.Object,
    joints: RigJoints,
    matrices: dict[bpy.types.Object, np.ndarray],
    meshes: Sequence[bpy.types.Object],
    *,
    made_up: bool,
) -> RestBody:
    bones, there = armature_of(rig).bones, matrices[rig]
    rest = rigid(there @ np.array([bones[name].matrix_local for name in joints.names]))
    rest = filled(Poses(rest.positions[:, None], rest.quaternions[:, None]))[:, 0]
    ends = np.array([bones[name].tail_local for name in joints.names]) @ there[:3, :3].T + there[:3, 3]
    tails = rotate(conjugate(rest.quaternions), ends - rest.positions)
    largest = 0.0 if made_up else float(np.ptp(rest.positions, axis=0).max())
    tails = _shortened(tails, rest.positions, joints.parents, largest)
    skin = skin_of(meshes, joints.names, matrices)
    free = None if made_up else _free_end_lengths(tails, rest, joints.parents)
    return RestBody(joints.names, joints.parents, rest, np.ascontiguousarray(tails), skin, free)


def _free_end_lengths(tails: np.ndarray, rest: Poses, parents: np.ndarray) -> np.ndarray:
    """Return the lengths of bones that do not end at a child, shape (joints,), and 0 for the others."""
    lengths, hanging = np.linalg.norm(tails, axis=-1), np.flatnonzero(parents >= 0)
    ends, gaps = rest.positions + rotate(rest.quaternions, tails), np.full(len(parents), np.inf)
    np.minimum.at(gaps, parents[hanging], np.linalg.norm(ends[parents[hanging]] - rest.positions[hanging], axis=-1))
    return np.where(gaps > AT_CHILD * lengths, lengths, 0.0)


def _shortened(tails: np.ndarray, heads: np.ndarray, parents: np.ndarray, largest: float) -> np.ndarray:
    """Return tails (joints, 3) of bones, no longer than the distance to their farthest child, or else to their parent.

    Bones up to `largest` are kept: bones longer than a body come from an importer that assumed other units.
    """
    hanging = np.flatnonzero(parents >= 0)
    gaps = np.linalg.norm(heads[hanging] - heads[parents[hanging]], axis=-1)
    reach = np.zeros(len(parents))
    np.maximum.at(reach, parents[hanging], gaps)
    ends = reach[hanging] == 0.0
    reach[hanging[ends]] = gaps[ends]
    lengths = np.linalg.norm(tails, axis=-1)
    longer = (reach > 0.0) & (lengths > np.maximum(reach, largest))
    return np.where(longer[:, None], tails * (reach / np.where(longer, lengths, 1.0))[:, None], tails)


def carried_by(rig: bpy.types.Object) -> list[bpy.types.Object]:
    """Return the mesh objects that an armature deforms; none if they have too many vertices."""
    import bpy

    from rigid_motion.animation.transforms.sizes import deforms

    meshes = [obj for obj in bpy.data.objects if obj.type == "MESH" and obj.data and deforms(rig, obj)]
    return meshes if sum(len(_mesh_of(obj).vertices) for obj in meshes) <= MOST_VERTICES else []


def _mesh_of(obj: bpy.types.Object) -> bpy.types.Mesh:
    return cast("bpy.types.Mesh", obj.data)


def skin_of(
    meshes: Sequence[bpy.types.Object], joints: Sequence[str], matrices: Mapping[bpy.types.Object, np.ndarray]
) -> Skin | None:
    """Return the skin of mesh objects, or None if there are no triangles.

    Parameters
    ----------
    meshes : sequence of bpy.types.Object
    joints : sequence of str
        The bones. Vertices in no vertex group of these are carried by the first.
    matrices : mapping of bpy.types.Object to array, shape (4, 4)
        The world matrix of each mesh object.
    """
    numbers = {name: number for number, name in enumerate(joints)}
    vertices, triangles, carriers, weights, before = [], [], [], [], 0
    for obj in meshes:
        mesh, there = _mesh_of(obj), matrices[obj]
        places = np.empty(3 * len(mesh.vertices), dtype=np.float32)
        mesh.vertices.foreach_get("co", places)
        mesh.calc_loop_triangles()
        corners = np.empty(3 * len(mesh.loop_triangles), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", corners)
        vertices.append(places.reshape(-1, 3).astype(np.float64) @ there[:3, :3].T + there[:3, 3])
        triangles.append(corners.reshape(-1, 3).astype(np.int64) + before)
        own = _carriers(mesh, [numbers.get(group.name, -1) for group in obj.vertex_groups])
        carriers.append(own[0])
        weights.append(own[1])
        before += len(mesh.vertices)
    if not sum(map(len, triangles)):
        return None
    return Skin(*map(np.concatenate, (vertices, triangles, carriers, weights)))


def _carriers(mesh: bpy.types.Mesh, joint_of_group: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Return the joints (vertices, 4) with the largest weights for each vertex, and these weights."""
    # Blender cannot return all weights at once.
    entries = [
        (vertex.index, joint_of_group[group.group], group.weight)
        for vertex in mesh.vertices
        for group in vertex.groups
        if group.group < len(joint_of_group) and joint_of_group[group.group] >= 0 and group.weight > 0.0
    ]
    joints, weights = (
        np.zeros((len(mesh.vertices), MAX_JOINTS_PER_VERTEX), dtype=np.int64),
        np.zeros((len(mesh.vertices), MAX_JOINTS_PER_VERTEX)),
    )
    if entries:
        owners, carriers, shares = (np.array(column) for column in zip(*entries, strict=True))
        order = np.lexsort((-shares, owners))
        owners, carriers, shares = owners[order], carriers[order], shares[order]
        rank = np.arange(len(owners)) - np.searchsorted(owners, owners)
        strong = rank < MAX_JOINTS_PER_VERTEX
        joints[owners[strong], rank[strong]] = carriers[strong]
        weights[owners[strong], rank[strong]] = shares[strong]
    alone = weights.sum(axis=1) == 0.0
    weights[alone, 0] = 1.0
    return joints, weights / weights.sum(axis=1, keepdims=True)
