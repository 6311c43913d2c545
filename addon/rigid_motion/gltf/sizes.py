"""Sizes in a glTF document, for choosing tolerances; in its unit, the metre.

The size is that of joints, which are heads of bones, or of carried geometry: tails of bones are made up by importers.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable

import numpy as np

from .documents import Document, entry, objects
from .nodes import Nodes
from .seen import Seen, corners_of
from .tracks import SCALE, Clip

OF_A_BODY = 0.003
"""Default tolerance for the keys of a body, as a fraction of its size: 5 mm for an adult."""

OF_KEY_POSES = 0.02
"""Default tolerance for key poses, as a fraction of the size, chosen for few poses: 35 mm for an adult."""

MIN_BALL_RADIUS_RATIO = 0.03 / 1.7
"""Least radius of a node's ball as a fraction of the size: 3 cm for an adult."""

SIZELESS_TURN_RAD = np.radians(0.5)
"""Largest error of rotations if nothing has a size."""


def joints_of(document: Document) -> list[list[int]]:
    """Return the joint nodes of each skin."""
    skins = [skin["joints"] for skin in objects(document.json, "skins") if isinstance(skin.get("joints"), list)]
    for joint in itertools.chain.from_iterable(skins):
        entry(document.json, "nodes", joint)
    return skins


def size_of(nodes: Nodes, seen: Seen, moved: np.ndarray, clips: Iterable[Clip]) -> float:
    """Return the largest extent along any axis of moving joints, or else of carried geometry, or else of nodes.

    Measured in the rest pose, but with the largest scales of any clip.
    """
    scales = nodes.rest[SCALE].copy()
    for track in (track for clip in clips for track in clip.all_tracks if track.path == SCALE):
        points = np.concatenate((scales[None, track.node], track.points))
        scales[track.node] = np.take_along_axis(points, np.abs(points).argmax(axis=0)[None], axis=0)[0]
    resting, joints = nodes.with_rest(SCALE, scales).resting, joints_of(nodes.document)
    sizes = [float(np.ptp(resting.origins[some], axis=0).max()) for some in joints if some]
    if max(sizes, default=0.0) > 0.0:
        return max(sizes)
    carrying = [node for node in {*moved.tolist(), *itertools.chain(*joints)} if seen.reaches[node] > 0.0]
    corners = [resting[node].at(corners_of(*seen.boxes[:, node])) for node in carrying]
    points = np.concatenate(corners) if corners else resting.origins[moved]
    return float(np.ptp(points, axis=0).max()) if len(points) else 0.0


def shells_of(nodes: Nodes, moved: np.ndarray, size: float, tolerance: float) -> np.ndarray:
    """Return the least ball radius of each of these nodes (n,) in world space, shape (n,).

    For cameras and lights it is the whole size, for others a fraction of it. If nothing has a size, it limits rotations
    to an angle.
    """
    if not size:
        return np.full(len(moved), tolerance / SIZELESS_TURN_RAD)
    return np.array(
        [size if shines(nodes.document.json["nodes"][node]) else MIN_BALL_RADIUS_RATIO * size for node in moved]
    )


def shines(node: dict) -> bool:
    """Whether a node is a camera or a light, which point along their own -z."""
    extensions = node.get("extensions")
    return "camera" in node or (isinstance(extensions, dict) and "KHR_lights_punctual" in extensions)
