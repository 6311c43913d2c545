"""*Clean Motion*, *Reduce into Holds* and *Bake to World* from the interface, on selected objects with dense keys."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake_poses, hold_facts, is_baked, is_reduced, key_frames, reduction_of
from rigid_motion.motion import Poses
from rigid_motion.ui.overlay import cleaned
from rigid_motion.ui.reducing import props_and_holders
from rigid_motion.ui.wording import hold_lines
from tests.animation.bones.rigs import pose_mode, select_only
from tests.animation.held import worlds
from tests.animation.keyed import snapshot
from tests.animation.scenes import new_object
from tests.rigs.recorded import FRAMES, recorded_rig

pytestmark = pytest.mark.any_blender

operators = bpy.ops.rigid_motion
SHAKY_FRAMES = np.arange(1.0, 201.0)


def shaky(obj: bpy.types.Object, repeats: int = 0) -> bpy.types.Object:
    places = np.stack((np.sin(SHAKY_FRAMES / 20.0), np.cos(SHAKY_FRAMES / 31.0), SHAKY_FRAMES / 50.0), axis=1)
    places += 0.001 * np.random.default_rng(2).normal(size=places.shape)
    places[100] += 0.2
    for row in range(50, 50 + repeats):
        places[row] = places[49]
    bake_poses(obj, SHAKY_FRAMES, Poses(places, np.tile((1.0, 0.0, 0.0, 0.0), (len(SHAKY_FRAMES), 1))))
    select_only(obj)
    return obj


@pytest.fixture
def report_of(extension, capfd):
    """Return a function that runs the operator and returns its report."""

    def act(**settings: object) -> str:
        capfd.readouterr()
        assert operators.clean_motion(**settings) == {"FINISHED"}
        return capfd.readouterr().out.strip()

    return act


def test_it_says_how_much_jittered_and_by_how_much_it_was_moved(report_of):
    obj = shaky(new_object())
    before = snapshot(obj)
    assert operators.clean_motion.poll()
    text = report_of(radius=0.1)
    assert text.startswith("Info: Tool: jitters by 1.79 mm; moved at most ")
    assert text.endswith("; 1 key was a spike")
    assert len(key_frames(obj)) == len(SHAKY_FRAMES)
    assert [bridged.sum() for *_, bridged in cleaned._cleanings] == [1]
    assert operators.restore_keys() == {"FINISHED"}
    assert {name: [key[:2] for key in keys[-1]] for name, keys in snapshot(obj).items()} == {
        name: [key[:2] for key in keys[-1]] for name, keys in before.items()
    }


def test_a_camera_is_spoken_of_in_pixels_and_several_things_in_lengths(report_of):
    camera = shaky(new_object("Camera", data=bpy.data.cameras.new("Camera")), repeats=3)
    text = report_of(nearest=5.0)
    assert "jitters by 1.2 pixels; moved at most " in text
    assert text.endswith("1 key was a spike; repeated keys: 3")
    operators.restore_keys()
    shaky(new_object()).select_set(True)
    camera.select_set(True)
    assert "pixels" not in report_of()


def test_of_a_rig_in_object_mode_all_keyed_bones_are_cleaned(report_of):
    rig = recorded_rig()
    select_only(rig)
    text = report_of()
    assert text.startswith("Info: 7 bones: jitters by ")
    assert text.endswith("; no foot clearly stands: none is held")
    ((before, after, _),) = cleaned._cleanings
    assert before.shape == after.shape == (3, 90, 3), "the head and the hands, on which nothing hangs"


@pytest.fixture
def scene_of_both(extension) -> tuple[bpy.types.Object, bpy.types.Object]:
    """A tool, which is in a hand from frame 20 on, and the rig of the hand."""
    body, tool = recorded_rig(), new_object("Tool")
    bpy.context.scene.frame_start, bpy.context.scene.frame_end = 1, 90
    places = worlds(body.pose.bones["Hand.R"], np.clip(FRAMES, 20, 90))
    poses = Poses.from_matrices(places)
    bake_poses(tool, FRAMES, Poses(poses.positions, poses.quaternions))
    select_only(tool)
    return tool, body


def held_in(prop: bpy.types.Object, frame: int) -> str:
    bpy.context.scene.frame_set(frame)
    now = hold_facts(prop).now
    return "" if now is None else now.name


def test_what_is_selected_alone_is_looked_for_in_all_rigs_and_it_says_what_was_found(scene_of_both, capfd):
    tool, _ = scene_of_both
    assert operators.reduce_into_holds.poll()
    assert operators.reduce_into_holds(radius=0.1) == {"FINISHED"}
    assert "Tool: Hand.R from 21 to 90: 70 keys became 1" in capfd.readouterr().out
    assert hold_lines(reduction_of(tool)) == ["Hand.R from 21 to 90: 70 keys became 1"]
    assert [held_in(tool, frame) for frame in (20, 21, 90)] == ["", "Hand.R", "Hand.R"]
    assert key_frames(tool).tolist() == list(range(1, 22))
    assert operators.restore_keys() == {"FINISHED"}
    assert not is_reduced(tool)
    assert len(key_frames(tool)) == 90


def test_what_is_selected_beside_it_may_hold_it(scene_of_both, capfd):
    tool, body = scene_of_both
    cart = new_object("Cart")
    for chosen, props, holders in (
        ((tool,), ["Tool"], None),
        ((body, tool), ["Tool"], [body]),
        ((tool, body), ["Tool"], [body]),
        ((cart, tool), ["Tool"], [cart]),
    ):
        select_only(*chosen)
        found = props_and_holders(bpy.context)
        assert ([one.name for one in found[0]], found[1]) == (props, holders)
    with pytest.raises(RuntimeError, match="Tool is at rest in none of 1 bones and objects for 5 frames"):
        operators.reduce_into_holds(radius=0.1)
    pose_mode(body, "Hand.L", "Hand.R")
    found = props_and_holders(bpy.context)
    assert ([one.name for one in found[0]], found[1]) == (["Body/Hand.R"], [body.pose.bones["Hand.L"]])


def test_it_is_baked_to_the_world_by_a_tick(scene_of_both):
    tool, body = scene_of_both
    select_only(body, tool)
    before = worlds(tool)
    operators.reduce_into_holds(radius=0.1)
    select_only(tool)
    assert operators.bake.poll()
    assert operators.bake() == {"FINISHED"}
    assert held_in(tool, 40) == "Hand.R"
    assert operators.unbake() == {"FINISHED"}
    assert operators.bake(to_world=True) == {"FINISHED"}
    assert held_in(tool, 40) == ""
    assert is_baked(tool)
    assert np.abs(worlds(tool) - before).max() < 1e-4
