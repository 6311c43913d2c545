"""Tests of bake.py as users run it: its results, the files that it leaves alone, its messages and exit codes."""

import contextlib
import json
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

from rigid_motion import animation
from rigid_motion.animation import is_baked, set_mode
from rigid_motion.animation.actions.marks import MAX_MARK, write_marks
from rigid_motion_batch.keying import jobs
from tests.animation.farm import played_on_a_farm
from tests.animation.keyed import curves_of, snapshot
from tests.animation.oracle import expected_worlds, shown_worlds
from tests.animation.scenes import FRAMES, give_own_deltas, key, new_object
from tests.scripts.baking import (
    LAST,
    baked_name,
    extension,
    frames_of_keys,
    new_file,
    one_object_file,
    open_again,
    run,
    save,
    with_version,
)
from tests.scripts.processes import ROOT, run_python
from tests.scripts.recordings.blends import rig
from tests.scripts.reducing import listed

PLAYED = np.arange(0.0, LAST + 1.0)
"""All frames of the scenes: from before the first key until after the last NLA strip."""

BAKED = ("Arm", "Axis", "Camera", "Noisy", "Own", "Rig", "Stale", "Strips", "Tool", "Wheel")
BAKED_BONES = ["Root", "Upper", "Hand", "Index"]
REFUSED = {
    "Bent": "Location X has an Envelope",
    "Claw/Bent": "Location X has an Envelope",
    "Claw/Driven": "Location X is driven",
    "Crane": "Location X is driven: remove the driver",
    "Future": "its keys have a mode that is unknown to this version",
    "Huge": "key 2 of Location X has an invalid frame, value, handle or easing",
    "Prop": "it is linked from //library.blend: use --in-place on that file, or make it local",
}
"""Objects and bones of the shot that cannot be baked, with the reasons."""


def fill_shot() -> None:
    """Add objects of every kind that can be baked, and some that cannot."""
    set_mode(key(new_object("Axis", "AXIS_ANGLE"), seed=8), "dq_sclerp")
    noisy = key(new_object("Noisy"), seed=7)
    set_mode(noisy, "dq_sclerp")
    noise = curves_of(noisy)["location", 0].modifiers.new("NOISE")
    noise.use_restricted_range, noise.frame_start, noise.frame_end = True, 5.0, 35.0
    arm = key(new_object("Arm", "XYZ"), (1.0, 30.0), seed=9)
    set_mode(arm, "dq_sclerp")
    tool = key(new_object("Tool"), seed=1)
    tool.parent, tool.matrix_parent_inverse = arm, np.eye(4) + 0.1 * np.eye(4, k=3)
    set_mode(tool, "motor_spline")
    set_mode(tool, "lerp_slerp", FRAMES[1:2])
    set_mode(tool, "BLENDER", FRAMES[2:3])
    bpy.context.scene.camera = key(new_object("Camera", "XYZ", bpy.data.cameras.new("Lens")), seed=2)
    set_mode(bpy.context.scene.camera, "dq_sclerp")
    wheel = key(new_object("Wheel"), (1.0, 13.0), seed=3)
    for fcurve in curves_of(wheel).values():
        fcurve.modifiers.new("CYCLES")
    set_mode(wheel, "dq_sclerp")
    strips = key(new_object("Strips"), seed=4)
    strips.animation_data.nla_tracks.new().strips.new("Strip", 60, strips.animation_data.action)
    strips.animation_data.action = None
    key(strips, seed=5)
    set_mode(strips, "cga_slerp")
    own = new_object("Own")
    give_own_deltas(own)
    set_mode(key(own, scale="even"), "pga_lerp")
    new_object("Still")
    key(new_object("Plain"), seed=6)
    fill_rig()
    claw = rig("Claw", dict.fromkeys(("Good", "Bent", "Driven"), ((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), None)))
    refused = {name: key(new_object(name), seed=7) for name in REFUSED if name in ("Bent", "Crane", "Future", "Huge")}
    for carrier in (*refused.values(), *map(key, claw.pose.bones)):
        set_mode(carrier, "dq_sclerp", FRAMES[:2])
    for bent in (refused["Bent"], claw.pose.bones["Bent"]):
        curves_of(bent)["location", 0].modifiers.new("ENVELOPE")
    for driven, turn in ((refused["Crane"], "rotation_quaternion"), (claw.pose.bones["Driven"], "rotation_euler")):
        for path in ("location", turn, "scale"):
            for item in driven.driver_add(path):
                item.driver.expression = "frame"
    for curve in curves_of(refused["Future"]).values():
        write_marks(curve, np.array([MAX_MARK, 0, 0, 0]))
    curves_of(refused["Huge"])["location", 0].keyframe_points[1].co_ui.y = 3e38
    set_mode(key(new_object("Stale"), seed=10), "dq_sclerp")
    # From here on nothing follows what is edited.
    animation.set_enabled(False)
    for point in curves_of(bpy.data.objects["Stale"])["location", 0].keyframe_points:
        point.co_ui.y *= -2.0


