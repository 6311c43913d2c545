"""Key reduction of one glTF clip: finds the needed keys, stores them compactly and proves the tolerance.

A clip that would not become smaller stays unchanged.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Container, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..motion import SeparateKeys, Skeleton
from ..motion.skeleton_stretches import Run
from .errors import NO_SAMPLES, PARTS_PER_GAP, Feet, World, Worst
from .meshopt import TIME_EXPONENT, packed_size
from .nodes import by_target
from .packing import Packing
from .rewriting import Amount, EveryKey, StoredTrack, amount, key_size, shown, stored
from .search import NodeSearch
from .settling import SettledChannel, settled, shared_times
from .tracks import CUBICSPLINE, LINEAR, ROTATION, TRANSLATION, WEIGHTS, Clip, Target, Track, Tracks

OF_INTEGERS = 0.85
"""Most that the error from storing rotations as 16-bit integers may take, as a fraction of the tolerance."""

MORE_SLIDE = 0.001 / 1.7
"""How much farther feet may slide than before, as a fraction of the body's size: a millimetre for an adult."""

TIGHTER_TOLERANCE_RATIO = 0.7
"""Factor on the tolerance for the next search, when putting keys back does not help."""

FEET_WEIGH = (1.0, 4.0, 16.0, 64.0)
"""Weights for the errors of standing feet in the search for a given number of key poses, tried in turn."""

MAX_PUT_BACK_ROUNDS = 24
"""Most rounds of putting keys back when the proof fails."""

MIN_TOLERANCE_RATIO = 0.1
"""Least fraction of the tolerance that is worth a search."""

NEEDED_CHANNELS, ALL_CHANNELS, MOVING_CHANNELS = CHANNELS = ("needed", "all", "moving")

NEEDED_REASON, LARGER_REASON = "all of its keys are needed", "fewer keys would take more bytes"


@dataclass(frozen=True)
class Options:
    """Options of the key reduction. Lengths are in the unit of the document."""

    tolerance: float | None = None
    """Largest world-space displacement of any point within a node's radius; None: a fraction of the size."""

    radius: float | None = None
    """Least radius of a node's ball, which encloses all that the node carries; None: a fraction of the size."""

    shared: bool = False
    """Whether all nodes of a clip have keys at the same times."""

    count: int | None = None
    """Number of key poses for each clip, instead of a tolerance."""

    channels: str = NEEDED_CHANNELS
    """One of CHANNELS: whether channels of resting nodes keep a key even if no other clip moves the node."""

    feet: bool = True
    """Whether standing feet may slide only `MORE_SLIDE` farther than before, however large the tolerance."""

    meshopt: bool = False
    """Whether to compress the document with meshopt; a compressed document stays compressed in any case."""

    curves: bool = False
    """Whether to use cubic curves instead of lines, where lines need more keys: see `curves`."""

    run: Run = map
    """Function that runs the search over stretches of long clips: called like `map`, with module-level functions."""


@dataclass(frozen=True, eq=False)
class ReducedClip:
    """Result of reducing a clip; lengths are in the unit of the document."""

    number: int
    name: str
    tracks: tuple[StoredTrack, ...] | None
    """None if the clip stays unchanged."""

    reason: str
    """Why the clip stays unchanged; otherwise empty."""

    before: Amount
    after: Amount
    error: float = 0.0
    """The largest displacement of visible geometry, in world space."""

    where: str = ""
    """The node with the largest displacement, and its time."""

    slides: tuple[float, float] = (0.0, 0.0)
    """How far standing joints slide, before and after."""

    between: float = 0.0
    """For curves: the largest displacement between frames, compared with lines from frame to frame."""

    lines: int = 0
    """For curves: the number of keys that these channels would have needed with lines."""


class _LargerError(Exception):
    """The new tracks take no fewer bytes than the tracks of the clip."""


def kept(number: int, name: str, before: Amount, reason: str) -> ReducedClip:
    """Return the result for a clip that stays unchanged."""
    return ReducedClip(number, name, None, reason, before, before)


