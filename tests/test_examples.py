"""Tests of the examples: the commands in their READMEs are run as written, and their results are measured."""

import csv
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Vector

from examples import make_examples
from examples.camera import make as camera
from examples.dancer import make as dancer
from examples.lid import make as lid
from examples.sword import make as sword
from rigid_motion.motion import Poses, shell_error
from rigid_motion_batch.recordings.clip_reading import read_clips
from tests.animation.keyed import curves_of
from tests.scripts.comparing import outputs

EXAMPLES = Path(make_examples.__file__).parent

SINGLE = 1e-5
"""Allowed rounding in metres: Blender's matrices are in single precision."""


@pytest.fixture
def make(tmp_path: Path) -> Callable[[str], str]:
    """Return a function that runs all commands of a README in a copy of the examples, and returns their output."""
    make_examples.copy_to(tmp_path)
    return lambda name: make_examples.run_readme(name, tmp_path)


def readme(name: str) -> str:
    return (EXAMPLES / name / "README.md").read_text(encoding="utf-8")


def table(name: str) -> list[list[str]]:
    """Return the rows of the table in a README, the header first."""
    rows = [line.strip("|").split("|") for line in readme(name).splitlines() if line.startswith("| ")]
    return [[cell.strip() for cell in row] for row in rows]


def claims(name: str) -> list[str]:
    """Return the lines that a README says are printed."""
    return [line[4:] for line in re.findall(r"^ {4}\S.*$", readme(name), re.M) if "bootstrap.py" not in line]


