"""Each kind of transform has all that goes with a kind, and data paths tell which kind they lead to."""

from __future__ import annotations

import bpy
import pytest

from rigid_motion.animation.transforms import KINDS, BoneTransform, kind_of, transform_of
from rigid_motion.animation.writers.table import WRITERS
from rigid_motion.ui.overlay.kinds import PATH_KINDS
from tests.animation.bones.rigs import new_rig


@pytest.mark.parametrize("table", [WRITERS, PATH_KINDS], ids=["writers", "paths"])
def test_every_kind_has_a_row_in_every_table(table):
    assert table.keys() == set(KINDS)


def test_what_blender_has_is_found_again_by_its_prefix(live_file):
    rig = new_rig()
    for carrier in (rig, *rig.pose.bones):
        transform = transform_of(carrier)
        assert transform.kind is kind_of(transform.prefix)
        assert transform.kind.in_object(rig, transform.prefix) == transform
    assert BoneTransform.in_object(rig, 'pose.bones["Nose"].') is None
    assert BoneTransform.in_object(bpy.data.objects.new("Empty", None), 'pose.bones["Upper"].') is None
