"""Files of every released format open and move as they did. They were saved by the version that is named, on frame 15.

`files/format-N.blend`, and where its objects were in `format-N.npz`: 1 is 0.1.0 before modes lived in Actions.
"""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion.animation import MODE_IDS, is_baked, modes_of, problem_of, refresh, unbake
from rigid_motion.motion import MODES
from tests.animation.oracle import expected_worlds, shown_worlds
from tests.animation.scenes import key

FILES = Path(__file__).parent / "files"

FORMATS = sorted(FILES.glob("format-*.blend"))


@pytest.fixture(params=FORMATS, ids=[path.stem for path in FORMATS])
def opened(request, live_file, tmp_path) -> np.lib.npyio.NpzFile:
    """What there was to be seen of a file that is open now."""
    path = tmp_path / "old.blend"
    path.write_bytes(request.param.read_bytes())
    bpy.ops.wm.open_mainfile(filepath=str(path))
    with np.load(request.param.with_suffix(".npz")) as known:
        yield known


EASED = "Keyed"
"""What moves otherwise by now: it has Smooth Screw between keys with handles, which have a say there since."""


def assert_moves_as_it_did(known: np.lib.npyio.NpzFile) -> None:
    objects = [bpy.data.objects[name] for name in known["names"]]
    for obj, shown, expected in zip(objects, shown_worlds(objects, known["frames"]), known["worlds"], strict=True):
        if obj.name == EASED:
            expected = expected_worlds(obj, known["frames"])[:, :3]
        assert np.abs(shown[:, :3] - expected).max() < 2e-5 * max(1.0, np.abs(expected).max()), obj.name


def test_a_file_moves_as_it_did(opened):
    assert_moves_as_it_did(opened)
    assert [problem_of(obj) for obj in bpy.data.objects] == [""] * len(bpy.data.objects)
    assert refresh() == 0, "everything is up to date once the file is open"


def test_a_file_moves_as_it_did_after_it_was_saved_by_this_version(opened, tmp_path):
    path = str(tmp_path / "new.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert_moves_as_it_did(opened)


def test_objects_have_the_modes_they_had(opened):
    frames = np.array((1.0, 11.0, 24.0))
    modes = {name: modes_of(bpy.data.objects[name], frames) for name in ("Whole", "Keyed", "Own", "Twin A", "Twin B")}
    assert modes == {
        "Whole": ["dq_sclerp"] * 3,
        "Keyed": ["BLENDER", "pga_lerp", "motor_spline"],
        "Own": ["cga_slerp"] * 3,
        "Twin A": ["dq_sclerp"] * 3,
        "Twin B": ["dq_sclerp"] * 3,
    }
    waiting = key(bpy.data.objects["Waiting"])
    bpy.context.view_layer.update()
    assert modes_of(waiting, frames) == ["cga_lerp"] * 3


def test_what_was_baked_can_be_un_baked(opened):
    obj = bpy.data.objects["Baked"]
    assert is_baked(obj)
    unbake(obj)
    assert modes_of(obj, np.array((1.0, 11.0))) == ["lerp_slerp"] * 2
    expected = opened["worlds"][list(opened["names"]).index("Baked")]
    shown = shown_worlds([obj], opened["frames"])[0][:, :3]
    # It was baked on every second frame.
    assert np.abs(shown - expected)[::2].max() < 2e-5 * np.abs(expected).max()


def test_the_numbers_of_modes_in_files_stay_what_they_are(live_file):
    items = bpy.data.objects.new("Any", None).rigid_motion.bl_rna.properties["mode"].enum_items
    numbers = {item.identifier: item.value for item in items}
    assert numbers == {"BLENDER": 0, **{mode: MODES[mode].number for mode in MODE_IDS[1:]}}
