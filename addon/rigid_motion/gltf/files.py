"""A whole file with fewer keys: every clip of it, and what there is to say of each."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .clips import ClipReduction, ReducedClip
from .documents import Document, GltfError, read_document
from .nodes import Nodes
from .rewriting import rewritten
from .sizes import OF_A_BODY, joints_of, radii_of, size_of
from .tracks import WEIGHTS, read_clips

MOST = 0.1
"""A tolerance above this share of the size is a mistake, mostly of the unit."""


@dataclass(frozen=True, eq=False)
class Report:
    """What became of a file. Lengths are in its unit, which glTF means to be the metre."""

    size: float
    """Of its joints, or of its meshes."""

    tolerance: float
    clips: tuple[ReducedClip, ...]
    document: Document
    """With fewer keys; the same where no clip needs fewer."""


def reduced(document: Document, *, tolerance: float | None = None, radius: float | None = None) -> Report:
    """A document with fewer keys in all of its clips.

    Parameters
    ----------
    document : Document
    tolerance : float, optional
        How far off any point within the radius of any node may be in the world; a share of the size where None.
    radius : float, optional
        The same for all nodes; otherwise that of meshes is theirs, and that of joints a share of the size.

    Raises
    ------
    GltfError
        For what is damaged, and where the tolerance makes no sense.
    """
    clips = read_clips(document)
    if not any(clip.tracks for clip in clips):
        raise GltfError("no animation moves a node", "export it with its animations")
    nodes = Nodes(document)
    moved = _moved(nodes, clips)
    size = size_of(nodes, moved)
    tolerance = _checked(tolerance, size)
    radii = np.full(len(moved), radius) if radius is not None else radii_of(nodes, moved, size)
    joints = list(itertools.chain.from_iterable(joints_of(document)))
    done = []
    for clip in clips:
        own = np.isin(moved, _moved(nodes, (clip,)))
        done.append(ClipReduction(nodes, clip, moved[own], radii[own], joints, tolerance, size).reduced())
    tracks = {clip.number: found.tracks for clip, found in zip(clips, done, strict=True) if found.tracks is not None}
    return Report(size, tolerance, tuple(done), rewritten(document, tracks) if tracks else document)


def reduce_file(path: Path, output: Path, *, tolerance: float | None = None, radius: float | None = None) -> Report:
    """Write a file with fewer keys, with those beside it that a .gltf needs."""
    report = reduced(read_document(path), tolerance=tolerance, radius=radius)
    for name, content in report.document.files(output.name).items():
        (output.parent / name).write_bytes(content)
    return report


def _moved(nodes: Nodes, clips: tuple) -> np.ndarray:
    targets = {track.node for clip in clips for track in clip.tracks if track.path != WEIGHTS}
    return nodes.below(np.array(sorted(targets), dtype=np.int64))


def _checked(tolerance: float | None, size: float) -> float:
    if tolerance is None:
        return OF_A_BODY * size or 0.001
    if tolerance > MOST * size > 0.0:
        raise GltfError(
            f"a tolerance of {tolerance:.3g} m is more than a tenth of the size, which is {size:.3g} m in this file",
            f"give one below {MOST * size:.2g} m",
        )
    return tolerance
