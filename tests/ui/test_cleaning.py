"""*Clean Motion* from the interface: on selected objects, with its report and its drawn result."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from rigid_motion.animation import bake_poses, key_frames
from rigid_motion.motion import Poses
from rigid_motion.ui.overlay import cleaned
from tests.animation.bones.rigs import select_only
from tests.animation.keyed import snapshot
from tests.animation.scenes import new_object
from tests.rigs.recorded import recorded_rig

pytestmark = pytest.mark.any_blender

operators = bpy.ops.rigid_motion
FRAMES = np.arange(1.0, 201.0)


def shaky(obj: bpy.types.Object, repeats: int = 0) -> bpy.types.Object:
    places = np.stack((np.sin(FRAMES / 20.0), np.cos(FRAMES / 31.0), FRAMES / 50.0), axis=1)
    places += 0.001 * np.random.default_rng(2).normal(size=places.shape)
    places[100] += 0.2
    for row in range(50, 50 + repeats):
        places[row] = places[49]
    bake_poses(obj, FRAMES, Poses(places, np.tile((1.0, 0.0, 0.0, 0.0), (len(FRAMES), 1))))
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
    assert len(key_frames(obj)) == len(FRAMES)
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
