"""Motion of an object or bone with keys, on any frames: the source of its path, its ghosts and other drawings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...animation.baking.motions import shown
from ...animation.evaluation.components import LOCATION, MODE_NUMBERS
from ...animation.evaluation.sources import KeyedTransform
from ...animation.transforms import Transform
from ...motion.affine import AffineMaps
from .ghosts import Ghosts, ghost_frames, matrices_of
from .kinds import Space, axis_length_of
from .parents import CarriedTargets, Parents, follows_keys, identity, maps_of
from .points import DrawnPath, Piece, axis_frames, sample_frames, tick_frames
from .records import PlaceRecord

MAX_FRAMES = 4096
"""The most frames on which the motion is sampled, in even steps."""


class SeenMotion:
    """The motion of an object or bone with keys in its Action, carried by its parents.

    Places are in the space of its path: the world, if only keys move its parents; or else the space of its channels as
    it is on the current frame.

    Parameters
    ----------
    target : Transform
    source : KeyedTransform
    carried : CarriedTargets
        Shared by all targets that are drawn together.
    space : Space
        The space of its channels on the current frame.
    """

    records: tuple[tuple[PlaceRecord, int], ...] = ()
    """Place records that it depends on, with their versions when it was read."""

    jumps: tuple[float, ...] = ()
    """Frames where its place may jump."""

    def __init__(self, target: Transform, source: KeyedTransform, carried: CarriedTargets, space: Space) -> None:
        self.target, self.source, self._parents = target, source, Parents(target, carried)
        self.in_world = follows_keys(target, self._parents)
        self.space = identity() if self.in_world else maps_of(space.matrix)
        """The map from the space of its path into the world."""
        self._turn = space.turn
        self.carriers = self._parents.carriers
        """All its parents, and its holders that move by keys."""
        self.ids = frozenset(self._parents.ids if self.in_world else ())
        """Session ids of the data-blocks that determine the motion of its parents and holders."""
        self.point = np.array(target.motion.lead)
        """The point whose path is drawn, on its own axes, shape (3,)."""
        if target.is_part and not self.point.any():
            bone = target.pose_bone.bone
            self.point[1] = bone.length * (LOCATION not in source.keyed or bone.use_connect)

    @property
    def has_path(self) -> bool:
        """Return whether it has the two keys that a path needs, or is carried along at rest."""
        return len(self.source.key_frames) > 1 or self.source.carried is not None

    @property
    def range(self) -> tuple[int, int]:
        """The first and last whole frame of its path."""
        return self.source.seen_range

    @property
    def digest(self) -> tuple:
        """A digest of everything that determines where it is carried."""
        return self._parents.digest if self.in_world else ()

    def frames(self, per_frame: int = 1) -> np.ndarray:
        """Return evenly spaced frames from the first to the last: `per_frame` in each, at most MAX_FRAMES steps."""
        first, last = self.range
        return np.linspace(first, last, min(per_frame * (last - first), MAX_FRAMES) + 1)

    def spaces(self, frames: np.ndarray) -> tuple[AffineMaps, np.ndarray | None]:
        """Return the same as `Parents.spaces`, but into the space of the path."""
        if self.in_world:
            return self._parents.spaces(frames)
        turn = None if self._turn is None else np.broadcast_to(self._turn, (len(frames), 3, 3))
        return identity(len(frames)), turn

    def places(self, frames: np.ndarray, mode: str | None = None) -> AffineMaps:
        """Return the maps on rising frames (n,). ValueError if its numbers make no motion.

        `mode` replaces the modes of its segments.
        """
        return self._placed(self.source, frames, mode, *self.spaces(frames))

    def _placed(
        self,
        source: KeyedTransform,
        frames: np.ndarray,
        mode: str | None,
        spaces: AffineMaps,
        turns: np.ndarray | None,
    ) -> AffineMaps:
        """Return the maps of a source's channels on frames (n,) in these spaces, see `Parents.spaces`."""
        if mode is not None:
            source = replace(source, mode=MODE_NUMBERS[mode])
        maps = shown(self.target, source, frames)[1]
        origins = maps.origins
        if self.target.is_part and self.target.pose_bone.bone.use_connect and self.target.pose_bone.parent:
            origins = np.zeros_like(origins)
        return spaces @ AffineMaps(maps.axes if turns is None else turns @ maps.axes, origins)

    def at_point(self, frames: np.ndarray, mode: str | None = None) -> AffineMaps:
        """Return the same as `places`, with the point of the path as origin."""
        maps = self.places(frames, mode)
        return AffineMaps(maps.axes, maps.at(self.point))

    def holders_at(self, _frames: np.ndarray) -> np.ndarray | None:
        """Return the numbers of its holders on frames (n,), see `points.Piece`; None if it is never held."""
        return None

    def pieces(self, _frames: np.ndarray) -> tuple[Piece, ...]:
        """Return the pieces of a path with points on frames (n,)."""
        return ()

    def trace(
        self, mode: str | None = None, tick_step: int = 0, axes_size: float = 1.0, selected: np.ndarray | None = None
    ) -> DrawnPath | None:
        """Return its path, None if it has one frame only. ValueError if its numbers make no motion.

        Parameters
        ----------
        mode : str, optional
            One of `MODE_IDS`, as a preview. None for the modes of the segments.
        tick_step : int
            Ticks are on multiples of this many frames. 0 for as many as are legible.
        axes_size : float
            Length of the axes at the ticks. At 1 they are half as long as the object or bone.
        selected : array, shape (n,), optional
            The frames of the selected keys.
        """
        first, last = self.range
        if first == last:
            return None
        keys, ticks = self.source.keyed_frames, tick_frames(first, last, tick_step)
        samples = np.unique(np.concatenate((sample_frames(first, last), keys, self.jumps)))
        frames = np.union1d(samples, ticks)
        on_samples, on_keys, on_ticks, on_axes = (
            np.searchsorted(frames, some) for some in (samples, keys, ticks, axis_frames(ticks))
        )
        is_native = not self.source.is_live if mode is None else mode == "BLENDER"
        native = self.at_point(frames, "BLENDER")
        desired = native if is_native else self.at_point(frames, mode)
        axes, length = desired[on_axes], axes_size * axis_length_of(self.target)
        scales = np.linalg.norm(axes.axes, axis=1, keepdims=True)
        directions = axes.axes * scales.max(axis=-1, keepdims=True) / np.where(scales > 0.0, scales, 1.0)
        ends = axes.origins[:, None] + length * np.moveaxis(directions, -1, 1)
        return DrawnPath(
            frames=samples,
            native=native.origins[on_samples],
            desired=None if is_native else desired.origins[on_samples],
            key_frames=keys,
            keys=desired.origins[on_keys],
            selected=np.isin(keys, () if selected is None else selected),
            tick_frames=ticks,
            native_ticks=native.origins[on_ticks],
            desired_ticks=None if is_native else desired.origins[on_ticks],
            axis_frames=frames[on_axes],
            axes=np.stack((np.broadcast_to(axes.origins[:, None], ends.shape), ends), axis=2),
            in_world=self.in_world,
            pieces=self.pieces(samples),
        )

    def ghosts(self, step: int, mode: str | None) -> Ghosts:
        """Return its ghosts on `ghost_frames`. ValueError if its numbers make no motion."""
        frames = ghost_frames(*self.range, step, self.source.keyed_frames)
        return Ghosts(frames, matrices_of(self.places(frames, mode)), self.holders_at(frames))