def measured(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as stream:
        return list(csv.DictReader(stream))


def play(blend: Path, look: Callable[[bpy.types.Depsgraph], Sequence]) -> np.ndarray:
    """Return what `look` sees on each frame of a file without the extension, shape (frames, ...)."""
    bpy.ops.wm.open_mainfile(filepath=str(blend), use_scripts=False)
    scene, result = bpy.context.scene, []
    for frame in range(scene.frame_start, scene.frame_end + 1):
        scene.frame_set(frame)
        result.append(look(bpy.context.evaluated_depsgraph_get()))
    return np.array(result)


def matrix(depsgraph: bpy.types.Depsgraph, name: str) -> object:
    return bpy.data.objects[name].evaluated_get(depsgraph).matrix_world


def keys_of(name: str) -> int:
    """Return the number of frames on which an object has location keys."""
    return len(curves_of(bpy.data.objects[name])["location", 0].keyframe_points)


@pytest.mark.parametrize("name", make_examples.NAMES)
def test_an_example_says_what_to_type_shows_a_picture_and_is_listed(name: str) -> None:
    assert make_examples.commands_of(name)[0] == f"{make_examples.PROMPT}examples {name}"
    assert f"]({name}.png)" in readme(name).replace("\n", " ")
    assert (EXAMPLES / name / f"{name}.png").stat().st_size < 200_000
    assert f"]({name}/README.md)" in (EXAMPLES / "README.md").read_text(encoding="utf-8")


def test_a_lid_stays_in_its_hinge_by_the_screw_and_leaves_it_by_blenders_own(make: Callable, tmp_path: Path) -> None:
    printed = make("lid")
    assert all(line in printed for line in claims("lid"))

    def hinges(depsgraph: bpy.types.Depsgraph) -> list[Vector]:
        places = [(f"{name} lid", lid.IN_LID, f"{name} chest", lid.HINGE) for name in ("Blender", "Screw")]
        return [matrix(depsgraph, of) @ at - matrix(depsgraph, box) @ pin for of, at, box, pin in places]

    off = np.linalg.norm(play(tmp_path / "examples" / "lid" / "lid.blend", hinges), axis=2).max(axis=0)
    assert off[0] > 0.05
    assert off[1] < SINGLE
    assert keys_of("Screw lid") == keys_of("Blender lid") == len(lid.KEYS)


def test_a_sword_stays_in_the_hand_and_the_screw_keeps_the_arm_long(make: Callable, tmp_path: Path) -> None:
    printed = make("sword")
    assert all(line in printed for line in claims("sword"))

    def look(depsgraph: bpy.types.Depsgraph) -> list[list[float]]:
        result = []
        for name in ("Blender", "Screw"):
            rig = bpy.data.objects[f"{name} rig"].evaluated_get(depsgraph)
            bones, world = rig.pose.bones, rig.matrix_world
            slip = matrix(depsgraph, f"{name} sword").translation - world @ bones["hand"].head
            reach = world @ bones["DEF-forearm"].tail - world @ sword.SHOULDER
            result.append([slip.length, reach.length - (sword.WRIST - sword.SHOULDER).length])
        return result

    seen = np.abs(play(tmp_path / "examples" / "sword" / "sword.blend", look)).max(axis=0)
    assert seen[:, 0].max() < SINGLE
    assert seen[0, 1] > 0.1
    assert seen[1, 1] < 1e-4


@pytest.mark.any_blender
def test_a_hand_is_measured_as_its_page_says_from_a_log_with_faults(make: Callable, tmp_path: Path) -> None:
    make("hand")
    (_, *modes), *rates = table("hand")
    rows = {(row["mode"], row["rate_hz"]): row for row in measured(tmp_path / "renders" / "hand" / "metrics.csv")}
    for rate, *errors in rates:
        for mode, error in zip(modes, errors, strict=True):
            assert f"{1e3 * float(rows[mode, rate]['rms_shell_m']):.1f}" == error
    (clip,), _ = read_clips([str(tmp_path / "examples" / "hand" / "hand.csv")], "unity")
    repairs = " ".join(map(str, clip.repairs))
    assert all(word in repairs for word in ("runs backwards", "comes again", "sign flips", "gaps"))


@pytest.mark.any_blender
@pytest.mark.slow
def test_a_dancer_keeps_within_the_tolerance_with_a_quarter_of_the_keys(make: Callable, tmp_path: Path) -> None:
    printed = make("dancer")
    assert all(line in printed for line in claims("dancer"))

    def joints(depsgraph: bpy.types.Depsgraph) -> list[list[Vector]]:
        rigs = [bpy.data.objects[name].evaluated_get(depsgraph) for name in ("Recorded", "Key poses")]
        return [[bone.head.copy() for bone in rig.pose.bones] for rig in rigs]

    seen = play(tmp_path / "examples" / "dancer" / "dancer.blend", joints)
    off = np.linalg.norm(seen[:, 0] - seen[:, 1], axis=2)
    assert SINGLE < off.max() <= dancer.TOLERANCE
    assert seen[::5, 0, :, 2].min() > 0.0, "feet stay above the ground"

    def grey(depsgraph: bpy.types.Depsgraph) -> list[Vector]:
        return [bone.head.copy() for bone in bpy.data.objects["Recorded"].evaluated_get(depsgraph).pose.bones]

    reduced = play(tmp_path / "renders" / "dancer" / "dancer-reduced.blend", grey)
    assert SINGLE < np.linalg.norm(reduced - seen[:, 0], axis=2).max() <= dancer.TOLERANCE
    before, after = (int(number) for number in re.findall(r"(\d+) keys", printed))
    assert 4 * after < before


@pytest.mark.any_blender
def test_a_camera_keeps_within_the_tolerance_of_its_solution_with_few_keys(make: Callable, tmp_path: Path) -> None:
    printed = make("camera")
    assert all(line in printed for line in claims("camera"))
    folder = tmp_path / "examples" / "camera"
    (clip,), _ = read_clips([str(folder / "solve.csv")], "blender")

    def pose(depsgraph: bpy.types.Depsgraph) -> list[float]:
        location, rotation, _ = matrix(depsgraph, "Smooth").decompose()
        return [*location, *rotation]

    seen = play(folder / "camera.blend", pose)[np.round(clip.times * camera.FPS).astype(int)]
    assert len(seen) < camera.FRAMES
    off = shell_error(Poses(seen[:, :3], seen[:, 3:]), clip.poses, camera.RADIUS)
    assert SINGLE < off.max() <= camera.TOLERANCE + SINGLE
    rows = {row["mode"]: row["keys"] for row in measured(tmp_path / "renders" / "camera" / "metrics.csv")}
    assert rows == dict(table("camera")[1:])
    assert keys_of("Smooth") == int(rows["motor_spline"])
    assert len(measured(tmp_path / "renders" / "camera-keys" / "solve-keys.csv")) == int(rows["motor_spline"])
    assert keys_of("Solved") == len(clip.times)


@pytest.mark.any_blender
@pytest.mark.slow
def test_a_job_for_a_farm_makes_the_same_as_one_machine(make: Callable, tmp_path: Path) -> None:
    make("farm")
    on_farm, here = (outputs(tmp_path / "renders" / name) for name in ("farm", "farm-here"))
    assert on_farm == here
    assert {name for name in on_farm if name.endswith("/motor_spline.csv")} == {
        f"{take}/{rate}/motor_spline.csv" for take in ("drill", "probe", "toss") for rate in (5, 10)
    }
