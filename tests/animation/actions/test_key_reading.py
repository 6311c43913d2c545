"""Keys read from Blender's F-curves: what is read together, and what is left out."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.animation.actions.channels import read_keys
from rigid_motion.animation.curves.keys import Cycles
from tests.animation.curves.examples import as_fcurve, keys_of, read_one


def test_channels_are_read_together_that_are_keyed_together():
    same, later = keys_of((1, 5, 9), (2, 3, 4), "BEZIER"), keys_of((1, 6, 9), (2, 3, 4), "BEZIER")
    endless = keys_of((1, 5, 9), (2, 3, 4), "BEZIER", linear=True)
    with as_fcurve(same) as a, as_fcurve(later) as b, as_fcurve(same) as c, as_fcurve(endless) as d:
        (read,) = read_keys([[a, b, c, d]])
        assert [places for places, _ in read] == [[0, 2], [1], [3]]
        assert [keys.points.shape for _, keys in read] == [(2, 3, 2), (1, 3, 2), (1, 3, 2)]


def test_only_what_bears_on_the_values_is_read():
    names = ("left", "easing")
    read = {}
    for name, linear in (("LINEAR", True), ("BEZIER", False), ("BACK", False), ("BACK", True)):
        with as_fcurve(keys_of((1, 5), (2, 3), name, linear=linear)) as fcurve:
            keys = read_one(fcurve)
            read[name, linear] = [getattr(keys, name) is not None for name in names]
            assert keys.times.tolist() == [1.0, 5.0]
            assert keys.values.tolist() == [[2.0, 3.0]]
    assert list(read.values()) == [[False, False], [True, False], [False, True], [True, True]]


def test_a_muted_cycles_modifier_is_left_out():
    with as_fcurve(keys_of((1, 5), (2, 3), cycles=Cycles("REPEAT", "MIRROR", 0, 2))) as fcurve:
        assert read_one(fcurve).cycles == Cycles("REPEAT", "MIRROR", 0, 2)
        fcurve.modifiers[0].mute = True
        assert read_one(fcurve).cycles is None


def test_the_keys_of_many_owners_are_those_that_each_has_alone():
    keys = [
        keys_of((1, 5, 9), (value, 3, 4), kind) for value, kind in enumerate(("BEZIER", "LINEAR", "BACK", "BEZIER"))
    ]
    with as_fcurve(keys[0]) as a, as_fcurve(keys[1]) as b, as_fcurve(keys[2]) as c, as_fcurve(keys[3]) as d:
        together = read_keys([[a, b], [], [c], [d]])
        alone = [read_keys([owner])[0] for owner in ([a, b], [], [c], [d])]
    assert [[(places, keys.raw) for places, keys in owner] for owner in together] == [
        [(places, keys.raw) for places, keys in owner] for owner in alone
    ]
    assert [[places for places, _ in owner] for owner in together] == [[[0, 1]], [], [[0]], [[0]]]


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_keys_with_numbers_that_are_not_finite_are_not_sound(value):
    with as_fcurve(keys_of((1, 5), (2, 3))) as fcurve, as_fcurve(keys_of((1, 5), (2, value)), update=False) as broken:
        assert [keys.is_sound for keys in (read_one(fcurve), read_one(broken))] == [True, False]


def test_keys_out_of_order_are_not_sound():
    with as_fcurve(keys_of((1, 9, 5), (2, 3, 4)), update=False) as fcurve:
        assert not read_one(fcurve).is_sound
