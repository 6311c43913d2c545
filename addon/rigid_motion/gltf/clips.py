"""The reduction of one clip: keys that are needed, stored as small as they may be, and the proof of what they show.

A clip that would not become smaller stays as it was.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..motion.contacts import slide, standing
from .accessors import denormalised, stored_size
from .documents import Document
from .errors import World
from .nodes import Nodes, by_target
from .rewriting import StoredTrack
from .search import Search, reaches
from .thinning import on_lines, shared_times, without_repeats
from .tracks import CUBICSPLINE, LINEAR, ROTATION, SCALE, STEP, TO_XYZW, TRANSLATION, WEIGHTS, Clip, Track

NOISE = 0.01
"""A channel that changes by less than this share of the tolerance is constant."""

WITHIN_WEIGHTS = 0.005
"""How far off weights of morph targets may be: of 1."""

OF_SCALES = 0.1
"""The share of the tolerance that a channel of scales may take."""

OF_INTEGERS = 0.25
"""The share of the tolerance that rotations may take that are stored as 16-bit integers."""

STANDING = 4.0
"""How many times errors of joints count that stand on the ground."""

MORE_SLIDE = 0.001 / 1.7
"""How much farther feet may slide than before, of the size of the body: a millimetre of a grown-up."""

TRIES = 6
"""Searches, each with a smaller tolerance or a larger weight of standing feet than the one before."""

LEAST = 0.1
"""The share of the tolerance that is worth a search."""

WIDE = np.radians(15.0)
"""A gap between samples in which a node turns farther is halved: what hangs on it runs in a bow."""

BOW = 0.02
"""The share of the tolerance by which a spline may leave the line between two samples."""

HALVINGS = 8

INTEGER = 32767
"""What stands for 1 where 16-bit integers are normalised."""


@dataclass(frozen=True)
class Before:
    """What a clip was, or is."""

    keys: int
    """Of all channels together."""

    size: int
    """Bytes of key times and values."""


@dataclass(frozen=True, eq=False)
class ReducedClip:
    """What became of a clip; lengths are in the unit of the document."""

    name: str
    tracks: tuple[StoredTrack, ...] | None
    """None where the clip stays as it was."""

    reason: str
    """Why it does; otherwise empty."""

    before: Before
    after: Before
    error: float = 0.0
    """The largest displacement of any point that is promised."""

    slides: tuple[float, float] = (0.0, 0.0)
    """How far feet slide that stand, before and after."""


class ClipReduction:
    """The search for the keys of one clip.

    Parameters
    ----------
    nodes : Nodes
    clip : Clip
    moving : array of int, shape (n,)
        The nodes that may move, parents before their children.
    radii : array, shape (n,)
        Of the balls around them.
    joints : list of int
        Nodes that are joints, some of which may be feet.
    tolerance, size : float
    """

    def __init__(
        self,
        nodes: Nodes,
        clip: Clip,
        moving: np.ndarray,
        radii: np.ndarray,
        joints: Iterable[int],
        tolerance: float,
        size: float,
    ) -> None:
        self.nodes, self.clip, self.tolerance, self.size = nodes, clip, tolerance, size
        self.document = nodes.document
        truth = by_target(clip.tracks)
        self.span = np.unique(np.concatenate([track.times[[0, -1]] for track in clip.tracks]))[[0, -1]]
        self.world = World(nodes, moving, radii, truth, np.unique(self.span))
        self.world = replace(self.world, times=self._samples())
        self.joints = np.flatnonzero(np.isin(moving, list(joints)))
        self.reach = dict(zip(moving.tolist(), reaches(self.world).tolist(), strict=True))

    def reduced(self) -> ReducedClip:
        before = measured_before(self.document, self.clip)
        settled = self._settled()
        found = self._searched(settled)
        if found is None:
            return ReducedClip(self.clip.name, None, "its keys are needed", before, before)
        tracks, error, slides = found
        after = measured(tracks)
        if after.size >= before.size:
            return ReducedClip(self.clip.name, None, "it is smaller as it was", before, before)
        return ReducedClip(self.clip.name, tuple(tracks), "", before, after, error, slides)

    def _samples(self) -> np.ndarray:
        """The moments between which everything runs evenly, as close as its turns and splines need it."""
        moved = [track for track in self.clip.tracks if track.path != WEIGHTS and not track.is_constant]
        times = np.unique(np.concatenate([self.span, *(track.times for track in moved)]))
        curved = [track for track in moved if track.interpolation == CUBICSPLINE]
        turning = [track for track in moved if track.path == ROTATION and track.interpolation != STEP]
        reach = dict(zip(self.world.moving.tolist(), reaches(replace(self.world, times=times)).tolist(), strict=True))
        for _ in range(HALVINGS):
            halved = np.zeros(len(times) - 1, dtype=bool)
            for track in turning:
                turns = track.at(times)
                halved |= np.abs(np.einsum("ij,ij->i", turns[1:], turns[:-1])) < np.cos(WIDE / 2)
            for track in curved:
                halved |= _bows(track, times) * reach[track.node] > BOW * self.tolerance
            middles = ((times[:-1] + times[1:]) / 2)[halved].astype(np.float32).astype(np.float64)
            more = np.union1d(times, middles)
            if len(more) == len(times):
                break
            times = more
        return times

    def _settled(self) -> dict[tuple[int, str], Track | None]:
        """The tracks that need no search: constant ones, steps, scales and weights. None for what rests."""
        found: dict[tuple[int, str], Track | None] = {}
        for track in self.clip.tracks:
            target = track.node, track.path
            if (constant := self._constant(track)) is not None:
                found[target] = constant if len(constant.times) else None
            elif track.interpolation == STEP:
                keys = without_repeats(track.values)
                found[target] = replace(track, times=track.times[keys], values=track.values[keys])
            elif track.path in (SCALE, WEIGHTS):
                found[target] = self._on_lines(track)
        return found

    def _constant(self, track: Track) -> Track | None:
        """A track of one key where nothing changes that would be seen, of none where it rests as the node does."""
        if track.path == WEIGHTS:
            within, values = (0.0 if track.interpolation == STEP else WITHIN_WEIGHTS), track.at(self._moments(track))
            rest = self.nodes.rest_of(track.node, WEIGHTS)
            rest = rest if len(rest) == values.shape[1] else np.zeros(values.shape[1])
            off = [float(np.abs(values - value).max()) for value in (rest, values[0])]
        else:
            within, values = NOISE * self.tolerance, track.at(self._moments(track))
            rest = self.nodes.rest_of(track.node, track.path)
            off = [float(self._displacements(track, values, value).max()) for value in (rest, values[0])]
        if off[0] <= within:
            return replace(track, interpolation=LINEAR, times=track.times[:0], values=values[:0])
        if off[1] <= within:
            return replace(track, interpolation=LINEAR, times=self.span[:1], values=values[:1])
        return None

    def _moments(self, track: Track) -> np.ndarray:
        """The moments at which a track is looked at."""
        return track.times if track.interpolation != CUBICSPLINE else np.union1d(self.world.times, track.times)

    def _displacements(self, track: Track, values: np.ndarray, others: np.ndarray) -> np.ndarray:
        """How far what hangs on the node is moved at most between values (m, width) and others, shape (m,)."""
        reach = self.reach[track.node]
        if track.path == ROTATION:
            return 2.0 * reach * np.sqrt(np.maximum(1.0 - np.einsum("...i,...i->...", values, others) ** 2, 0.0))
        if track.path == SCALE:
            return reach * np.abs(values / np.where(others == 0.0, 1.0, others) - 1.0).max(axis=-1)
        return np.linalg.norm(values - others, axis=-1) * self._length_above(track.node)

    def _length_above(self, node: int) -> float:
        """How long the axes of a node's parent ever are in the world."""
        parent = int(self.nodes.parents[node])
        if parent < 0:
            return 1.0
        axes = self.nodes.resting.axes[parent]
        if (places := np.flatnonzero(self.world.moving == parent)).size:
            axes = self.nodes.worlds(self.world.moving, self.world.truth, self.world.times).axes[places[0]]
        return float(np.linalg.norm(axes, axis=-2).max())

    def _on_lines(self, track: Track) -> Track:
        """Fewer keys of scales or weights, which depend on nothing else."""
        times = self.world.times if track.path == SCALE else np.union1d(track.times, self._moments(track))
        values = track.at(times)
        within = WITHIN_WEIGHTS
        if track.path == SCALE:
            within = OF_SCALES * self.tolerance / self.reach[track.node] * float(np.abs(values).max())
        keys = on_lines(times, values, within)
        return replace(track, interpolation=LINEAR, times=times[keys], values=values[keys])

    def _searched(
        self, settled: dict[tuple[int, str], Track | None]
    ) -> tuple[list[StoredTrack], float, tuple[float, float]] | None:
        """Stored tracks that keep to the tolerance, the error and how feet slide; None where none are found."""
        world, times = self.world, self.world.times
        smooth = {track: value for track, value in settled.items() if value is not None}
        open_tracks = {target: track for target, track in world.truth.items() if target not in settled}
        dense = {
            target: replace(track, interpolation=LINEAR, times=times, values=track.at(times))
            for target, track in open_tracks.items()
        }
        integers = True
        taken = self._error_of_storing(smooth, dense, integers)
        if taken > OF_INTEGERS * self.tolerance:
            integers, taken = False, self._error_of_storing(smooth, dense, False)
        moved = [target for target, track in smooth.items() if len(track.times) > 1]
        steps = [node for node, path in moved if path in (TRANSLATION, ROTATION)]
        search = Search(world, smooth | dense, np.isin(world.moving, steps))
        places = world.places(world.truth, times)[self.joints]
        stands = (
            standing(times, _upright(places))
            if len(self.joints) and len(times) > 1
            else np.zeros(places.shape[:2], bool)
        )
        slides_before = slide(places, stands)
        allowed, standing_weight = self.tolerance - taken, STANDING
        for _ in range(TRIES):
            if allowed < LEAST * self.tolerance:
                return None
            weights = np.ones((len(world.moving), len(times)))
            weights[self.joints] += (standing_weight - 1.0) * stands
            keys = search.keys(allowed, weights)
            stored = self._stored(smooth, dense, keys, integers)
            shown = by_target(tuple(shown_by(self.clip, track) for track in stored))
            error = world.largest_error(shown, world.eighths)
            slides = slides_before, slide(world.places(shown, times)[self.joints], stands)
            if error > self.tolerance:
                allowed -= 1.2 * (error - self.tolerance)
            elif slides[1] > slides[0] + MORE_SLIDE * self.size:
                standing_weight *= 2.0
            else:
                return stored, error, slides
        return None

    def _error_of_storing(self, smooth: dict, dense: dict, integers: bool) -> float:
        """How far off everything is with all keys, by how it is stored and by what is settled."""
        tracks = [*smooth.values(), *dense.values()]
        shown = by_target(tuple(shown_by(self.clip, stored(track, integers)) for track in tracks))
        return self.world.largest_error(shown, self.world.times)

    def _stored(self, smooth: dict, dense: dict, keys: tuple, integers: bool) -> list[StoredTrack]:
        """All tracks as they are to be stored, those that are searched for with these keys."""
        times = self.world.times
        places = {node: place for place, node in enumerate(self.world.moving.tolist())}
        own = []
        for node, path in dense:
            of_node = keys[places[node]]
            own.append(of_node.rotation if path == ROTATION else of_node.location)
        moving = [number for number, samples in enumerate(own) if len(samples) > 1]
        targets = list(dense)
        widths = [
            8 if integers and targets[number][1] == ROTATION else 4 * dense[targets[number]].values.shape[1]
            for number in moving
        ]
        for number, samples in zip(
            moving, shared_times([own[number] for number in moving], widths, len(times)), strict=True
        ):
            own[number] = samples
        found = []
        for track, samples in zip(dense.values(), own, strict=True):
            key_times = times[samples] if len(samples) > 1 else self.span[:1]
            found.append(stored(replace(track, times=key_times, values=track.values[samples]), integers))
        found += [stored(track, integers) for track in smooth.values()]
        return self._spanning(sorted(found, key=lambda track: track.channel))

    def _spanning(self, tracks: list[StoredTrack]) -> list[StoredTrack]:
        """The same with keys at both ends of the clip in one of them at least: it lasts as long as before."""
        span = self.span.astype(np.float32)
        seen = {time for track in tracks for time in track.times[[0, -1]].tolist()}
        if set(span.tolist()) <= seen:
            return tracks
        if not tracks:
            first = self.clip.tracks[0]
            tracks = [
                stored(replace(first, interpolation=LINEAR, times=self.span[:1], values=first.at(self.span[:1])), False)
            ]
        place = next((number for number, track in enumerate(tracks) if len(track.times) == 1), 0)
        track = shown_by(self.clip, tracks[place])
        times = np.union1d(track.times, np.unique(span))
        tracks[place] = stored(
            replace(track, times=times, values=track.at(times)), tracks[place].values.dtype.kind == "i"
        )
        return tracks


