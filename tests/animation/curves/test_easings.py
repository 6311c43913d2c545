"""Easings by what is known of them without Blender; `test_evaluation.py` compares them with Blender's own."""

from __future__ import annotations

import numpy as np

from rigid_motion.animation.curves.easings import ease, elastic


def test_each_moment_may_have_its_own_settings():
    changes, amplitudes, backs = np.array([1.0, -2.0, 0.0]), np.array([0.5, 3.0, 0.0]), np.array([0.0, 1.7, -1.0])
    u = np.array([0.2, 0.6, 0.9])
    own = [elastic("AUTO", u[[i]], *row, 0.0)[0] for i, row in enumerate(zip(changes, amplitudes, strict=True))]
    np.testing.assert_array_equal(elastic("AUTO", u, changes, amplitudes, 0.0), own)
    own = [ease("BACK", "AUTO", u[[i]], back)[0] for i, back in enumerate(backs)]
    np.testing.assert_array_equal(ease("BACK", "AUTO", u, backs), own)