def fill_rig() -> None:
    """Add a rig, of which one finger has no mode and one bone a different mode in one segment, and an empty on it."""
    parents = {"Root": None, "Upper": "Root", "Hand": "Upper", "Thumb": "Hand", "Index": "Hand"}
    places = [((0.0, 0.1 * number, number), (0.0, 0.1 * number, number + 1.0)) for number in range(len(parents))]
    own = rig("Rig", {name: (*place, parents[name]) for name, place in zip(parents, places, strict=True)})
    for bone in own.pose.bones:
        bone.rotation_mode = "XYZ" if bone.name == "Upper" else "QUATERNION"
        key(bone)
    set_mode([key(own, (5.0, 30.0)), *(own.pose.bones[name] for name in BAKED_BONES)], "dq_sclerp")
    set_mode(own.pose.bones["Upper"], "motor_spline", FRAMES[1:2])
    tip = new_object("Tip")
    tip.parent, tip.parent_type, tip.parent_bone = own, "BONE", "Index"


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with the objects of BAKED and REFUSED, the last of them linked, saved on frame 17."""
    folder = tmp_path_factory.mktemp("shot")
    with extension(), contextlib.ExitStack() as at_last:
        at_last.callback(animation.set_enabled, True)
        new_file()
        set_mode(key(new_object("Prop")), "dq_sclerp")
        library = save(folder / "library.blend")
        new_file()
        fill_shot()
        shot = save(folder / "shot.blend")
        with bpy.data.libraries.load(str(library), link=True, relative=True) as (there, here):
            here.objects = there.objects
        bpy.context.scene.collection.objects.link(here.objects[0])
        bpy.context.scene.frame_set(17)
        bpy.ops.wm.save_mainfile()
        (folder / "shot.blend1").unlink(missing_ok=True)
    return shot


@pytest.fixture(scope="module")
def baked(shot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shot, baked into another folder."""
    folder = tmp_path_factory.mktemp("baked")
    assert run(shot, "--output", folder) == 1
    return folder / "shot-baked.blend"


def assert_same(worlds: np.ndarray, expected: list[np.ndarray]) -> None:
    for one, other in zip(worlds, expected, strict=True):
        assert np.abs(one - other).max() <= 1e-5 * max(1.0, np.abs(other).max())