class ClipReduction:
    """The search for the keys of one clip.

    Parameters
    ----------
    world : World
        Moved by the clip, with moments at least at all of its keys.
    clip : Clip
    needed : container of Target
        Channels that keep a key even if their node stays at rest.
    joints : iterable of int
        Nodes that are joints, and may be feet.
    size : float
        Size of the body.
    options : Options
        With a tolerance.
    before : Amount
        Keys and bytes of the clip that new keys would replace.
    """

    def __init__(
        self,
        world: World,
        clip: Clip,
        needed: Container[Target],
        joints: Iterable[int],
        size: float,
        options: Options,
        before: Amount,
    ) -> None:
        self.clip, self.options, self.size = clip, options, size
        assert options.tolerance is not None
        self.tolerance = options.tolerance
        self.before = before
        channels = [SettledChannel(world, track, self.tolerance) for track in clip.all_tracks]
        times = self._moments(world, channels)
        self.world = world if np.array_equal(times, world.times) else replace(world, times=times)
        self.given = by_target(clip.pointers)
        """Tracks that stay unchanged."""
        result = settled(channels[: len(clip.tracks)], needed)
        self.settled = {target: track for target, track in result.items() if track is not None}
        moving = [target for target, track in {**self.settled, **self.given}.items() if len(track.times) > 1]
        self.stepping = {node for node, path in moving if path in (TRANSLATION, ROTATION)}
        """Nodes left out of the search."""
        rest = {target: track for target, track in by_target(clip.tracks).items() if target not in result}
        self.settled |= {target: track.whole for target, track in rest.items() if target[0] in self.stepping}
        self.dense = {target: track for target, track in rest.items() if target[0] not in self.stepping}
        """Tracks that will have fewer keys."""
        self.feet = Feet(self.world, joints)
        self.more_slide = MORE_SLIDE * size if options.feet else np.inf

    def reduced(self) -> ReducedClip:
        """Return the clip with fewer keys, or unchanged."""
        count = self.options.count
        try:
            result = self._with_key_pose_count(count) if self.dense and count else self._within_tolerance()
        except _LargerError:
            return self._unchanged(LARGER_REASON)
        if result is None:
            return self._unchanged(NEEDED_REASON)
        return self._result(*result)

    def _result(self, tracks: list[StoredTrack], worst: Worst) -> ReducedClip:
        after = self._amount(tracks)
        slides, where = self.feet.slides(self._shown(tracks)), self._node_text(worst)
        return ReducedClip(
            self.clip.number, self.clip.name, tuple(tracks), "", self.before, after, worst.error, where, slides
        )

    def _moments(self, world: World, channels: Sequence[SettledChannel]) -> np.ndarray:
        """Return the times between which all channels run evenly."""
        moved = [
            channel.times for channel in channels if channel.track.path != WEIGHTS and not channel.track.is_constant
        ]
        return np.unique(np.concatenate([world.times, *moved]))

    def _node_text(self, worst: Worst) -> str:
        if worst.node < 0:
            return ""
        name = self.world.nodes.document.json["nodes"][worst.node].get("name")
        node = f'node "{name}"' if isinstance(name, str) and name else f"node {worst.node}"
        return f"{node} at {worst.time:.4g} s"

    def _amount(self, tracks: list[StoredTrack]) -> Amount:
        """Return the keys and bytes of tracks. Raises _LargerError if the bytes are no fewer than before."""
        result = amount(tracks)
        if self.options.meshopt:
            arrays = [part for track in tracks for part in track.accessors]
            result = replace(result, size=packed_size(arrays, range(0, len(arrays), 2)))
        if result.size >= self.before.size:
            raise _LargerError
        return result

    def _unchanged(self, reason: str) -> ReducedClip:
        return kept(self.clip.number, self.clip.name, self.before, reason)

    def _with_key_pose_count(self, count: int) -> tuple[list[StoredTrack], Worst]:
        """Return tracks with `count` key poses, chosen so that feet slide least, and the largest error."""
        search = self._search()
        best, farthest = [], np.inf
        for weight in FEET_WEIGH:
            weights = np.ones((len(self.world.moving), len(self.world.times)))
            weights[self.feet.rows] += (weight - 1.0) * self.feet.stands
            tracks = self._key_poses(search.so_many_key_poses(count, weights))
            farther = self.feet.farther(self._shown(tracks))
            if farther < farthest:
                best, farthest = tracks, farther
            if farther <= self.more_slide:
                break
        return best, self.world.worst(self._shown(best), self.morphed)[0]

    def _packed(self) -> tuple[list[StoredTrack], Worst] | None:
        """Return tracks that meshopt packs into few bytes within the tolerance, and the largest error, or None."""
        held = {
            target: track
            for target, track in self.settled.items()
            if target[1] in (TRANSLATION, ROTATION) and len(track.times) == 1 and target[0] not in self.stepping
        }
        if not self.dense and not held:
            return None
        others = {target: track for target, track in self.settled.items() if target not in held}
        fixed = {**self.given, **self._shown(map(self._stored_track, others.values()))}
        packing = Packing(self.world, {**self.dense, **held}, fixed, self.tolerance, self.feet, self.more_slide)
        for keys in packing.trials():
            new = [
                StoredTrack(packing.tracks[target].channel, LINEAR, own.times.astype(np.float32), own.stored)
                for target, own in keys.items()
            ]
            tracks = self._spanning(new + list(map(self._stored_track, others.values())))
            self._amount(tracks)
            played, times = self._shown(tracks), self.world.times
            if len(self.feet.slips(played, self.more_slide)[0]):
                continue
            moments = np.unique(np.concatenate([times, *(own.times for own in keys.values())]))
            world = replace(self.world, times=moments[(moments >= times[0]) & (moments <= times[-1])])
            if len(world.worst(played, self.morphed, self.tolerance, parts=1)[1]):
                continue
            if (worst := max(self.morphed[0], world.worst(played, self.morphed)[0])).error <= self.tolerance:
                return tracks, worst
        return None

    def _key_poses(self, keys: np.ndarray) -> list[StoredTrack]:
        """Return all tracks as stored, with key poses at these samples."""
        return self._stored([keys] * len(self.dense))

    def _within_tolerance(self) -> tuple[list[StoredTrack], Worst] | None:
        """Return tracks with few keys within the tolerance, and their largest error; None if there are none."""
        if self.options.meshopt and not self.options.shared and (result := self._packed()) is not None:
            return result
        if not self.dense:
            return self._proven([])
        search, allowed = self._search(), self.tolerance - self.storing[1]
        while allowed > MIN_TOLERANCE_RATIO * self.tolerance:
            if self.options.shared:
                samples = [search.key_poses(allowed)] * len(self.dense)
            else:
                samples = self._key_samples(search.keys(allowed))
            result = self._proven(samples)
            if result is not None:
                return result
            allowed *= TIGHTER_TOLERANCE_RATIO
        return None

    def _search(self) -> NodeSearch:
        """Return a search for the keys of nodes, except nodes with a settled or given track of several keys."""
        fixed = np.isin(self.world.moving, list(self.stepping))
        return NodeSearch(self.world, {**self.given, **self.settled, **self.dense}, fixed, self.options.run)

    @cached_property
    def morphed(self) -> tuple[Worst, np.ndarray]:
        """Errors of the morph targets, which need no search."""
        weights = [stored(track, integers=False) for (_, path), track in self.settled.items() if path == WEIGHTS]
        return self.world.morphed(self._shown(weights))

    @cached_property
    def storing(self) -> tuple[frozenset[Target], float]:
        """Rotations stored as integers, and the error with keys at all samples, from storing and settled tracks.

        Rotations that move the least geometry are stored as integers first.
        """
        reaches, rows = self.world.reaches, self.world.rows
        turned = [target for target in (*self.dense, *self.settled) if target[1] == ROTATION]
        turned.sort(key=lambda target: reaches[rows[target[0]]])

        def taken(count: int) -> float:
            integers, times = frozenset(turned[:count]), self.world.times
            dense = {
                target: replace(track.keyed(times[:1]), times=times, values=EveryKey(track, times, target in integers))
                for target, track in self.dense.items()
            }
            held = [stored(track, integers=target in integers) for target, track in self.settled.items()]
            return self.world.worst({**self._shown(held), **dense}, self.morphed, parts=1)[0].error

        count, allowed = len(turned), OF_INTEGERS * self.tolerance
        if (off := taken(count)) > allowed:
            count = max(bisect_right(range(count), allowed, key=taken) - 1, 0)
            off = taken(count)
        return frozenset(turned[:count]), off

    def _stored_track(self, track: Track) -> StoredTrack:
        return stored(track, integers=(track.node, track.path) in self.storing[0])

    def _key_samples(self, keys: Sequence[SeparateKeys]) -> list[np.ndarray]:
        """Return the key samples of each dense track."""
        of_nodes = [(path, keys[self.world.rows[node]]) for node, path in self.dense]
        return [own.rotation if path == ROTATION else own.location for path, own in of_nodes]

    def _proven(self, samples: list[np.ndarray]) -> tuple[list[StoredTrack], Worst] | None:
        """Return stored tracks with keys at these samples, and more where the proof fails, and their largest error.

        None if the proof still fails after several rounds.
        """
        sound: dict[int, tuple[int, Worst]] = {}
        for _ in range(MAX_PUT_BACK_ROUNDS):
            tracks = self._stored(samples)
            self._amount(tracks)
            rows, eighths = self._failures(self._shown(tracks), sound)
            if not len(rows):
                worst = max(self.world.morphed(self._shown(tracks))[0], *(worst for _, worst in sound.values()))
                return (tracks, worst) if worst.error <= self.tolerance else None
            samples = self._with_more_keys(samples, rows, eighths)
        return None

    def _failures(self, tracks: Tracks, sound: dict[int, tuple[int, Worst]]) -> tuple[np.ndarray, np.ndarray]:
        """Return where tracks exceed the tolerance or slide: rows of nodes, and times in eighths of a sample.

        Sliding feet are checked first and hide other failures. Stretches without failures are recorded in `sound`
        with their digest and largest error: they are not checked again while the digest stays the same.
        """
        world = self.world
        rows, samples = self.feet.slips(tracks, self.more_slide)
        if len(rows):
            return rows, PARTS_PER_GAP * samples
        failures = [(NO_SAMPLES, NO_SAMPLES)]
        for number, digest in enumerate(world.digests(tracks)):
            if number in sound and sound[number][0] == digest:
                continue
            for parts in (1, PARTS_PER_GAP):
                worst, rows, numbers = world.worst(tracks, self.morphed, self.tolerance, parts=parts, among=(number,))
                if len(rows):
                    failures.append((rows, PARTS_PER_GAP // parts * numbers))
                    break
            else:
                sound[number] = digest, worst
        all_rows, all_numbers = map(np.concatenate, zip(*failures, strict=True))
        return all_rows, all_numbers

    def _with_more_keys(self, samples: list[np.ndarray], rows: np.ndarray, eighths: np.ndarray) -> list[np.ndarray]:
        """Return samples with more keys around these eighths, for the nodes of these rows and all their ancestors."""
        desired = np.zeros((len(self.world.moving), len(self.world.times)), dtype=bool)
        desired[rows, eighths // PARTS_PER_GAP] = desired[rows, -(-eighths // PARTS_PER_GAP)] = True
        desired = Skeleton(self.world.parents).most_below(desired)
        if self.options.shared:
            desired[:] = desired.any(axis=0)
        ends = (0, len(self.world.times) - 1)
        more = [np.flatnonzero(desired[self.world.rows[node]]) for node, _ in self.dense]
        return [
            np.union1d(own, (*ends, *new)).astype(np.int64) if len(new) else own
            for own, new in zip(samples, more, strict=True)
        ]

    def _stored(self, samples: Sequence[np.ndarray]) -> list[StoredTrack]:
        """Return all tracks as stored, with dense tracks keyed at these samples."""
        times, tracks = self.world.times, []
        keys = dict(zip(self.dense, samples, strict=True))
        moving = [target for target, own in keys.items() if len(own) > 1]
        widths = [key_size(target[1], integers=target in self.storing[0]) for target in moving]
        shared = shared_times([keys[target] for target in moving], widths, len(times))
        together = dict(zip(moving, shared, strict=True))
        for target, track in self.dense.items():
            thinned = track.keyed(times[keys[target]])
            # Keys added only to share times do not change the animation.
            more = thinned.keyed(times[together[target]]) if target in together else replace(thinned, times=times[:1])
            tracks.append(self._stored_track(more))
        return self._spanning(tracks + [self._stored_track(track) for track in self.settled.values()])

    def _spanning(self, tracks: list[StoredTrack]) -> list[StoredTrack]:
        """Return the tracks, one of them extended to both ends of the clip if needed: its duration stays the same."""
        ends = self.world.times[[0, -1]]
        times = [*(track.times for track in tracks), *(track.times for track in self.given.values())]
        seen = np.concatenate([own[[0, -1]] for own in times]) if times else ends[:0]
        rounded = 2.0 ** (TIME_EXPONENT - 1) if self.options.meshopt else 0.0
        if len(seen) and np.abs(seen[:, None] - ends.astype(np.float32)).min(axis=0).max() <= rounded:
            return tracks
        number = min(
            (number for number, track in enumerate(tracks) if track.interpolation != CUBICSPLINE),
            key=lambda number: len(tracks[number].times),
            default=len(tracks),
        )
        if number < len(tracks):
            track = shown(self._of_channel[tracks[number].channel], tracks[number])
        else:
            known = {track.channel for track in tracks}
            track = next(track for track in self.clip.tracks if track.channel not in known).keyed(ends[:1])
        longer = track.keyed(np.union1d(track.times, ends))
        tracks[number : number + 1] = [self._stored_track(replace(longer, interpolation=track.interpolation))]
        return tracks

    @property
    def _of_channel(self) -> dict[int, Track]:
        return {track.channel: track for track in self.clip.tracks}

    def _shown(self, tracks: Iterable[StoredTrack]) -> Tracks:
        of_channel = self._of_channel
        return {**self.given, **by_target(tuple(shown(of_channel[track.channel], track) for track in tracks))}
