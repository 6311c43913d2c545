"""The scenes of the benchmark of live in-betweens are what it says, and its figures what the page reads."""

import numpy as np
import pytest

from research import benchmark_live
from research.benchmark_live import MODE, NativeBaking, Size, scene_of, set_modes
from rigid_motion import animation
from rigid_motion.animation import channelbag_of, read_poses
from tests.scripts.research.keeping import written

SMALL = Size(3, 5, 40)
FRAMES = np.arange(1, SMALL.frames + 1)


@pytest.fixture
def live_file(empty_file):
    animation.register()
    yield
    animation.set_enabled(True)
    animation.unregister()


@pytest.mark.usefixtures("live_file")
def test_native_baking_keys_what_is_shown_and_gives_it_back():
    objects = scene_of(SMALL, "QUATERNION")
    set_modes(objects, MODE)
    actions = [obj.animation_data.action for obj in objects]
    shown = read_poses(objects[1], FRAMES)
    native = NativeBaking(objects)
    animation.set_enabled(False)
    native.bake()
    assert len(channelbag_of(objects[1]).fcurves.find("location", index=2).keyframe_points) == SMALL.frames
    objects[1].delta_location, objects[1].delta_rotation_quaternion = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    np.testing.assert_allclose(read_poses(objects[1], FRAMES).positions, shown.positions, atol=1e-5)
    native.restore()
    assert [obj.animation_data.action for obj in objects] == actions
    np.testing.assert_allclose(read_poses(objects[1], FRAMES).positions, shown.positions, atol=1e-6)


def test_the_study_writes_what_the_page_reads(tmp_path, empty_file):
    assert benchmark_live.main(["--rounds", "1", "--scale", "0.01", "--root", str(tmp_path)]) == 0
    result = written(tmp_path, "benchmark_live")
    assert [shot["rotation"] for shot in result["shots"]] == ["QUATERNION", "XYZ"]
    assert len(result["rigs"]) == 6
    assert all(row["ms"] >= row["fastest_ms"] > 0.0 for row in result["rigs"])