def live_worlds(path: Path, names: tuple[str, ...]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the world matrices that a live file shows with the extension, as opened and on all frames."""
    with extension():
        open_again(path)
        graph = bpy.context.evaluated_depsgraph_get()
        objects = [bpy.data.objects[name] for name in names]
        return [np.array(obj.evaluated_get(graph).matrix_world) for obj in objects], shown_worlds(objects, PLAYED)


def test_a_baked_file_plays_in_any_blender_as_the_live_one_does_with_the_extension(shot, baked):
    # "Huge" has no valid place, with or without the extension. "Prop" is found from another folder.
    names = (*BAKED, "Tip", "Bent", "Crane", "Future", "Prop", "Still", "Plain")
    opened, shown = live_worlds(shot, names)
    opened_there, shown_there, *_ = played_on_a_farm(baked, names, PLAYED)
    assert_same(opened_there, opened)
    assert_same(shown_there, shown)
    expected = expected_worlds(bpy.data.objects["Stale"], PLAYED[:43])
    assert_same(shown_there[names.index("Stale"), None, :43], [expected])


def test_un_baking_gives_back_exactly_the_keys_and_the_motion(shot, baked, tmp_path):
    assert run(baked, "--unbake", "--output", tmp_path) == 0
    names = (*(name for name in BAKED if name != "Stale"), "Tip", "Still", "Plain")
    result = []
    for path in (shot, tmp_path / "shot-baked-unbaked.blend"):
        with extension():
            open_again(path)
            objects = [bpy.data.objects[name] for name in names]
            modes = [obj.rigid_motion.mode for obj in objects]
            result.append(([snapshot(obj) for obj in objects], modes, shown_worlds(objects, PLAYED)))
    assert result[0][:2] == result[1][:2]
    assert_same(result[1][2], result[0][2])


@pytest.mark.any_blender
@pytest.mark.parametrize(
    ("options", "frames", "interpolation"),
    [
        (("--step", "0.5"), sorted({*np.arange(1.0, 40.5, 0.5)}), "LINEAR"),
        (("--step", "7", "--hold"), sorted({*np.arange(1.0, 40.5, 7.0), *FRAMES}), "CONSTANT"),
    ],
)
def test_steps_that_may_be_held(tmp_path, options, frames, interpolation):
    path = one_object_file(tmp_path / "shot.blend")
    assert run(path, *options) == 0
    open_again(baked_name(path))
    curves = curves_of(bpy.data.objects["Tool"])
    assert frames_of_keys(bpy.data.objects["Tool"]) == frames
    assert {key.interpolation for curve in curves.values() for key in curve.keyframe_points[:-1]} == {interpolation}


@pytest.mark.any_blender
def test_a_name_that_nothing_has_is_said(shot, tmp_path, capsys):
    assert run(shot, "--output", tmp_path, "--objects", "Camera,Camra") == 1
    assert "--objects Camra: no object or bone of that name" in capsys.readouterr().err
    (tmp_path / "shot-baked.blend").write_bytes(b"mine")
    assert run(shot, "--output", tmp_path, "--objects", "Camra") == 1
    assert "Camra" not in capsys.readouterr().err, "a file that was not looked into may have it"


def test_what_cannot_be_baked_is_named_with_the_way_out_and_the_others_go_on(shot, tmp_path, capsys):
    assert run(shot, "--output", tmp_path) == 1
    said = capsys.readouterr()
    lines = said.err.splitlines()
    for name, reason in REFUSED.items():
        (line,) = (line for line in lines if line.startswith(f"{shot}: {name}: not baked: "))
        assert reason in line
    assert f"{shot}: Tool: baked, frames 1 to 40, Smooth Screw, Straight, Blender" in lines
    assert f"{shot}: Rig: {len(BAKED_BONES)} bones baked, " in said.err
    assert lines[-1] == f"{len(BAKED)} objects and {len(BAKED_BONES) + 1} bones baked, {len(REFUSED)} not."
    assert said.out == f"{tmp_path / 'shot-baked.blend'}\n"
    assert not any("Plain" in line or "Still" in line for line in lines)


@pytest.mark.any_blender
@pytest.mark.parametrize(
    ("asked", "bones", "itself"),
    [("Rig", BAKED_BONES, True), ("Rig/*", BAKED_BONES, False), ("*/Root,Rig/?pper", ["Root", "Upper"], False)],
)
def test_bones_can_be_chosen_by_rig_and_by_names_and_patterns(shot, tmp_path, asked, bones, itself):
    assert run(shot, "--objects", asked, "--output", tmp_path) == 0
    with extension():
        open_again(tmp_path / "shot-baked.blend")
        own = bpy.data.objects["Rig"]
        assert [bone.name for bone in own.pose.bones if is_baked(bone)] == bones
        assert is_baked(own) == itself


@pytest.mark.any_blender
def test_a_file_without_modes_is_left_alone(tmp_path, capsys):
    new_file()
    key(new_object("Plain"))
    path = save(tmp_path / "plain.blend")
    assert run(path) == run(path, "--unbake") == 0
    assert "nothing to be baked; left alone" in capsys.readouterr().err
    assert listed(tmp_path) == ["plain.blend"]


def test_a_file_of_an_older_blender_is_said_to_be_of_this_one_afterwards(tmp_path, capsys, monkeypatch):
    path = one_object_file(tmp_path / "shot.blend", compress=False)
    with_version(path, "405", "0405")
    monkeypatch.setattr(jobs, "THIS_VERSION", (9, 0))
    assert run(path) == 0
    assert "was saved by Blender 4.5; what is written is of Blender 9.0" in capsys.readouterr().err


@pytest.mark.any_blender
def test_an_error_that_nobody_foresaw_is_told_and_the_others_go_on(tmp_path, capsys, monkeypatch):
    paths = [one_object_file(tmp_path / f"{name}.blend") for name in ("a", "b")]
    real = animation.bake

    def fail_in_a(obj: bpy.types.Object, **options: object) -> tuple[float, float]:
        if bpy.data.filepath == str(paths[0]):
            raise ZeroDivisionError("nobody knows why")
        return real(obj, **options)

    monkeypatch.setattr(animation, "bake", fail_in_a)
    assert run(*paths) == 1
    said = capsys.readouterr().err
    assert f"{paths[0]}: not written, for this program failed (ZeroDivisionError: nobody knows why)" in said
    assert "Traceback" in said
    assert listed(tmp_path) == ["a.blend", "b-baked.blend", "b.blend"]


# Files that are left alone, and files that are kept


def test_no_python_of_a_file_is_run_and_all_of_it_stays(tmp_path):
    trace = tmp_path / "trace"

    def edit(obj: bpy.types.Object) -> None:
        script = bpy.data.texts.new("run.py")
        script.write(f"open({str(trace)!r}, 'w').close()")
        script.use_module = True
        obj.driver_add("hide_render").driver.expression = "__import__('os').getpid() > 0"

    path = one_object_file(tmp_path / "shot.blend", edit)
    preferences = bpy.context.preferences.filepaths
    allowed = preferences.use_scripts_auto_execute
    preferences.use_scripts_auto_execute = True
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=True)
        assert trace.exists(), "this script does run where it may, or this test says nothing"
        trace.unlink()
        assert run(path) == 0
    finally:
        preferences.use_scripts_auto_execute = allowed
    assert not trace.exists()
    bpy.ops.wm.open_mainfile(filepath=str(baked_name(path)), use_scripts=False)
    assert bpy.data.texts["run.py"].use_module
    assert len(bpy.data.objects["Tool"].animation_data.drivers) == 1


BESIDE_AN_INSTALLED_EXTENSION = """
import json, runpy, sys
import bpy
script, package, path = sys.argv[1:]
bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)


