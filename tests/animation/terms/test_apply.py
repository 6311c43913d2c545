"""Applied terms: the F-curve modifiers are exactly the planned terms."""

from __future__ import annotations

import re

import bpy
import numpy as np

from rigid_motion.animation import set_mode
from tests.animation.keyed import curves_of
from tests.animation.oracle import shown_worlds
from tests.animation.scenes import key, new_object

BY_HAND = {"mute": True, "use_influence": True, "blend_in": 5.0, "blend_out": 5.0, "name": "Mine"}
"""Settings changed in terms, one after the other."""

MOVED = ((1.0, 17.0), (1e-3, 17.0), (30.0, 17.0), (3000.0, 17.0), (1.0, 14.0))
"""The value and the frame of a key, one after the other."""


def test_what_is_changed_in_terms_by_hand_is_undone_by_the_next_edit_and_names_tell_mode_and_frames(live_file):
    obj = key(new_object("Tool"))
    set_mode(obj, "dq_sclerp")
    curve, frames, counts = curves_of(obj)["location", 0], np.arange(1.0, 40.0, 0.25), set()
    point, before = curve.keyframe_points[1], shown_worlds([obj], frames)
    at = tuple(point.co)
    for name, value in BY_HAND.items():
        for modifier in curve.modifiers:
            setattr(modifier, name, value)
        for position in (*((frame, value) for value, frame in MOVED), at):
            point.co = position
            bpy.context.view_layer.update()
            for fcurve in curves_of(obj).values():
                counts.add(len(fcurve.modifiers))
                for modifier in fcurve.modifiers:
                    ends = f"{modifier.frame_start:.6g} to {modifier.frame_end:.6g}"
                    assert re.fullmatch(rf"Screw {re.escape(ends)}( \(\d+\))?", modifier.name)
        np.testing.assert_allclose(shown_worlds([obj], frames), before, atol=1e-6)
    assert len(counts) > 2
