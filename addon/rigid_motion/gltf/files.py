"""Key reduction of a whole glTF file: all of its clips, with a report for each."""

from __future__ import annotations

import itertools
import secrets
from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .clips import ALL_CHANNELS, LARGER_REASON, NEEDED_CHANNELS, ClipReduction, Options, ReducedClip, kept
from .curves import CurveReduction
from .documents import Document, GltfError, damage_refused, read_document
from .errors import World
from .meshopt import are_clear, decompressed, packed, shortened, unpacked
from .nodes import Nodes, by_target, steadied
from .references import References
from .rewriting import StoredTrack, amount_before, shown, with_tracks
from .seen import Seen
from .sizes import OF_A_BODY, OF_KEY_POSES, joints_of, shells_of, size_of
from .tracks import NUMBERS_PER_KEY, PATHS, WEIGHTS, Clip, Target, read_clips

MAX_TOLERANCE_PER_SIZE = 0.1
"""Largest sensible tolerance as a fraction of the size; a larger one is a mistake, mostly of the unit."""

SIZELESS_TOLERANCE = 1e-3
"""The tolerance if nothing has a size."""

NOTE_KEY = "rigid_motion"
"""Key in the asset's extras under which the tolerance is noted."""

SINGLE_EPS = 1e-6
"""Largest difference between single-precision numbers that count as equal."""

MOVING_EXTENSIONS = ("VRMC_node_constraint",)
"""Node extensions that make a node follow others."""

UNCLEAR = "an extension that is not known here may say where its bytes are, and meshopt moves them: do it without"
"""Why a document is not compressed."""

NewTracks = Mapping[int, Sequence[StoredTrack]]
"""New tracks by clip number; other clips keep their tracks."""


@dataclass(frozen=True, eq=False)
class Report:
    """Result of reducing a file. Lengths are in the file's unit, which glTF defines as the metre."""

    size: float
    """Size of the joints, or of the geometry that nodes carry."""

    tolerance: float
    clips: tuple[ReducedClip, ...]
    document: Document
    """The document with fewer keys; the given document if no clip could be reduced."""

    before: int
    after: int
    """Bytes of all files, before and after."""

    left_alone: str = ""
    """Why nothing was reduced."""

    reduced_before: float | None = None
    """The tolerance of an earlier reduction, whose errors add to this one's."""


def reduced(document: Document, options: Options) -> Report:
    """Return a document with fewer keys in all of its clips.

    Raises
    ------
    GltfError
        If the document is damaged or the tolerance makes no sense.
    """
    given, before = document, document.size
    with damage_refused():
        document, streams = unpacked(given)
        options = replace(options, meshopt=options.meshopt or document is not given)
        document = shortened(document)
        nodes = Nodes(document)
        clips, references = read_clips(document), References(document.json)
        earlier, joints = _noted_tolerance(document), set(itertools.chain.from_iterable(joints_of(document)))

        def left_alone(reason: str, size: float = 0.0, clips: Sequence[ReducedClip] = ()) -> Report:
            return Report(size, options.tolerance or 0.0, tuple(clips), given, before, before, reason, earlier)

        if reason := unread(nodes, clips) or (options.meshopt and not are_clear(document.json) and UNCLEAR) or "":
            return left_alone(reason)
        seen = Seen.of(nodes, clips)
        size = size_of(nodes, seen, _moved_nodes(nodes, clips, PATHS), clips)
    tolerance = options.tolerance
    if tolerance is None:
        tolerance = (OF_KEY_POSES if options.shared else OF_A_BODY) * size or SIZELESS_TOLERANCE
    elif tolerance > MAX_TOLERANCE_PER_SIZE * size > 0.0:
        reason = f"a tolerance of {tolerance:.3g} m is more than a tenth of the size, which is {size:.3g} m"
        return left_alone(f"{reason}: give one below {MAX_TOLERANCE_PER_SIZE * size:.2g} m", size)
    options = replace(options, tolerance=tolerance)
    # A file that shows nothing is a library of clips, for bodies whose rest poses may differ.
    keeps_all = options.channels == ALL_CHANNELS or (options.channels == NEEDED_CHANNELS and not seen.reaches.any())
    moved_by = {} if keeps_all else _moving_clips(nodes, clips)
    result = []
    for clip in clips:
        if clip.tracks:
            own = _moved_nodes(nodes, (clip,))
            shells = shells_of(nodes, own, size, tolerance)
            if options.radius is not None:
                shells[:] = options.radius
            world = World(nodes, seen, own, shells, steadied(clip.all_tracks), _key_times(clip))
            targets = ((track.node, track.path) for track in clip.tracks)
            needed = {target for target in targets if keeps_all or moved_by[target] - {clip.number}}
            amount = amount_before(document, references, clip, streams.shares)
            reduction = CurveReduction if options.curves else ClipReduction
            result.append(reduction(world, clip, needed, joints, size, options, amount).reduced())
    tracks = {clip.number: clip.tracks for clip in result if clip.tracks is not None}
    with damage_refused():
        within = tolerance if options.count is None else max((clip.error for clip in result), default=0.0)
        noted = _with_note(document, within + (earlier or 0.0)) if tracks else document
        changed, chosen = with_tracks(noted, references, tracks)
        changed = packed(changed, streams=streams) if options.meshopt else changed
        larger = tracks.keys() - chosen
        result = [kept(it.number, it.name, it.before, LARGER_REASON) if it.number in larger else it for it in result]
        if not (options.meshopt or chosen) or changed.size >= before:
            return left_alone("no clip would become smaller", size, result)
        _require_proven(changed, nodes, seen, clips, {number: tracks[number] for number in chosen})
    return Report(size, tolerance, tuple(result), changed, before, changed.size, "", earlier)


