"""Each kind of transform has all that goes with a kind, and data paths tell which kind they lead to."""

from __future__ import annotations

import bpy

from rigid_motion.animation.transforms import transform_in, transform_of
from rigid_motion.animation.writers.table import WRITERS
from rigid_motion.ui.overlay.kinds import PATH_KINDS
from tests.animation.bones.rigs import new_rig


def test_every_kind_that_is_written_has_a_path():
    assert PATH_KINDS.keys() == WRITERS.keys()


def test_what_blender_has_is_found_again_by_its_prefix(live_file):
    rig = new_rig()
    for carrier in (rig, *rig.pose.bones):
        transform = transform_of(carrier)
        assert transform_in(rig, transform.prefix) == transform
    assert transform_in(rig, 'pose.bones["Nose"].') is None
    assert transform_in(bpy.data.objects.new("Empty", None), 'pose.bones["Upper"].') is None
