"""Where differences go, and how Blender puts them on top of its own in-betweens: the interface of both ways."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Sequence

import numpy as np

from ..actions.slots import Binding
from ..compute.sources import Source
from ..transforms import Channel, Transform
from .sampled import Layout, Pieces


class Writer(ABC):
    """One way, for one kind of transform. It keeps nothing itself: all there is to it is in the file."""

    @abstractmethod
    def layout(self, source: Source, rate: int) -> Layout:
        """Return how the samples of a source lie in F-curves, so many of them a frame."""

    @abstractmethod
    def most_samples(self, source: Source) -> int:
        """Return how many samples a frame there can be."""

    @abstractmethod
    def write(self, binding: Binding, points: dict[Channel, np.ndarray], layout: Layout | None, pieces: Pieces) -> None:
        """Replace the in-betweens of a transform by these samples and pieces.

        Points are frame and value of each sample alternately. Channels that have none are taken out; without any, its
        users are to be released.
        """

    @abstractmethod
    def is_shown(self, binding: Binding, layout: Layout, channels: Collection[Channel]) -> bool:
        """Return whether what is written in these channels, lying so, is to be seen on all users."""

    def prepare(self, binding: Binding) -> None:
        """Get users ready that were edited, before Blender evaluates them with what is written."""
        return

    @abstractmethod
    def show(self, binding: Binding) -> None:
        """Have users see what is written that came to the slot after it was."""

    @abstractmethod
    def difference(self, binding: Binding, user: Transform, frame: float | None) -> np.ndarray:
        """Return what is on top of a user on a frame of the Action, or as it is shown now.

        As components (10,): the rotation as the properties have it.
        """

    @abstractmethod
    def shown_differences(self, user: Transform) -> list[tuple[np.ndarray, set[str]]]:
        """Return what is on top of a user as it is shown now, even where nothing moves it any more, one by one.

        Each as components (10,), and which of location, rotation and scale it is in.
        """

    @abstractmethod
    def shown_parts(self, user: Transform) -> set[str]:
        """Return which of location, rotation and scale they are in."""

    @abstractmethod
    def hide(self, binding: Binding, user: Transform) -> None:
        """Show a user as its properties have it, until Blender evaluates its animation again."""

    @abstractmethod
    def hold(self, binding: Binding, beside: Sequence[Binding]) -> bool:
        """Have a slot hold what the NLA needs of it beside others that are filled in. Whether that was new to it.

        `beside` is what moves the same users in the NLA, the binding itself among it.
        """

    @abstractmethod
    def release(self, transforms: Iterable[Transform]) -> None:
        """Take off these what was put on them for slots that do not move them any more."""