def stored(track: Track, integers: bool) -> StoredTrack:
    """A track as it is stored; rotations as normalised 16-bit integers where these are asked for."""
    values = track.values[..., TO_XYZW] if track.path == ROTATION else track.values
    values = values.reshape(-1, 1 if track.path == WEIGHTS else values.shape[-1])
    if integers and track.path == ROTATION and track.interpolation != CUBICSPLINE:
        values = np.rint(values * INTEGER).astype(np.int16)
    else:
        values = values.astype(np.float32)
    return StoredTrack(track.channel, track.interpolation, track.times.astype(np.float32), values)


def shown_by(clip: Clip, stored: StoredTrack) -> Track:
    """What a stored track shows, of a clip that has its channel."""
    track = next(track for track in clip.tracks if track.channel == stored.channel)
    values = denormalised(stored.values) if stored.values.dtype.kind == "i" else stored.values.astype(np.float64)
    values = values.reshape(len(stored.times), -1)
    if track.path == ROTATION:
        values = values[:, [3, 0, 1, 2]]
    return replace(track, interpolation=stored.interpolation, times=stored.times.astype(np.float64), values=values)


def measured(tracks: Iterable[StoredTrack]) -> Before:
    """Keys and bytes of tracks that are to be stored; what is the same is stored once."""
    parts = {(part.dtype.str, part.tobytes()) for track in tracks for part in track.accessors}
    return Before(sum(len(track.times) for track in tracks), sum(len(content) for _, content in parts))


