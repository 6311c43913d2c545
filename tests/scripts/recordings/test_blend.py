"""Tests of reading animated objects from .blend files made with bpy."""

from pathlib import Path

import numpy as np
import pytest

from rigid_motion_batch.recordings import read_trajectories
from tests.scripts.recordings.blends import added, fcurves, key

bpy = pytest.importorskip("bpy")


def test_the_animated_objects_are_told_and_still_ones_are_not(saved) -> None:
    for name in ("Lamp", "Ball", "Camera"):
        obj = added(name)
        if name != "Lamp":
            key(obj, 1, location=(0, 0, 0))
            key(obj, 9, location=(1, 0, 0))
    painted = added("Painted")
    key(painted, 1, color=(1, 0, 0, 1))
    path = saved()
    recording = read_trajectories(path)
    assert [trajectory.name for trajectory in recording.trajectories] == ["Ball"]
    assert recording.others == ("Camera",)
    assert [trajectory.name for trajectory in read_trajectories(path + ":*").trajectories] == ["Ball", "Camera"]
    (lamp,) = read_trajectories(path + ":Lamp").trajectories
    np.testing.assert_array_equal(lamp.poses.positions, np.zeros((30, 3)))


def test_scale_and_unit_are_told(saved, scene: bpy.types.Scene) -> None:
    scene.unit_settings.scale_length = 0.01
    obj = added("Balloon")
    key(obj, 1, scale=(1, 1, 1))
    key(obj, 5, scale=(3, 3, 3))
    (trajectory,) = read_trajectories(saved()).trajectories
    np.testing.assert_allclose(trajectory.poses.scales[[0, -1]], [1, 3], atol=1e-6)
    assert trajectory.metres_per_unit == pytest.approx(0.01)


def test_what_is_open_stays_as_it_is(saved) -> None:
    key(added("Ball"), 1, location=(0, 0, 0))
    path = saved()
    bpy.context.scene.frame_set(7)
    added("Ball")

    def state() -> tuple:
        names = sorted(repr(block) for block in bpy.data.user_map())
        return names, bpy.data.filepath, bpy.context.scene.name, bpy.context.scene.frame_current

    before = state()
    read_trajectories(path + ":*")
    assert state() == before


@pytest.mark.parametrize("allowed", [False, True])
def test_no_script_of_the_file_is_run(saved, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, allowed: bool) -> None:
    trace = tmp_path / "trace"
    driver = added("Driven").driver_add("location", 0).driver
    driver.expression = f"len(__import__('pathlib').Path({str(trace)!r}).write_text('run') * [0]) + 1"
    text = bpy.data.texts.new("startup.py")
    text.write(f"open({str(trace)!r}, 'w')")
    text.use_module = True
    path = saved()
    trace.unlink(missing_ok=True)
    preferences = bpy.context.preferences.filepaths
    monkeypatch.setattr(preferences, "use_scripts_auto_execute", allowed)
    read_trajectories(path + ":Driven")
    assert preferences.use_scripts_auto_execute == allowed
    assert not trace.exists()


def test_a_file_without_animation_is_answered_with_its_objects(saved, refusal) -> None:
    added("Lamp")
    _, message = refusal(saved())
    assert message.startswith("no moving body in this file; name one with ")
    assert message.endswith(":NAME: Lamp")


@pytest.mark.parametrize("frame", [1.9e35, -2e6, float("inf")])
def test_a_key_where_no_frame_is_costs_no_hours(saved, refusal, frame: float) -> None:
    drill = added("Drill")
    key(drill, 1, location=(0, 0, 0))
    key(drill, 9, location=(1, 0, 0))
    fcurves(drill)[0].keyframe_points[0 if frame < 0.0 else 1].co.x = frame
    _, message = refusal(saved())
    assert message.startswith("'Drill' moves from frame ")
    assert message.endswith("where Blender does not go; delete the keys that are far off")


def test_a_name_that_is_no_text_is_told(saved, refusal) -> None:
    drill = added("Drill")
    key(drill, 1, location=(0, 0, 0))
    key(drill, 9, location=(1, 0, 0))
    path = Path(saved())
    content = path.read_bytes()
    assert b"OBDrill\0" in content
    path.write_bytes(content.replace(b"OBDrill\0", b"OB\xff\xfell\xff\0"))
    assert refusal(str(path))[1] == "a name in this file is not text; save it again from Blender"
