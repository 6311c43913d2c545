"""F-curve modifiers added by the animator act on the displayed motion, of any type and added at any time.

The reference is Blender itself: the same modifiers on an object with linear keys on every eighth of a frame.
"""

from __future__ import annotations

import itertools

import bpy
import numpy as np
import pytest

from rigid_motion.animation import problem_of, refresh, repeat, set_mode
from rigid_motion.animation.actions.modifiers import set_settings
from tests.animation.bones.rigs import in_turn
from tests.animation.keyed import curves_of, rotation_path, snapshot
from tests.animation.oracle import assert_near, shown_worlds
from tests.animation.scenes import give_own_deltas, key, key_densely, new_object

PLAYED, IN_ROUNDS = np.arange(1.0, 40.0, 0.25), np.arange(-60.0, 120.0, 0.5)
RANGE = {"use_restricted_range": True, "frame_start": 7.0, "frame_end": 31.0, "blend_in": 5.0}
PART = {"use_influence": True, "influence": 0.5}

MODIFIERS: dict[str, tuple[str, dict[str, object]]] = {
    "twos": ("STEPPED", {"frame_step": 2.0, "frame_offset": 1.0}),
    "twos and a half, for a while": ("STEPPED", {"frame_step": 2.5, "use_frame_start": True, "frame_start": 9.0}),
    "stepped in part": ("STEPPED", {"frame_step": 3.0, **PART}),
    "noise": ("NOISE", {"strength": 1.5, "scale": 4.0, "phase": 3.0}),
    "noise in part of the time": ("NOISE", {"strength": 1.5, "scale": 4.0, **RANGE}),
    "noise that multiplies": ("NOISE", {"strength": 1.5, "scale": 4.0, "blend_type": "MULTIPLY", **PART}),
    "limits": ("LIMITS", {"use_min_y": True, "min_y": -0.4, "use_max_y": True, "max_y": 0.3}),
    "sine": ("FNGENERATOR", {"use_additive": True, "amplitude": 0.7, "phase_multiplier": 0.4}),
    "sine instead": ("FNGENERATOR", {"amplitude": 0.7, "phase_multiplier": 0.4, **PART}),
    "ramp": ("GENERATOR", {"use_additive": True, "coefficients": (0.5, -0.02), **RANGE}),
    "ramp of factors": ("GENERATOR", {"use_additive": True, "mode": "POLYNOMIAL_FACTORISED"}),
    "muted": ("LIMITS", {"use_min_y": True, "min_y": 5.0, "mute": True}),
}


def modify(fcurves, *modifiers: tuple[str, dict[str, object]]) -> None:
    for fcurve, (kind, settings) in itertools.product(fcurves, modifiers):
        set_settings(fcurve.modifiers.new(kind), settings)
    bpy.context.view_layer.update()


def some_of(obj: bpy.types.Object) -> list[bpy.types.FCurve]:
    """Return the channels that get modifiers: only some channels of each part."""
    curves = curves_of(obj)
    return [curves["location", 1], curves["location", 2], curves[rotation_path(obj), 1], curves["scale", 0]]


@pytest.mark.parametrize(
    ("what", "how"),
    in_turn(
        [*MODIFIERS, "twos, then noise"],
        [
            ("QUATERNION", "after the mode"),
            ("ZXY", "before the mode"),
            ("AXIS_ANGLE", "after the mode"),
            ("QUATERNION", "before the mode, in rounds"),
        ],
    ),
)
def test_a_modifier_acts_on_what_is_seen(live_file, what, how):
    order, when = how
    obj, dense = (key(new_object(name, order), seed=4, scale="even") for name in ("Tool", "Dense"))
    for moved in (obj, dense):
        give_own_deltas(moved)
    keys, in_rounds = snapshot(obj), when.endswith("rounds")
    modifiers = [MODIFIERS[name] for name in what.split(", then ")]
    set_mode(dense, "cga_slerp")
    key_densely(dense)
    for moved in (obj, dense):
        if moved is dense or when != "after the mode":
            modify(some_of(moved), *modifiers)
        if in_rounds:
            repeat(moved, "MIRROR")
    set_mode(obj, "cga_slerp")
    if when == "after the mode":
        modify(some_of(obj), *modifiers)
    assert problem_of(obj) == ""
    assert refresh() == 0
    shown, expected = shown_worlds([obj, dense], IN_ROUNDS if in_rounds else PLAYED)
    assert_near(shown, expected, what, 2e-5)
    set_mode(obj, "BLENDER")
    for fcurve in some_of(obj):
        for kept, (kind, settings) in zip(list(fcurve.modifiers)[in_rounds:], modifiers, strict=True):
            assert kept.type == kind
            for name, value in settings.items():
                got = getattr(kept, name)
                assert (tuple(got) if name == "coefficients" else got) == pytest.approx(value), name
    for fcurve in curves_of(obj).values():
        for modifier in list(fcurve.modifiers):
            fcurve.modifiers.remove(modifier)
    assert snapshot(obj) == keys


@pytest.mark.parametrize("step", [3.0, 40.0])
def test_stepped_looks_at_frames_that_are_not_seen(live_file, step):
    """Before the first frame of a scene, and after its last frame; also with steps longer than planned at first."""
    obj, dense = (key(new_object(name), seed=4) for name in ("Tool", "Dense"))
    live_file.scene.frame_start, live_file.scene.frame_end = 1, 40
    for fcurve in [*curves_of(obj).values(), *curves_of(dense).values()]:
        fcurve.extrapolation = "LINEAR"
    set_mode([obj, dense], "dq_sclerp")
    live_file.scene.frame_start, live_file.scene.frame_end = -100, 141
    bpy.context.view_layer.update()
    (long,) = shown_worlds([dense], np.arange(-90.0, 131.0))
    live_file.scene.frame_start, live_file.scene.frame_end = 1, 40
    bpy.context.view_layer.update()
    for offset in (0.0, 60.0):
        added = [fcurve.modifiers.new("STEPPED") for fcurve in curves_of(obj).values()]
        for modifier in added:
            modifier.frame_step, modifier.frame_offset = step, offset
        bpy.context.view_layer.update()
        held = offset + np.trunc((np.arange(1.0, 41.0) - offset) / step) * step
        (shown,) = shown_worlds([obj], np.arange(1.0, 41.0))
        assert np.abs(shown - long[(held + 90.0).astype(int)]).max() < 1e-5
        for fcurve, modifier in zip(curves_of(obj).values(), added, strict=True):
            fcurve.modifiers.remove(modifier)
