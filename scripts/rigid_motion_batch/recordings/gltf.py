"""glTF files, read by their specification: whole bodies, and other moving nodes such as props and cameras.

Positions and axes equal those of Blender's importer, which is not used: z is up, a joint has the axes of its node, and
the axes of an object are turned like those of the world. Times begin with 0 on the first key.
Source: the glTF 2.0 specification, Khronos 2021.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from rigid_motion.gltf.documents import FileBytes, GltfError, Json, damage_refused, entry, objects, read_document
from rigid_motion.gltf.files import unread
from rigid_motion.gltf.meshopt import decompressed
from rigid_motion.gltf.nodes import Nodes, steadied
from rigid_motion.gltf.sizes import joints_of, shines
from rigid_motion.gltf.tracks import LINEAR, NUMBERS_PER_KEY, STEP, Clip, Track, Tracks, read_clips
from rigid_motion.motion import Poses
from rigid_motion.motion.affine import AffineMaps
from rigid_motion.motion.poses import joined
from rigid_motion_batch.axes import AXES
from rigid_motion_batch.command_line import listed

from .bvh import MOST_JOINTS
from .gltf_skins import skin_of
from .key_moments import MAX_SAME_VALUE_RATIO
from .matrices import filled, rigid_of, scales_of
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .recordings import Selection, Trajectory, TrajectoryError, refuse_too_many, unique
from .rest_bodies import RestBody, likely_metres, tails_of
from .sampling import (
    JUMP_STEPS,
    OF_JOINTS,
    OF_OBJECTS,
    Moments,
    moments_between,
    on_frames,
    rate_of,
    sampled,
)
from .scene_bodies import MAX_LISTED_NAMES, SceneBodies, parents_among, parents_first, refuse_too_large, with_above

ENDINGS = (".glb", ".gltf", ".vrm", ".vrma")
"""Extensions of glTF files: VRM avatars and VRMA animations are GLB files."""

WITHOUT_A_RATE = 60.0
"""Samples a second if the keys are too far apart or too close to determine a rate."""

COUNTED_FPS = 120.0
"""Frames a second in which moments are counted: keys at 24, 30 or 60 a second are on whole frames."""

CUT_FRAMES = 1e-6
"""Frames between two keys that have the same time in the file."""

MOST_NODES = 100_000
"""Nodes of a file, including those that are not joints."""

AT_ONCE = 2**16
"""Poses of nodes computed at once."""

HUMANOID = "VRMC_vrm_animation"
"""The VRMA extension that names the joints of a body."""

TO_BLENDER = AXES["opengl"]


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the largest whole body, or else the first moving object; or the requested body, or all."""
    refuse_too_large(path)
    try:
        document = read_document(path)
        refuse_too_large(path, *{buffer.path for buffer in document.buffers if isinstance(buffer, FileBytes)} - {path})
        with damage_refused():
            if (count := len(objects(document.json, "nodes"))) > MOST_NODES:
                problem = f"{count} nodes are more than the {MOST_NODES} that are read"
                raise GltfError(problem, "export the body without the rest of its scene")
            document = decompressed(document)
            scene = _Scene(path, Nodes(document), read_clips(document), options.scale)
            bodies = scene.bodies
        return bodies.read(selection, scene)
    except GltfError as error:
        raise TrajectoryError(path, error.problem, error.way_out) from None


