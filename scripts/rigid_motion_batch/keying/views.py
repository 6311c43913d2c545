"""Views of a reduced glTF file for a report page: joints before and after, and the error over time.

The written file is read again, and compared with the original at the keys of both and at eighths of the gaps between
them. The error at a moment is the largest displacement, in the world, of any point that counts for the tolerance,
without the offsets of morph targets. Lengths are in the unit of the document, the metre according to glTF.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.gltf import Document, ReducedClip, Report
from rigid_motion.gltf.errors import PARTS_PER_GAP, World
from rigid_motion.gltf.nodes import Nodes, steadied
from rigid_motion.gltf.seen import Seen
from rigid_motion.gltf.sizes import joints_of, shells_of
from rigid_motion.gltf.tracks import Clip, Tracks, read_clips
from rigid_motion.motion.affine import AffineMaps, ball_displacement
from rigid_motion_batch.files import write_text
from rigid_motion_batch.pipeline.steps import OWN_FOLDER
from rigid_motion_batch.report.reduced import ShownClip, clip_data

from .reductions import MIN_BODY_JOINTS

MOST_MOMENTS = 30_000
"""The most moments at which errors are measured; longer clips get fewer than eight parts per gap."""

MOST_JOINTS = 200
"""The most joints that are drawn of a clip, parents first."""

MAX_POSES, MAX_POSES_PER_S = 900, 60
"""The most poses that are drawn of a clip, and the most per second."""

TO_Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def place_of_views(output: Path) -> Path:
    """Return the path at which the views of a written file are kept for report pages."""
    return output.parent / OWN_FOLDER / f"{output.name}.views"


def views_of(before: Document, report: Report, radius: float | None) -> list[dict[str, Any]]:
    """Return the viewer data of each clip that was reduced."""
    after, nodes, clips = report.document.reread(), Nodes(before), read_clips(before)
    own, played, seen = Nodes(after), read_clips(after), Seen.of(nodes, clips)
    joints = np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *map(np.array, joints_of(before))]))
    result = []
    for made in report.clips:
        if made.tracks is not None:
            clip, tracks = clips[made.number], played[made.number]
            moving = nodes.below(np.unique([track.node for track in clip.all_tracks]))
            shells = shells_of(nodes, moving, report.size, report.tolerance)
            if radius is not None:
                shells[:] = radius
            times = _key_times(clip, tracks)
            world = World(nodes, seen, moving, shells, steadied(clip.all_tracks), times)
            result.append(clip_data(_View(world, own, steadied(tracks.all_tracks), joints).shown(clip, tracks, made)))
    return result


def read_views(path: Path) -> list[dict[str, Any]]:
    """Return the viewer data of a written file; nothing if it is not a glTF file."""
    return json.loads(path.read_text(encoding="utf-8")) if path.is_file() else []


def write_views(path: Path, views: Sequence[dict[str, Any]]) -> None:
    write_text(path, json.dumps(views, separators=(",", ":"), allow_nan=False))


def _key_times(*clips: Clip) -> np.ndarray:
    return np.unique(np.concatenate([track.times for clip in clips for track in clip.all_tracks]))


@dataclass(frozen=True, eq=False)
class _View:
    """A clip to compare with its reduced version."""

    world: World
    nodes: Nodes
    """The nodes of the written file."""

    tracks: Tracks
    """The tracks that move these nodes."""

    joints: np.ndarray

    def shown(self, clip: Clip, written: Clip, made: ReducedClip) -> ShownClip:
        """Return the joint positions at the drawn moments, and the errors at all measured moments."""
        world = self.world
        parts = int(np.clip(MOST_MOMENTS // len(world.times), 1, PARTS_PER_GAP))
        times = world.parted(0, len(world.times), parts)
        errors, worst_rows = np.zeros(len(times)), np.zeros(len(times), dtype=np.int64)
        for block in world.blocks(world.truth, parts=parts):
            off = self._errors(block.times, block.maps[0])
            errors[block.samples], worst_rows[block.samples] = off.max(axis=0), off.argmax(axis=0)
        worst = int(np.argmax(errors))
        count = min(MAX_POSES, int(MAX_POSES_PER_S * (times[-1] - times[0])) + 2)
        even = np.searchsorted(times, np.linspace(times[0], times[-1], count), side="right") - 1
        drawn, moments = self._drawn_rows(), np.unique(np.append(even, worst))
        before = world.worlds(world.truth, times[moments])
        after = self.nodes.worlds(world.moving, self.tracks, times[moments])
        parents = self._parents(drawn)
        radii = world.balls[drawn] if len(drawn) < MIN_BODY_JOINTS else None
        nodes = world.nodes.document.json["nodes"]
        return ShownClip(
            clip.name,
            [str(nodes[world.moving[row]].get("name", "")) for row in drawn.tolist()],
            *_with_axes(parents, [_points(maps[drawn], radii) for maps in (before, after)]),
            times,
            moments,
            errors,
            self._errors(times[moments], before)[drawn],
            int(np.argmax(drawn == worst_rows[worst])),
            (np.searchsorted(times, _key_times(clip)), np.searchsorted(times, _key_times(written))),
            (made.before.keys, made.after.keys),
            (made.before.size, made.after.size),
        )

    def _errors(self, times: np.ndarray, truth: AffineMaps) -> np.ndarray:
        """Return the largest displacement of the points that each node carries, shape (nodes, times)."""
        there = self.nodes.worlds(self.world.moving, self.tracks, times)
        radii = np.broadcast_to(self.world.balls[:, None], truth.origins.shape[:2])
        return ball_displacement(there, truth, radii)

    def _drawn_rows(self) -> np.ndarray:
        """Return the rows of the nodes to draw: the joints, or all moving nodes if there are no joints."""
        rows = np.flatnonzero(np.isin(self.world.moving, self.joints))
        return (rows if len(rows) > 1 else np.arange(len(self.world.moving)))[:MOST_JOINTS]

    def _parents(self, drawn: np.ndarray) -> np.ndarray:
        """Return, for each drawn node, the index of its nearest drawn ancestor; -1 if there is none."""
        places, above = {row: place for place, row in enumerate(drawn.tolist())}, self.world.parents.tolist()
        result = []
        for row in drawn.tolist():
            row = above[row]
            while row >= 0 and row not in places:
                row = above[row]
            result.append(places.get(row, -1))
        return np.array(result, dtype=np.int64)


def _points(maps: AffineMaps, radii: np.ndarray | None) -> np.ndarray:
    """Return origins with z up, shape (1, nodes, times, 3); with radii, the ends of axes follow."""
    points = [maps.origins]
    if radii is not None:
        points += [maps.origins + sign * radii[:, None, None] * maps.axes[..., k] for k in range(3) for sign in (1, -1)]
    return np.stack(points) @ TO_Z_UP.T


def _with_axes(parents: np.ndarray, points: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the parents of all points, and the points before and after, shape (points, times, 3)."""
    axes, count = len(points[0]) - 1, len(parents)
    parents = np.concatenate((parents, np.tile(np.arange(count), axes)))
    before, after = (some.reshape(-1, *some.shape[2:]) for some in points)
    return parents, before, after
