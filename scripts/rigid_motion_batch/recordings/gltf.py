"""glTF files as their specification has them: whole bodies, and what else moves, such as a prop or a camera.

Places and axes are those that Blender's importer gives, without it: z is up, a joint has the axes of its node, and the
axes of an object are turned as the world's are. Times begin with 0 on the first key.
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
"""Of glTF files: avatars and animations for them, VRM and VRMA, are GLB files."""

WITHOUT_A_RATE = 60.0
"""Samples a second where keys come too seldom or too often to tell."""

COUNTED_FPS = 120.0
"""Moments are counted in frames of so many a second: keys at 24, 30 or 60 a second are on whole ones."""

CUT_FRAMES = 1e-6
"""Frames from one key to another at the same time."""

MOST_NODES = 100_000
"""Nodes of a file, also those that are no joints."""

AT_ONCE = 2**16
"""Poses of nodes that are worked out at once."""

HUMANOID = "VRMC_vrm_animation"
"""The extension of a VRMA that names the joints of a body."""

TO_BLENDER = AXES["opengl"]


def read(path: Path, selection: Selection, options: ReadingOptions = AS_THE_FILE_SAYS) -> list[Trajectory]:
    """Read the largest whole body, or else the first object that moves; or what is named, or all."""
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
    """Nodes of a document, and what moves them."""

    path: Path
    nodes: Nodes
    clips: tuple[Clip, ...]
    scale: float | None
    """The length of the unit in metres, if the user says so."""

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

    def _marked(self, chosen: Iterable[int]) -> np.ndarray:
        """Return which nodes these are, shape (nodes,)."""
        result = np.zeros(len(self.nodes.parents), dtype=bool)
        result[list(chosen)] = True
        return result

    # -- bodies -------------------------------------------------------------------------------------------------------

    @cached_property
    def bodies(self) -> SceneBodies:
        keyed = self._marked(track.node for clip in self.clips for track in _placing(clip))
        human = self._marked(self._human() if keyed.any() else ())
        moves = self._marked(track.node for clip in self.clips for track in _placing(clip) if not track.is_constant)
        # A mesh with a skin is where its joints are.
        aside = [number for number, node in enumerate(self._described) if "skin" in node]
        parents = self.nodes.parents
        return SceneBodies.of(self.path, self.names, parents, moves | human, keyed | human, self._skeletons(), aside)

    def _human(self) -> list[int]:
        """Return the joints that a VRMA names."""
        extension = self.nodes.document.json.get("extensions", {}).get(HUMANOID, {})
        joints = [bone["node"] for bone in extension.get("humanoid", {}).get("humanBones", {}).values()]
        return [joint for joint in joints if entry(self.nodes.document.json, "nodes", joint) is not None]

    def _skeletons(self) -> dict[str, list[int]]:
        """Return the joints of skins, and all between them and what carries them, by its name."""
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
        parents, rest, skin, problem = parents_among(self.nodes.parents, own), self._resting(own), None, ""
        try:
            with damage_refused():
                skin = skin_of(self.nodes, own, TO_BLENDER)
        except GltfError as error:
            problem = f"without its skin: {error.problem}"
        rest_body = RestBody(tuple(self.names[node] for node in own), parents, rest, tails_of(rest, parents), skin)
        metres, played = self.scale or likely_metres(parents, rest.positions), self._played(own, own)
        seen = sampled(played.moments, played, parents, OF_JOINTS, metres)
        remarks = filter(None, (remark, problem, played.remark))
        return seen.as_body(name, played.moments, metres, rest_body, remark="; ".join(remarks))

    def joints(self, chosen: Sequence[int], own: Sequence[int]) -> list[Trajectory]:
        metres = self.scale or likely_metres(parents_among(self.nodes.parents, own), self._resting(own).positions)
        played = self._played(chosen, own)
        seen = sampled(played.moments, played, np.full(len(chosen), -1), OF_JOINTS, metres)
        return seen.as_singles([self.names[node] for node in chosen], played.moments, metres, played.remark)

    def alone(self, node: int) -> Trajectory:
        looks = shines(self._described[node])
        played = self._played([node], [node], turn=np.eye(3) if looks else TO_BLENDER.T)
        seen = sampled(played.moments, played, np.array([-1]), OF_OBJECTS, self.scale or 1.0)
        return seen.as_singles([self.names[node]], played.moments, self.scale or 1.0, played.remark)[0]

    def _resting(self, own: Sequence[int]) -> Poses:
        return filled(_poses(self.nodes.resting[list(own), None]))[:, 0]

    def _played(self, chosen: Sequence[int], own: Sequence[int], turn: np.ndarray | None = None) -> _Played:
        """Return how nodes are moved that belong to a body: of takes that move the same nodes by the first."""
        line = with_above(self.nodes.parents, own)
        marks, taken, left, busy = self._marked(line), [], [], set[int]()
        for clip in self.clips:
            moved = {track.node for track in _placing(clip) if marks[track.node]}
            if moved and moved.isdisjoint(busy):
                busy |= moved
                taken.append(clip)
            elif moved:
                left.append(clip.name)
        tracks = [_on_frames(track) for clip in taken for track in _placing(clip) if marks[track.node]]
        # What does not move is looked at for as long as everything else does.
        timing = tracks or [_on_frames(track) for clip in self.clips for track in _placing(clip)]
        moments = _moments(self.path, len(chosen), timing)
        names = listed([clip.name for clip in taken], MAX_LISTED_NAMES)
        takes = f"took its take {names}; others: {listed(left, MAX_LISTED_NAMES)}" if left else ""
        remark = "; ".join(filter(None, (takes, self._unread)))
        needed = with_above(self.nodes.parents, chosen)
        rows = {node: row for row, node in enumerate(needed)}
        return _Played(
            self.nodes,
            np.array(needed),
            [rows[node] for node in chosen],
            steadied(tuple(tracks)),
            moments,
            remark,
            turn,
        )


def _placing(clip: Clip) -> Iterator[Track]:
    """Yield what moves, turns or scales nodes."""
    return (track for track in clip.all_tracks if track.path in NUMBERS_PER_KEY)


def _on_frames(track: Track) -> Track:
    """Return a track whose keys are on frames where they nearly are: files have them in single precision."""
    frames = on_frames(COUNTED_FPS * track.times)
    frames[:-1] -= CUT_FRAMES * (np.diff(frames) <= 0.0)
    return replace(track, times=frames / COUNTED_FPS)


def _jumps(track: Track) -> np.ndarray:
    """Return whether a track jumps at each of its keys but the first, shape (n - 1,)."""
    cuts = np.diff(track.times) < 2.0 * CUT_FRAMES / COUNTED_FPS
    if track.interpolation != STEP:
        return cuts
    return cuts | (np.abs(np.diff(track.points, axis=0)) > MAX_SAME_VALUE_RATIO).any(axis=1)


def _moments(path: Path, joints: int, tracks: Sequence[Track]) -> Moments:
    """Return when joints are looked at that tracks move."""
    keys = [COUNTED_FPS * track.times for track in tracks]
    first, last = min(own[0] for own in keys), max(own[-1] for own in keys)
    step = COUNTED_FPS / (rate_of(keys, COUNTED_FPS) or WITHOUT_A_RATE)
    refuse_too_many(path, joints, (last - first) / step + 1.0)
    jumps = [own[1:][_jumps(track)] - JUMP_STEPS * step for own, track in zip(keys, tracks, strict=True)]
    straight = all(track.interpolation in (LINEAR, STEP) for track in tracks)
    return moments_between(first, last, COUNTED_FPS, step, np.concatenate([*keys, *jumps]), straight=straight)


@dataclass(frozen=True, eq=False)
class _Played:
    """Nodes as tracks move them."""

    nodes: Nodes
    line: np.ndarray
    """The nodes and all that they hang on, parents first."""

    rows: list[int]
    """Where the nodes are in that line."""

    tracks: Tracks
    moments: Moments
    remark: str
    turn: np.ndarray | None
    """How the axes of objects are turned in their own space, shape (3, 3); None for joints."""

    def __call__(self, frames: np.ndarray) -> Poses:
        """Return the nodes on frames (n,), shape (nodes, n); objects with scales."""
        count = max(AT_ONCE // len(self.line), 1)
        blocks = (frames[first : first + count] / COUNTED_FPS for first in range(0, len(frames), count))
        maps = (self.nodes.worlds(self.line, self.tracks, times)[self.rows] for times in blocks)
        return joined([_poses(some, self.turn) for some in maps], axis=1)


def _poses(maps: AffineMaps, turn: np.ndarray | None = None) -> Poses:
    """Return nodes (...) in Blender's world; those of objects are turned in their own space, and have scales."""
    axes = TO_BLENDER @ maps.axes @ (np.eye(3) if turn is None else turn)
    poses = rigid_of(axes, maps.origins @ TO_BLENDER.T)
    return poses if turn is None else Poses(poses.positions, poses.quaternions, scales_of(axes))