@dataclass(frozen=True, eq=False)
class _Scene:
    """Nodes of a document, and the clips that move them."""

    path: Path
    nodes: Nodes
    clips: tuple[Clip, ...]
    scale: float | None
    """The length of the unit in metres, if the user gives it."""

    @cached_property
    def names(self) -> list[str]:
        names = [node.get("name") for node in self._described]
        return unique([name if isinstance(name, str) and name else f"Node_{node}" for node, name in enumerate(names)])

    @property
    def _described(self) -> list[Json]:
        return objects(self.nodes.document.json, "nodes")

    @cached_property
    def _unread(self) -> str:
        return unread(self.nodes, self.clips)

    def _node_mask(self, chosen: Iterable[int]) -> np.ndarray:
        """Return a mask of the chosen nodes, shape (nodes,)."""
        result = np.zeros(len(self.nodes.parents), dtype=bool)
        result[list(chosen)] = True
        return result

    # -- bodies -------------------------------------------------------------------------------------------------------

    @cached_property
    def bodies(self) -> SceneBodies:
        keyed = self._node_mask(track.node for clip in self.clips for track in _transform_tracks(clip))
        human = self._node_mask(self._humanoid_joints() if keyed.any() else ())
        moves = self._node_mask(
            track.node for clip in self.clips for track in _transform_tracks(clip) if not track.is_constant
        )
        # A skinned mesh follows its joints, so its own node does not count.
        aside = [number for number, node in enumerate(self._described) if "skin" in node]
        parents = self.nodes.parents
        return SceneBodies.of(self.path, self.names, parents, moves | human, keyed | human, self._skeletons(), aside)

    def _humanoid_joints(self) -> list[int]:
        """Return the joints named in a VRMA."""
        extension = self.nodes.document.json.get("extensions", {}).get(HUMANOID, {})
        joints = [bone["node"] for bone in extension.get("humanoid", {}).get("humanBones", {}).values()]
        return [joint for joint in joints if entry(self.nodes.document.json, "nodes", joint) is not None]

    def _skeletons(self) -> dict[str, list[int]]:
        """Return the joints of skins with all nodes between them, keyed by the name of the node that carries them."""
        bones: set[int] = set()
        skins = [skin["joints"] for skin in objects(self.nodes.document.json, "skins")]
        if (most := max(map(len, skins), default=0)) > MOST_JOINTS:
            problem = f"{most} joints of a skin are more than the {MOST_JOINTS} that are read"
            raise GltfError(problem, "export one body at a time")
        parents = self.nodes.parents
        for joints in {tuple(joints): list(joints) for joints in joints_of(self.nodes.document)}.values():
            line = with_above(parents, joints)
            carried = np.zeros(len(parents) + 1, dtype=np.int64)
            carried[joints] = 1
            every = np.sum(carried)
            for node in reversed(line):
                carried[parents[node]] += carried[node]
            bones.update(joints, [node for node in line if carried[node] < every])
        carriers, result = parents.copy(), dict[int, list[int]]()
        for node in parents_first(parents):
            if node in bones:
                if carriers[node] in bones:
                    carriers[node] = carriers[carriers[node]]
                result.setdefault(int(carriers[node]), []).append(node)
        names = unique([self.names[carrier] if carrier >= 0 else "Armature" for carrier in result])
        return dict(zip(names, result.values(), strict=True))

    # -- motions ------------------------------------------------------------------------------------------------------

    def whole(self, name: str, own: Sequence[int], remark: str) -> Trajectory:
        parents, rest, skin, problem = parents_among(self.nodes.parents, own), self._rest_poses(own), None, ""
        try:
            with damage_refused():
                skin = skin_of(self.nodes, own, TO_BLENDER)
        except GltfError as error:
            problem = f"without its skin: {error.problem}"
        rest_body = RestBody(tuple(self.names[node] for node in own), parents, rest, tails_of(rest, parents), skin)
        metres, played = self.scale or likely_metres(parents, rest.positions), self._motion_of(own, own)
        seen = sampled(played.moments, played, parents, OF_JOINTS, metres)
        remarks = filter(None, (remark, problem, played.remark))
        return seen.as_body(name, played.moments, metres, rest_body, remark="; ".join(remarks))

    def joints(self, chosen: Sequence[int], own: Sequence[int]) -> list[Trajectory]:
        metres = self.scale or likely_metres(parents_among(self.nodes.parents, own), self._rest_poses(own).positions)
        played = self._motion_of(chosen, own)
        seen = sampled(played.moments, played, np.full(len(chosen), -1), OF_JOINTS, metres)
        return seen.as_singles([self.names[node] for node in chosen], played.moments, metres, played.remark)

    def alone(self, node: int) -> Trajectory:
        looks = shines(self._described[node])
        played = self._motion_of([node], [node], turn=np.eye(3) if looks else TO_BLENDER.T)
        seen = sampled(played.moments, played, np.array([-1]), OF_OBJECTS, self.scale or 1.0)
        return seen.as_singles([self.names[node]], played.moments, self.scale or 1.0, played.remark)[0]

    def _rest_poses(self, own: Sequence[int]) -> Poses:
        return filled(_poses(self.nodes.resting[list(own), None]))[:, 0]

    def _motion_of(self, chosen: Sequence[int], own: Sequence[int], turn: np.ndarray | None = None) -> _NodeMotion:
        """Return the motion of nodes of a body. If several takes move the same nodes, the first is used."""
        line = with_above(self.nodes.parents, own)
        marks, taken, left, busy = self._node_mask(line), [], [], set[int]()
        for clip in self.clips:
            moved = {track.node for track in _transform_tracks(clip) if marks[track.node]}
            if moved and moved.isdisjoint(busy):
                busy |= moved
                taken.append(clip)
            elif moved:
                left.append(clip.name)
        tracks = [_snapped_to_frames(track) for clip in taken for track in _transform_tracks(clip) if marks[track.node]]
        # Nodes that do not move are sampled for as long as the other nodes move.
        timing = tracks or [_snapped_to_frames(track) for clip in self.clips for track in _transform_tracks(clip)]
        moments = _moments(self.path, len(chosen), timing)
        names = listed([clip.name for clip in taken], MAX_LISTED_NAMES)
        takes = f"took its take {names}; others: {listed(left, MAX_LISTED_NAMES)}" if left else ""
        remark = "; ".join(filter(None, (takes, self._unread)))
        needed = with_above(self.nodes.parents, chosen)
        rows = {node: row for row, node in enumerate(needed)}
        return _NodeMotion(
            self.nodes,
            np.array(needed),
            [rows[node] for node in chosen],
            steadied(tuple(tracks)),
            moments,
            remark,
            turn,
        )


