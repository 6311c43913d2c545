"""Keys as bytes: they show every change, and memory that is not as expected is not read again."""

from __future__ import annotations

import logging
from functools import partial
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from rigid_motion.animation.live import snapshots
from rigid_motion.animation.live.snapshots import read_keys
from tests.animation.keyed import curves_of
from tests.animation.scenes import key, new_object

WARNING = "not in memory as expected"


@pytest.fixture(autouse=True)
def unchecked(monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory that was not checked yet."""
    monkeypatch.setattr(snapshots._Layout, "size", None)


@pytest.fixture
def channels(empty_file) -> list[bpy.types.bpy_prop_collection]:
    """The keys of each channel of an object: as many as `key` makes, and of the last one a single one."""
    obj = new_object()
    key(obj)
    fcurves = list(curves_of(obj).values())
    while len(fcurves[-1].keyframe_points) > 1:
        fcurves[-1].keyframe_points.remove(fcurves[-1].keyframe_points[-1])
    return [fcurve.keyframe_points for fcurve in fcurves]


def test_memory_of_this_blender_is_as_expected(channels, caplog):
    with caplog.at_level(logging.WARNING):
        sizes = [len(content) for content in read_keys(channels)]
    assert snapshots._Layout.size >= 4 * snapshots.NUMBERS
    assert sizes == [snapshots._Layout.size * len(keys) for keys in channels]
    assert WARNING not in caplog.text


read_memory = snapshots._view


def shifted(address: int, size: int) -> np.ndarray:
    """What would be read if the numbers of a key were not where they are expected."""
    return np.roll(read_memory(address, size), 4)


def unread(address: int, size: int) -> np.ndarray:
    raise AssertionError("memory must not be read here")


class Scattered:
    """Keys that are not one behind the other in memory."""

    def __init__(self, keys: bpy.types.bpy_prop_collection) -> None:
        self.keys = keys

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, number: int) -> SimpleNamespace:
        address = self.keys[number].as_pointer() + (8 if number > 1 else 0)
        return SimpleNamespace(as_pointer=lambda: address)

    def foreach_get(self, name: str, values: np.ndarray) -> None:
        self.keys.foreach_get(name, values)


EDITS = (
    lambda keys: setattr(keys[0].co, "y", keys[0].co.y + 1e-3),
    lambda keys: setattr(keys[-1].handle_left, "x", keys[-1].handle_left.x - 1e-3),
    lambda keys: setattr(keys[-1], "handle_right_type", "VECTOR"),
    lambda keys: setattr(keys[0], "interpolation", "ELASTIC"),
    lambda keys: setattr(keys[0], "easing", "EASE_OUT"),
    lambda keys: setattr(keys[0], "period", 3.0),
    lambda keys: setattr(keys[0], "type", "EXTREME"),
    lambda keys: keys.insert(7.25, 1.0),
    lambda keys: keys.remove(keys[0]),
)


def assert_changes_are_seen(channels, read) -> None:
    before = read()
    assert read() == before
    for edit in EDITS:
        edit(channels[1])
        after = read()
        is_same = [now == then for now, then in zip(after, before, strict=True)]
        assert is_same == [number != 1 for number in range(len(channels))]
        before = after


@pytest.mark.parametrize("how", ["as expected", "shifted", "scattered"])
def test_every_change_is_seen_however_keys_are_in_memory(channels, monkeypatch, caplog, how):
    read = partial(read_keys, [Scattered(keys) for keys in channels] if how == "scattered" else channels)
    if how != "as expected":
        monkeypatch.setattr(snapshots, "_view", shifted if how == "shifted" else unread)
        with caplog.at_level(logging.WARNING):
            read()
        assert snapshots._Layout.size == 0
        assert caplog.text.count(WARNING) == 1
        monkeypatch.setattr(snapshots, "_view", unread)
    assert_changes_are_seen(channels, read)


def test_single_keys_are_read_before_anything_is_known_of_memory(channels):
    before = read_keys(channels[-1:])
    assert snapshots._Layout.size is None
    channels[-1][0].co.y += 1.0
    assert read_keys(channels[-1:]) != before
