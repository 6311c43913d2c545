"""Keys that commands copy from in-betweens or between transforms: poses that are seen, and modes along with them."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import modes_of, set_mode
from tests.animation.bones.rigs import select_bones, select_only
from tests.animation.commands.stage import IN_BETWEEN, KEYS, KINDS, Stage, channels_seen, go_to, in_view, set_stage
from tests.animation.keyed import curves_of
from tests.animation.scenes import editor

QUARTERS = np.arange(KEYS[0], KEYS[-1] + 0.25, 0.25)


def played(stage: Stage, number: int, frames: np.ndarray) -> np.ndarray:
    """What the channels of one of them have on these frames, shape (m, 10)."""
    result = []
    for frame in frames:
        bpy.context.scene.frame_set(int(frame), subframe=frame % 1.0)
        result.append(channels_seen([stage.carriers[number]]))
    return np.array(result)


def select(stage: Stage, number: int) -> None:
    if stage.kind == "OBJECT":
        select_only(stage.carriers[number])
    else:
        select_bones(stage.owner, stage.carriers[number].name)


@pytest.mark.parametrize("kind", KINDS[3:], ids="-".join)
def test_a_propagated_pose_is_the_one_that_is_seen(live_file, kind):
    stage = set_stage(*kind, "dq_sclerp")
    before = channels_seen(stage.carriers)
    with in_view():
        bpy.ops.pose.propagate(mode="NEXT_KEY")
    go_to(int(KEYS[1]))
    np.testing.assert_allclose(channels_seen(stage.carriers), before, atol=1e-5)


@pytest.mark.parametrize("later", [0, 60])
@pytest.mark.parametrize("how", ["DOPESHEET_EDITOR", "GRAPH_EDITOR"])
@pytest.mark.parametrize("modes", [("pga_lerp", "pga_lerp"), ("dq_sclerp", "BLENDER")], ids="-".join)
@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_copied_keys_move_what_they_are_pasted_on_as_they_moved_the_first(live_file, kind, modes, how, later):
    stage = set_stage(*kind, "BLENDER")
    first, other = stage.carriers
    for mode, frame in zip(modes, KEYS, strict=False):
        set_mode(first, mode, [frame])
    expected = played(stage, 0, QUARTERS)
    space = bpy.ops.action if how == "DOPESHEET_EDITOR" else bpy.ops.graph
    with editor(how, "DOPESHEET" if how == "DOPESHEET_EDITOR" else "FCURVES") as shown:
        shown.dopesheet.show_only_selected = True
        select(stage, 0)
        space.select_all(action="SELECT")
        space.copy()
        select(stage, 1)
        go_to(int(KEYS[0]) + later)
        bpy.ops.anim.channels_select_all(action="SELECT")
        space.paste(offset="START", merge="OVER_ALL" if not later else "MIX")
    np.testing.assert_allclose(played(stage, 1, QUARTERS + later), expected, atol=1e-5)
    assert modes_of(other, np.array(KEYS[:2]) + later) == list(modes)
    assert any(len(fcurve.modifiers) for fcurve in curves_of(other).values())


@pytest.mark.parametrize("kind", KINDS, ids="-".join)
def test_the_location_that_is_read_is_the_one_that_is_seen(live_file, kind):
    stage = set_stage(*kind, "pga_slerp")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    evaluated = stage.owner.evaluated_get(depsgraph)
    of_bone = evaluated if stage.kind == "OBJECT" else evaluated.pose.bones[stage.first.name]
    matrix = evaluated.matrix_local if stage.kind == "OBJECT" else of_bone.matrix_basis
    np.testing.assert_allclose(stage.first.matrix_basis, matrix, atol=1e-6)
    curve = curves_of(stage.first)["location", 0]
    assert curve.evaluate(IN_BETWEEN) == pytest.approx(stage.first.location.x, abs=1e-6)
    straight = np.interp(IN_BETWEEN, KEYS, [point.co.y for point in curve.keyframe_points])
    assert abs(straight - stage.first.location.x) > 1e-3, "and not Blender's own"
