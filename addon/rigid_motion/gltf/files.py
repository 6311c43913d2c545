"""A whole file with fewer keys: every clip of it, and what there is to say of each."""

from __future__ import annotations

import itertools
import secrets
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .clips import ClipReduction, Options, ReducedClip
from .documents import Document, damage_refused, read_document
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

    before: int = 0
    after: int = 0
    """Bytes of all of its files."""

    left_alone: str = ""
    """Why nothing of its motion was reduced, where nothing was."""

    reduced_before: float | None = None
    """The tolerance that an earlier reduction has noted in the file."""


def reduced(document: Document, options: Options) -> Report:
    """Return a document with fewer keys in all of its clips.

    Raises
    ------
    GltfError
        For what is damaged, and where the tolerance makes no sense.
    """
    with damage_refused():
        clips, nodes = read_clips(document), Nodes(document)
        if not any(clip.tracks for clip in clips):
            return _left_alone(document, 0.0, "no animation moves a node")
        joints = set(itertools.chain.from_iterable(joints_of(document)))
        moved = _moved(nodes, clips)
        size = size_of(nodes, moved)
        radii = radii_of(nodes, moved, size) if options.radius is None else np.full(len(moved), options.radius)
    tolerance = options.tolerance
    if tolerance is None:
        tolerance = (OF_KEY_POSES if options.shared else OF_A_BODY) * size or SOME
    elif tolerance > MOST * size > 0.0:
        return _left_alone(
            document,
            size,
            f"a tolerance of {tolerance:.3g} m is more than a tenth of the size, which is {size:.3g} m in this file",
        )
    options = replace(options, tolerance=tolerance)
    result = []
    for clip in clips:
        if clip.tracks:
            own = np.isin(moved, _moved(nodes, (clip,)))
            result.append(ClipReduction(nodes, clip, moved[own], radii[own], joints, size, options).reduced())
    tracks = {clip.number: clip.tracks for clip in result if clip.tracks is not None}
    with damage_refused():
        if not tracks:
            return replace(_left_alone(document, size, ""), clips=tuple(result), tolerance=tolerance)
        made = rewritten(document, tracks)
    noted = document.json["asset"].get("extras", {}).get("reducedWithin")
    return Report(size, tolerance, tuple(result), made, _bytes_of(document), _bytes_of(made), "", noted)


def _left_alone(document: Document, size: float, reason: str) -> Report:
    return Report(size, 0.0, (), document, _bytes_of(document), _bytes_of(document), reason)


def _bytes_of(document: Document) -> int:
    return sum(map(len, document.files("a.glb").values()))


def reduce_file(path: Path, output: Path, options: Options) -> Report:
    """Write a .glb or .gltf file with fewer keys, and the file of its buffer beside a .gltf: see `reduced`.

    What is at the place of the output is replaced once all is written. Files that a .gltf names are not copied.
    """
    report = reduced(read_document(path), options)
    for name, content in report.document.files(output.name).items():
        beside = output.with_name(f".{secrets.token_hex(4)}{output.suffix}")
        try:
            beside.write_bytes(content)
            beside.replace(output.with_name(name))
        finally:
            beside.unlink(missing_ok=True)
    return report


def _moved(nodes: Nodes, clips: Iterable[Clip]) -> np.ndarray:
    """Return the nodes that tracks move, and all that hang on them, parents before their children."""
    targets = {track.node for clip in clips for track in clip.tracks if track.path != WEIGHTS}
    return nodes.below(np.array(sorted(targets), dtype=np.int64))
