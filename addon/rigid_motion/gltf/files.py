"""A whole file with fewer keys: every clip of it, and what there is to say of each."""

from __future__ import annotations

import itertools
import os
import secrets
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .clips import ClipReduction, ReducedClip, Wishes
from .documents import Document, GltfError, damage_refused, read_document
from .nodes import Nodes
from .rewriting import rewritten
from .sizes import OF_A_BODY, OF_KEY_POSES, joints_of, radii_of, size_of
from .tracks import WEIGHTS, Clip, read_clips

MOST = 0.1
"""A tolerance above this share of the size is a mistake, mostly of the unit."""

SOME = 1e-3
"""The tolerance where nothing has a size."""


@dataclass(frozen=True, eq=False)
class Report:
    """What became of a file. Lengths are in its unit, which glTF means to be the metre."""

    size: float
    """Of its joints, or of its meshes."""

    tolerance: float
    clips: tuple[ReducedClip, ...]
    document: Document
    """With fewer keys; the same where no clip needs fewer."""


def reduced(
    document: Document,
    *,
    tolerance: float | None = None,
    radius: float | None = None,
    shared: bool = False,
    count: int | None = None,
    vertices: bool = False,
) -> Report:
    """A document with fewer keys in all of its clips.

    Parameters
    ----------
    document : Document
    tolerance : float, optional
        How far off any point within the radius of any node may be in the world; a share of the size where None.
    radius : float, optional
        The same for all nodes; otherwise that of meshes is theirs, and that of joints a share of the size.
    shared : bool
        Whether all nodes of a clip get their keys at the same times.
    count : int, optional
        So many key poses of each clip instead of a tolerance.
    vertices : bool
        Whether the largest displacement of any vertex of a skin is measured.

    Raises
    ------
    GltfError
        For what is damaged, and where the tolerance makes no sense.
    """
    with damage_refused():
        clips, nodes = read_clips(document), Nodes(document)
        if not any(clip.tracks for clip in clips):
            raise GltfError("no animation moves a node", "export it with its animations")
        joints = set(itertools.chain.from_iterable(joints_of(document)))
        moved = _moved(nodes, clips)
        size = size_of(nodes, moved)
        radii = np.full(len(moved), radius) if radius is not None else radii_of(nodes, moved, size)
    if tolerance is None:
        tolerance = (OF_KEY_POSES if shared else OF_A_BODY) * size or SOME
    elif tolerance > MOST * size > 0.0:
        raise GltfError(
            f"a tolerance of {tolerance:.3g} m is more than a tenth of the size, which is {size:.3g} m in this file",
            f"give one below {MOST * size:.2g} m",
        )
    wishes = Wishes(tolerance, shared, count, vertices)
    found = []
    for clip in clips:
        if clip.tracks:
            own = np.isin(moved, _moved(nodes, (clip,)))
            found.append(ClipReduction(nodes, clip, moved[own], radii[own], joints, size, wishes).reduced())
    tracks = {clip.number: clip.tracks for clip in found if clip.tracks is not None}
    with damage_refused():
        return Report(size, tolerance, tuple(found), rewritten(document, tracks) if tracks else document)


def reduce_file(
    path: Path,
    output: Path,
    *,
    tolerance: float | None = None,
    radius: float | None = None,
    shared: bool = False,
    count: int | None = None,
    vertices: bool = False,
) -> Report:
    """Write a .glb or .gltf file with fewer keys, and the file of its buffer beside a .gltf: see `reduced`.

    What is at the place of the output is replaced once all is written. Files that a .gltf names are not copied.
    """
    report = reduced(
        read_document(path), tolerance=tolerance, radius=radius, shared=shared, count=count, vertices=vertices
    )
    for name, content in report.document.files(output.name).items():
        beside = output.with_name(f".{secrets.token_hex(4)}{output.suffix}")
        try:
            beside.write_bytes(content)
            os.replace(beside, output.with_name(name))
        finally:
            beside.unlink(missing_ok=True)
    return report


def _moved(nodes: Nodes, clips: Iterable[Clip]) -> np.ndarray:
    """The nodes that tracks move, and all that hang on them, parents before their children."""
    targets = {track.node for clip in clips for track in clip.tracks if track.path != WEIGHTS}
    return nodes.below(np.array(sorted(targets), dtype=np.int64))