def measured_before(document: Document, clip: Clip) -> Before:
    """Keys and bytes of the tracks of a clip as it is in the file."""
    animation = document.json["animations"][clip.number]
    samplers = [animation["samplers"][animation["channels"][track.channel]["sampler"]] for track in clip.tracks]
    accessors = {sampler[key] for sampler in samplers for key in ("input", "output")}
    size = sum(stored_size(document, number) for number in accessors)
    return Before(sum(len(track.times) for track in clip.tracks), size)


def _bows(track: Track, times: np.ndarray) -> np.ndarray:
    """How far a spline leaves the straight way between moments (m,), in each gap, as a share of what hangs on it."""
    found = np.zeros(len(times) - 1)
    values = track.at(times)
    for share in (0.25, 0.5, 0.75):
        there = track.at((1 - share) * times[:-1] + share * times[1:])
        line = (1 - share) * values[:-1] + share * values[1:]
        if track.path == ROTATION:
            line = line / np.linalg.norm(line, axis=1, keepdims=True)
        found = np.maximum(found, np.linalg.norm(there - line, axis=1))
    return found


def _upright(places: np.ndarray) -> np.ndarray:
    """Places (..., 3) with the third axis upwards, where glTF has the second."""
    x, y, z = np.moveaxis(places, -1, 0)
    return np.stack((x, -z, y), axis=-1)