def unread(nodes: Nodes, clips: Sequence[Clip]) -> str:
    """Return why nothing of a document can be reduced, or an empty text."""
    if not any(clip.tracks for clip in clips):
        return "no animation moves a node"
    for clip in clips:
        if clip.unread:
            return f"{clip.name} animates {clip.unread}, and what that moves is not known here"
    for number, node in enumerate(nodes.document.json["nodes"]):
        for mover in MOVING_EXTENSIONS:
            if mover in node.get("extensions", {}):
                return f"node {node.get('name', number)} follows others by {mover}, which is not worked out here"
    return ""


def _noted_tolerance(document: Document) -> float | None:
    """Return the tolerance that an earlier reduction noted in the document."""
    extras = document.json.get("asset", {}).get("extras")
    note = extras.get(NOTE_KEY) if isinstance(extras, dict) else None
    tolerance = note.get("tolerance") if isinstance(note, dict) else None
    return tolerance if isinstance(tolerance, float) and tolerance > 0.0 else None


def _with_note(document: Document, tolerance: float) -> Document:
    """Return the document with the tolerance noted in its extras, if extras are possible."""
    asset = document.json.get("asset", {})
    extras = asset.get("extras", {})
    if not isinstance(extras, dict):
        return document
    noted = {**asset, "extras": {**extras, NOTE_KEY: {"tolerance": tolerance}}}
    return replace(document, json={**document.json, "asset": noted})


def _key_times(clip: Clip) -> np.ndarray:
    """Return the ends of a clip, and all times at which a track that moves a node has keys."""
    ends = [track.times[end] for track in clip.tracks for end in (0, -1)]
    moved = [track.times for track in clip.all_tracks if track.path != WEIGHTS and not track.is_constant]
    return np.unique(np.concatenate([np.unique(ends)[[0, -1]], *moved]))


def _moving_clips(nodes: Nodes, clips: Sequence[Clip]) -> dict[Target, set[int]]:
    """Return for each target the numbers of the clips that move it away from its rest value.

    These targets keep a key in the other clips: a player that shows clips one after the other leaves a node where the
    last clip put it.
    """
    result: dict[Target, set[int]] = defaultdict(set)
    for clip in clips:
        for track in clip.all_tracks:
            rest, first = nodes.rest_of(track.node, track.path), track.at(track.times[:1])[0]
            if not (track.is_constant and len(rest) == len(first) and np.allclose(first, rest, atol=SINGLE_EPS)):
                result[track.node, track.path].add(clip.number)
    return result


def _require_proven(document: Document, nodes: Nodes, seen: Seen, clips: Sequence[Clip], tracks: NewTracks) -> None:
    """Check the document as written: it must show the proven tracks and carry the same geometry.

    Raises
    ------
    GltfError
        If it does not.
    """
    document = decompressed(document.reread())
    written, own = read_clips(document), Nodes(document)
    same = all(np.array_equal(nodes.rest[path], own.rest[path]) for path in nodes.rest)
    if not same or not np.array_equal(nodes.parents, own.parents) or not seen.is_same(Seen.of(own, clips)):
        raise GltfError("what would be written carries something else", "leave this file as it is, and report it")
    for clip, result in zip(clips, written, strict=True):
        of_channel = {track.channel: track for track in clip.tracks}
        stored = tracks.get(clip.number)
        new = clip.tracks if stored is None else tuple(shown(of_channel[track.channel], track) for track in stored)
        proven, played = by_target(new + clip.pointers), by_target(result.all_tracks)
        if proven.keys() != played.keys() or not all(played[key].shows(track) for key, track in proven.items()):
            raise GltfError("what would be written shows something else", "leave this file as it is, and report it")


def reduce_file(path: Path, output: Path, options: Options) -> Report:
    """Write a .glb or .gltf file with fewer keys, and the buffer file next to a .gltf: see `reduced`.

    An existing output is replaced only after everything is written. Other files that a .gltf names are not copied.
    """
    report = reduced(read_document(path), options)
    files = {output.name: path.read_bytes()} if report.left_alone else report.document.files(output.name)
    for name, content in files.items():
        beside = output.with_name(f".{secrets.token_hex(4)}{output.suffix}")
        try:
            beside.write_bytes(content)
            beside.replace(output.with_name(name))
        finally:
            beside.unlink(missing_ok=True)
    return report


def _moved_nodes(nodes: Nodes, clips: Iterable[Clip], paths: Collection[str] = tuple(NUMBERS_PER_KEY)) -> np.ndarray:
    """Return the nodes for which clips animate one of the paths, and all of their descendants, parents first."""
    targets = {track.node for clip in clips for track in clip.all_tracks if track.path in paths}
    return nodes.below(np.array(sorted(targets), dtype=np.int64))