def state():
    return [str(one) for one in bpy.app.handlers.depsgraph_update_post], dir(bpy.types.Object), dir(bpy.types.Action)


before = state()
assert "rigid_motion" in before[1]
sys.argv = [script, path]
try:
    runpy.run_path(script, run_name="__main__")
except SystemExit as ended:
    code = ended.code
print(json.dumps({"code": code, "as before": [len(one) for one in state()] == [len(one) for one in before]}))
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.rigid_motion")
"""


def test_an_installed_extension_steps_aside_and_is_there_again_afterwards(extension_zip, tmp_path):
    path = one_object_file(tmp_path / "shot.blend")
    command = ("-c", BESIDE_AN_INSTALLED_EXTENSION, ROOT / "scripts" / "bake.py", extension_zip, path)
    done = run_python(*command, BLENDER_USER_RESOURCES=str(tmp_path / "user"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert json.loads(done.stdout.splitlines()[-1]) == {"code": 0, "as before": True}
    assert "1 object baked.\n" in done.stderr
    assert "registered" not in done.stderr
    shutil.copy(baked_name(path), tmp_path / "alone.blend")
    open_again(tmp_path / "alone.blend")
    assert len(frames_of_keys(bpy.data.objects["Tool"])) == 40


@pytest.mark.parametrize("compress", [False, True])
def test_a_compressed_file_stays_compressed_and_another_not(tmp_path, compress):
    path = one_object_file(tmp_path / "shot.blend", compress=compress)
    before = path.read_bytes(), path.stat().st_mtime_ns
    assert run(path) == 0
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before
    assert listed(tmp_path) == ["shot-baked.blend", "shot.blend"]
    assert (baked_name(path).read_bytes()[:7] == b"BLENDER") is not compress
