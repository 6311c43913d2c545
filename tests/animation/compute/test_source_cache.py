"""What an edit has changed is told by the source from before: the rest of the in-betweens stays as it is."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from rigid_motion.animation import set_mode
from rigid_motion.animation.compute.source_cache import cache_source, changed_range
from rigid_motion.animation.queries.keyed import source_of
from rigid_motion.animation.writers import filling
from tests.animation.keyed import WIDTHS, curves_of
from tests.animation.oracle import assert_shown
from tests.animation.scenes import key, new_object

KEYS = (1.0, 20.0, 41.0, 60.0, 81.0, 100.0)
PLAYED = np.arange(-1.0, 103.0)


def tool(mode: str = "dq_sclerp", order: str = "QUATERNION") -> bpy.types.Object:
    obj = key(new_object("Tool", order), KEYS)
    set_mode(obj, mode)
    return obj


def move_up(obj: bpy.types.Object) -> None:
    curves_of(obj)["location", 1].keyframe_points[2].co_ui.y += 1.0


def move_later(obj: bpy.types.Object) -> None:
    for (path, _), fcurve in curves_of(obj).items():
        if path in WIDTHS:
            fcurve.keyframe_points[2].co_ui.x = 48.0
            fcurve.update()


def insert(obj: bpy.types.Object) -> None:
    for (path, _), fcurve in curves_of(obj).items():
        if path in WIDTHS:
            fcurve.keyframe_points.insert(50.0, 0.5)


def delete(obj: bpy.types.Object) -> None:
    for (path, _), fcurve in curves_of(obj).items():
        if path in WIDTHS:
            fcurve.keyframe_points.remove(fcurve.keyframe_points[2])


EDITS = {"a value": move_up, "a frame": move_later, "an insertion": insert, "a deletion": delete}


def samples_of(obj: bpy.types.Object) -> dict[tuple[str, int], np.ndarray]:
    result = {}
    for channel, fcurve in curves_of(obj).items():
        if channel[0].startswith("delta_"):
            result[channel] = np.empty(2 * len(fcurve.sampled_points), np.float32)
            fcurve.sampled_points.foreach_get("co", result[channel])
    return result


@pytest.mark.parametrize("order", ["QUATERNION", "XZY"])
@pytest.mark.parametrize("mode", ["dq_sclerp", "motor_spline"])
@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_an_edit_of_a_key_computes_the_frames_around_it_and_leaves_the_others(
    live_file, monkeypatch, edit: Callable[[bpy.types.Object], None], mode: str, order: str
):
    obj = tool(mode, order)
    before, ranges = samples_of(obj), []
    sampled = filling.sampled

    def watched(sources, needs, spans=None):
        ranges.extend(spans if spans is not None else [None] * len(sources))
        return sampled(sources, needs, spans)

    monkeypatch.setattr(filling, "sampled", watched)
    edit(obj)
    bpy.context.view_layer.update()
    # Handles of the keys beside it may follow, and a smooth mode looks one key on.
    (first, last), widest = ranges[0], 100 if mode == "motor_spline" else 81
    assert first <= 20
    assert 60 <= last <= widest
    after = samples_of(obj)
    assert after.keys() == before.keys()
    # Without a key quaternions may come round to the next one in the other sign: then all is computed.
    turned = ranges[1:] == [None]
    assert turned or len(ranges) == 1
    for channel, samples in after.items():
        outside = samples[::2] > ranges[0][1]
        assert turned or (samples[1::2][outside] == before[channel][1::2][outside]).all()
    assert_shown([obj], PLAYED)


def test_where_nothing_is_known_of_the_source_before_all_is_computed(live_file):
    obj = tool()
    old = source_of(obj)
    cache_source(old)
    set_mode(obj, "lerp_slerp")
    assert changed_range(old, source_of(obj)) is None, "another mode changes all"
    set_mode(obj, "dq_sclerp")
    for fcurve in curves_of(obj).values():
        fcurve.extrapolation = "LINEAR"
    assert changed_range(old, source_of(obj)) is None, "what goes on changes outside of the keys"
