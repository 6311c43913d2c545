"""The keys of F-curves as bytes, to tell quickly whether any of them has changed.

Blender offers no way to get at all of a key at once: property by property it takes four times as long as to read the
memory that the keys are in. How much memory a key takes and what is where in it Blender promises nowhere, so the first
F-curves that come are read in both ways. Where these disagree, all keys are read by Blender's own functions from then
on, for as long as the process lives.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

import bpy
import numpy as np

from ..actions.channels import KEY_FIELDS

log = logging.getLogger(__package__)

Channels = Sequence[bpy.types.bpy_prop_collection]
"""`keyframe_points` of F-curves."""

POINTS = {"handle_left": slice(0, 2), "co": slice(3, 5), "handle_right": slice(6, 8)}
"""The places of a key's points in its memory, counted in single-precision numbers: behind each is an unused one."""

NUMBERS = 9
"""The number of numbers that a key begins with."""

_NOTHING = np.empty(0, np.uint8)


def key_reader(channels: Channels) -> Callable[[], list[bytes]]:
    """Return a function that reads the keys of these channels, for as long as Blender keeps the channels.

    It returns the bytes of each channel's keys. They differ wherever anything of a key differs, selection included, and
    also where the same keys were read in the other way before.
    """
    return _Reader(channels).read


class _Layout:
    """What is known of the memory of keys."""

    size: int | None = None
    """The bytes that a key takes. None as long as no two of one F-curve were seen, 0 where it is not as expected."""


class _Reader:
    """Reads the keys of some channels, again and again.

    What leads to the memory of each channel is kept, for as long as Blender keeps the keys where they are.
    """

    def __init__(self, channels: Channels) -> None:
        self.channels = channels
        self.addresses = [(0, 0)] * len(channels)
        """The addresses of the keys of each channel in memory, and how many bytes they are."""
        self.views = [_NOTHING] * len(channels)

    def read(self) -> list[bytes]:
        if _Layout.size is None:
            _Layout.size = _checked_size(self.channels)
        size = _Layout.size
        if not size:
            return [_by_property(keys) for keys in self.channels]
        addresses = [(keys[0].as_pointer(), size * count) if (count := len(keys)) else (0, 0) for keys in self.channels]
        if addresses != self.addresses:
            for number, (address, before) in enumerate(zip(addresses, self.addresses, strict=True)):
                if address != before:
                    self.views[number] = _view(*address) if address[1] else _NOTHING
            self.addresses = addresses
        return [view.tobytes() for view in self.views]


def _checked_size(channels: Channels) -> int | None:
    """Return how many bytes a key takes: see `_Layout.size`."""
    several = [keys for keys in channels if len(keys) > 1]
    if not several:
        return None
    size = several[0][1].as_pointer() - several[0][0].as_pointer()
    if all(_agrees(keys, size) for keys in several):
        return size
    log.warning("Keys are not in memory as expected, and are read by Blender's own functions, which takes longer")
    return 0


def _agrees(keys: bpy.types.bpy_prop_collection, size: int) -> bool:
    """Return whether memory has the same keys as Blender says, one behind the other and each of so many bytes."""
    count, first = len(keys), keys[0].as_pointer()
    if size < 4 * NUMBERS or size % 4 or keys[count - 1].as_pointer() - first != size * (count - 1):
        return False
    numbers = _view(first, size * count).reshape(count, size)[:, : 4 * NUMBERS].copy().view(np.int32)
    for name, columns in POINTS.items():
        expected = np.empty((count, 2), np.float32)
        keys.foreach_get(name, expected.ravel())
        if not np.array_equal(numbers[:, columns], expected.view(np.int32)):
            return False
    return True


def _by_property(keys: bpy.types.bpy_prop_collection) -> bytes:
    """Return all there is to keys, as Blender's own functions have it."""
    result = []
    for name, (width, kind) in KEY_FIELDS.items():
        values = np.empty(len(keys) * width, kind)
        keys.foreach_get(name, values)
        result.append(values.tobytes())
    return b"".join(result)


class _Memory:
    """A stretch of memory that NumPy can read."""

    __array_interface__: dict[str, object]


def _view(address: int, size: int) -> np.ndarray:
    memory = _Memory()
    memory.__array_interface__ = {"data": (address, True), "shape": (size,), "typestr": "|u1", "version": 3}
    return np.asarray(memory)