def _transform_tracks(clip: Clip) -> Iterator[Track]:
    """Yield the tracks that move, turn or scale nodes."""
    return (track for track in clip.all_tracks if track.path in NUMBERS_PER_KEY)


def _snapped_to_frames(track: Track) -> Track:
    """Return a track with keys snapped to frames nearby, because files store times in single precision."""
    frames = on_frames(COUNTED_FPS * track.times)
    frames[:-1] -= CUT_FRAMES * (np.diff(frames) <= 0.0)
    return replace(track, times=frames / COUNTED_FPS)


def _jumps(track: Track) -> np.ndarray:
    """Return whether a track jumps at each of its keys except the first, shape (n - 1,)."""
    cuts = np.diff(track.times) < 2.0 * CUT_FRAMES / COUNTED_FPS
    if track.interpolation != STEP:
        return cuts
    return cuts | (np.abs(np.diff(track.points, axis=0)) > MAX_SAME_VALUE_RATIO).any(axis=1)


def _moments(path: Path, joints: int, tracks: Sequence[Track]) -> Moments:
    """Return the moments at which to sample joints moved by the tracks."""
    keys = [COUNTED_FPS * track.times for track in tracks]
    first, last = min(own[0] for own in keys), max(own[-1] for own in keys)
    step = COUNTED_FPS / (rate_of(keys, COUNTED_FPS) or WITHOUT_A_RATE)
    refuse_too_many(path, joints, (last - first) / step + 1.0)
    jumps = [own[1:][_jumps(track)] - JUMP_STEPS * step for own, track in zip(keys, tracks, strict=True)]
    straight = all(track.interpolation in (LINEAR, STEP) for track in tracks)
    return moments_between(first, last, COUNTED_FPS, step, np.concatenate([*keys, *jumps]), straight=straight)


@dataclass(frozen=True, eq=False)
class _NodeMotion:
    """Poses of nodes moved by tracks, at any frames."""

    nodes: Nodes
    line: np.ndarray
    """The nodes and all their ancestors, parents first."""

    rows: list[int]
    """Indices of the nodes in `line`."""

    tracks: Tracks
    moments: Moments
    remark: str
    turn: np.ndarray | None
    """Rotation of the axes of objects in their own space, shape (3, 3); None for joints."""

    def __call__(self, frames: np.ndarray) -> Poses:
        """Return the poses of the nodes on frames (n,), shape (nodes, n); objects have scales."""
        count = max(AT_ONCE // len(self.line), 1)
        blocks = (frames[first : first + count] / COUNTED_FPS for first in range(0, len(frames), count))
        maps = (self.nodes.worlds(self.line, self.tracks, times)[self.rows] for times in blocks)
        return joined([_poses(some, self.turn) for some in maps], axis=1)


def _poses(maps: AffineMaps, turn: np.ndarray | None = None) -> Poses:
    """Return poses of nodes (...) in Blender's world. Objects are turned in their own space, and have scales."""
    axes = TO_BLENDER @ maps.axes @ (np.eye(3) if turn is None else turn)
    poses = rigid_of(axes, maps.origins @ TO_BLENDER.T)
    return poses if turn is None else Poses(poses.positions, poses.quaternions, scales_of(axes))
