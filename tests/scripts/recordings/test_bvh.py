"""Tests of BVH files: by hand, against Blender's importer, and as found in practice, with units and still roots."""

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.recordings import ReadingOptions, Trajectory, read_clips, read_trajectories
from rigid_motion_batch.recordings.bvh_writing import write_bvh
from rigid_motion_batch.recordings.clip_reading import make_clip
from rigid_motion_batch.recordings.inspecting import inspect
from rigid_motion_batch.recordings.rest_bodies import (
    Skin,
    carrying,
    part_of_body,
    repaired,
    size_of,
    unit_above_floor,
)
from tests.scripts.clips.bodies import JOINTS, swinging_body

ARM = """HIERARCHY
ROOT Shoulder
{
    OFFSET 0.0 0.0 0.0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT Elbow
    {
        OFFSET 2.0 0.0 0.0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
            OFFSET 1.0 0.0 0.0
        }
    }
}
MOTION
Frames: 2
Frame Time: 0.04
0 0 0  0 0 0  0 0 0
1 5 0  90 0 0  -90 0 0
"""


def test_without_a_name_it_is_the_whole_body_each_joint_in_its_parents_space(write) -> None:
    recording = read_trajectories(write("arm.bvh", ARM.replace("1 5 0  90", "1 2 0  90")))
    (body,) = recording.trajectories
    assert (body.name, recording.others, recording.note, recording.axes) == ("arm", (), "", "opengl")
    assert body.rest_body.joints == ("Shoulder", "Elbow")
    np.testing.assert_array_equal(body.times, [0.0, 0.04])
    np.testing.assert_array_equal(body.rest_body.parents, [-1, 0])
    np.testing.assert_array_equal(body.rest_body.rest.positions, [[0, 0, 0], [2, 0, 0]])
    np.testing.assert_array_equal(body.rest_body.rest.quaternions, [[1, 0, 0, 0]] * 2)
    np.testing.assert_array_equal(body.rest_body.tails[0], [2, 0, 0])
    assert body.rest_body.ends.tolist() == [0.0, np.linalg.norm(body.rest_body.tails[1])]  # Its end site.
    assert body.rest_body.ends[1] > 0.0
    np.testing.assert_allclose(body.poses.positions, [[[0, 0, 0], [1, 2, 0]], [[2, 0, 0]] * 2], atol=1e-15)
    there = body.rest_body.skeleton.in_root_space(body.poses)
    for joint, alone in enumerate(read_trajectories(str(recording.path) + ":*").trajectories):
        np.testing.assert_allclose(there[joint].positions, alone.poses.positions, atol=1e-15)
        assert angle_between(there[joint].quaternions, alone.poses.quaternions).max() < 1e-15


@pytest.mark.parametrize(
    "text",
    [
        ARM.replace("\n", "\r\n"),
        ARM.replace("    ", "\t"),
        ARM.replace("\n{", " {").replace("ROOT", "root").replace("position", "POSITION"),
        ARM.replace("End Site", "End Site Hand_end"),
        ARM.replace("Frame Time: 0.04", "Frame Time:\t4e-2").replace("Frames: 2", "Frames:\t2 "),
        ARM + "\n\n",
    ],
)
def test_spelling_and_spacing_do_not_matter(write, text: str) -> None:
    _, elbow = read_trajectories(write("arm.bvh", text) + ":*").trajectories
    np.testing.assert_allclose(elbow.poses.positions, [[2, 0, 0], [1, 7, 0]], atol=1e-15)


@pytest.mark.parametrize(("name", "read"), [("Shoulder", "Shoulder.001"), ("Left  Elbow : top", "Left Elbow : top")])
def test_joints_keep_the_spaces_in_their_names_and_have_each_another(write, name: str, read: str) -> None:
    (body,) = read_trajectories(write("arm.bvh", ARM.replace("Elbow", name))).trajectories
    assert body.rest_body.joints == ("Shoulder", read)


@pytest.mark.parametrize("count", [1, 3, 60])
def test_more_or_fewer_rows_than_the_file_says_are_read_with_a_warning(write, count: int) -> None:
    path = write("arm.bvh", ARM.replace("Frames: 2", f"Frames: {count}"))
    (body,) = read_trajectories(path).trajectories
    (warning,) = body.warnings
    assert str(warning).startswith(f"arm.bvh:17: Frames: says {count} and 2 whole rows follow")
    np.testing.assert_array_equal(body.times, [0.0, 0.04])
    assert read_trajectories(write("arm.bvh", ARM)).trajectories[0].warnings == ()
    shoulder, elbow = read_trajectories(write("arm.bvh", ARM.replace("Frames: 2", "Frames: 3")) + ":*").trajectories
    assert (len(shoulder.warnings), len(elbow.warnings)) == (1, 0)


SURE = "guessed from the size alone, the only usual unit that makes a grown-up of it"


@pytest.mark.parametrize(
    ("size", "metres", "remark", "doubted"),
    [
        (1.7, 1.7, "", False),
        (170.0, 1.7, f"centimetres: 1.7 m, {SURE}", False),
        (7.0, 2.13, f"feet: 2.13 m, {SURE}", False),
        (17.0, 0.96, "units of CMU's motion capture", False),
        (17.0, 0.96, "may as well be decimetres (1.7 m)", False),
        (0.1, 0.1, "", True),
    ],
)
def test_a_guessed_unit_is_told_with_how_sure_it_is(write, size: float, metres: float, remark: str, doubted: bool):
    text = ARM.replace("2.0 0.0 0.0", f"{size} 0.0 0.0")
    (body,) = read_trajectories(path := write("arm.bvh", text)).trajectories
    assert size * body.metres_per_unit == pytest.approx(metres, abs=5e-3)
    assert remark in body.remark
    warned = " ".join(map(str, body.warnings))
    assert (f"it is {metres:.3g} m large" in warned) == doubted
    assert ("; if not, say how long it is: --scale METRES" in warned) == doubted
    (scaled,) = read_trajectories(path, ReadingOptions(scale=0.5)).trajectories
    assert (scaled.metres_per_unit, scaled.remark, scaled.warnings) == (0.5, "", ())


def skeleton(random: np.random.Generator, frames: int) -> str:
    """Return a BVH file of a branching chain; each joint has its own order of channels, some have positions."""
    orders = ["".join(order) for order in permutations("XYZ")]
    count = 0

    def joint(depth: int, children: list) -> str:
        nonlocal count
        positions = depth == 0 or random.random() < 0.3
        channels = [f"{axis}position" for axis in random.permutation(list("XYZ"))] if positions else []
        channels += [f"{axis}rotation" for axis in orders[count % len(orders)]]
        name, count = f"Joint{count}", count + 1
        widths.append(len(channels))
        offset = " ".join(f"{number:.6f}" for number in random.uniform(-1, 1, 3))
        inner = "".join(joint(depth + 1, child) for child in children) or "End Site\n{\nOFFSET 0 0.5 0\n}\n"
        kind = "JOINT" if depth else "ROOT"
        return f"{kind} {name}\n{{\nOFFSET {offset}\nCHANNELS {len(channels)} {' '.join(channels)}\n{inner}}}\n"

    widths: list[int] = []
    hierarchy = joint(0, [[[[]], []], [[[]]]])
    rows = random.uniform(-180, 180, (frames, sum(widths)))
    motion = "\n".join(" ".join(f"{number:.6f}" for number in row) for row in rows)
    return f"HIERARCHY\n{hierarchy}MOTION\nFrames: {frames}\nFrame Time: 0.0333333\n{motion}\n"


# The importer does not close its file, but leaves it to the garbage collector.
@pytest.mark.blender
@pytest.mark.filterwarnings("ignore::ResourceWarning")
@pytest.mark.parametrize("seed", range(4))
def test_the_poses_are_those_of_blenders_importer(write, scene, seed: int) -> None:
    bpy = pytest.importorskip("bpy")
    from tests.scripts.recordings.blends import bones_in_blender

    frames = 6
    path = write("skeleton.bvh", skeleton(np.random.default_rng(seed), frames))
    trajectories = read_trajectories(path + ":*").trajectories
    bpy.ops.preferences.addon_enable(module="io_anim_bvh")
    bpy.ops.import_anim.bvh(filepath=path, axis_forward="Y", axis_up="Z", frame_start=1)
    armature = bpy.context.object
    assert len(trajectories) == len(armature.pose.bones) == 8
    for trajectory in trajectories:
        (shown,) = bones_in_blender(armature, (trajectory.name,), range(1, 1 + frames))
        at_rest = np.array(armature.data.bones[trajectory.name].matrix_local)
        turned = Rotation.from_matrix((shown @ np.linalg.inv(at_rest))[:, :3, :3])
        # Blender works in single precision, and positions here go to several hundred units.
        np.testing.assert_allclose(trajectory.poses.positions, shown[:, :3, 3], atol=1e-3)
        assert angle_between(trajectory.poses.quaternions, turned.as_quat(scalar_first=True)).max() < 5e-5


FILES = Path(__file__).parent / "bodies"


def whole(name: str) -> tuple[Trajectory, np.ndarray]:
    """Return a body and its joint positions, shape (joints, n, 3)."""
    (body,) = read_trajectories(str(FILES / name)).trajectories
    return body, body.rest_body.skeleton.in_root_space(body.poses).positions


def test_a_root_that_stands_still_is_not_what_is_measured() -> None:
    (content,) = inspect(str(FILES / "static_root.bvh")).contents
    assert content.up == "y"
    assert content.unit.name == "centimetres"
    assert content.size.path == pytest.approx(3.51, abs=0.01), "of the hips, 3.51 m in a row"
    assert content.size.speed == pytest.approx(1.8, abs=0.02)
    for name, roots in (("static_root.bvh", [0]), ("upper_body_cm.bvh", [])):
        body, places = whole(name)
        assert np.flatnonzero(carrying(body.rest_body.parents, places)).tolist() == roots


# A root, hips with two legs and a spine, and two other children of the root.
PARENTS = [-1, 0, 1, 1, 1, 0, 0]
STANDING = [[0, 0, 0], [5, 0, 0.9], [5, 0.1, 0], [5, -0.1, 0], [5, 0, 1.7], [8, 3, 0], [-2, 0, 2]]
NEAR = [*STANDING[:5], [6.5, 0, 0], [5.5, 0, 0.5]]
SITTING = [-1, 0, 1, 0, 0], [[0, 0, 0], [0, 0, 0.5], [0.3, 0, 0.6], [0.4, 0.1, 0], [0.4, -0.1, 0.0]]


@pytest.mark.parametrize(
    ("parents", "standing", "moving", "aside"),
    [
        (PARENTS, STANDING, [], []),
        (PARENTS, STANDING, [1, 2, 3, 4], [0, 5, 6]),
        (PARENTS, STANDING, [1, 2, 3, 4, 5, 6], [0]),
        (PARENTS, STANDING, [0, 1, 2, 3, 4, 5, 6], []),
        (PARENTS, STANDING, [2, 4], []),
        (PARENTS, NEAR, [1, 2, 3, 4], [0]),
        (*SITTING, [2], []),
    ],
    ids=["nothing", "one of several", "all", "the root too", "hips that stay", "near what stands", "arms of who sits"],
)
def test_a_root_that_stands_is_aside_with_what_stands_far_from_all_that_moves(
    parents: list[int], standing: list[list[float]], moving: list[int], aside: list[int]
) -> None:
    places = np.repeat(np.array(standing, dtype=float)[:, None], 100, axis=1)
    places[moving, :, 0] += np.linspace(0.0, 2.0, 100)
    assert np.flatnonzero(carrying(np.array(parents), places)).tolist() == aside
    assert np.flatnonzero(~part_of_body(np.array(parents), places)).tolist() == aside


def test_the_upper_half_of_a_body_is_not_in_inches_where_its_hips_would_be_higher_than_those_of_giants() -> None:
    body, _ = whole("upper_body_cm.bvh")
    assert body.metres_per_unit == 0.01
    assert "in inches, all of it would be more than 2.24 m up" in body.remark
    hand = f"{FILES / 'upper_body_cm.bvh'}:LeftHand"
    for options, metres, known in (
        (ReadingOptions(), 0.01, "guessed from the size of the body"),
        (ReadingOptions(scale=0.1), 0.1, "as --scale says"),
    ):
        unit = inspect(hand, options=options).contents[0].unit
        assert (unit.metres, unit.known_from) == (metres, known), "a joint is in the unit of its body"


@pytest.mark.parametrize(
    ("size", "lowest", "highest", "unit"),
    [
        (69.67, 88, 156, "centimetres"),
        (50, 90, 140, "centimetres"),
        (170, 0, 170, "centimetres"),
        (170, 500, 670, "centimetres"),
        (68, 0, 68, "inches"),
        (68, 2, 70, "inches"),
        (68, -34, 34, "inches"),
        (1.7, 8, 9.7, "metres"),
        (30, 0, 30, "units of CMU's motion capture, 1/0.45 inch"),
    ],
)
def test_what_is_above_the_floor_has_a_say_in_the_unit(size: float, lowest: float, highest: float, unit: str) -> None:
    assert unit_above_floor(size, lowest, highest)[0] == unit


def test_positions_that_are_meant_to_be_added_to_offsets_are() -> None:
    body, places = whole("zero_positions.bvh")
    assert str(body.warnings[0]).startswith(
        "positions of 3 joints below the root are near 0 and not near their OFFSETs"
    )
    lengths = np.linalg.norm(places[1:] - places[[0, 1, 0]], axis=-1)
    np.testing.assert_allclose(lengths, np.repeat([[40.0], [35.0], [np.hypot(9, 45)]], 40, axis=1))
    assert body.metres_per_unit == 0.01
    body, places = whole("positions_additive.bvh")
    np.testing.assert_allclose(np.linalg.norm(places[1] - places[0], axis=-1), 50.0)
    assert inspect(str(FILES / "positions_additive.bvh")).contents[0].up == "y"


def test_a_name_with_spaces_finds_its_joint_and_is_written_as_it_is(tmp_path: Path) -> None:
    source = str(FILES / "names_with_spaces.bvh")
    for name in ("Bip01 Neck", "bip01 neck", "Bip01_Neck"):
        (neck,) = read_trajectories(f"{source}:{name}").trajectories
        assert neck.name == "Bip01 Neck"
    (clip,), _ = read_clips([source])
    with (tmp_path / "again.bvh").open("w") as file:
        write_bvh(file, clip.rest_body, np.array([True, False]), clip.times, clip.poses)
    (again,), _ = read_clips([str(tmp_path / "again.bvh")])
    assert again.rest_body.joints == clip.rest_body.joints == ("Bip01 Pelvis", "Bip01 Neck")
    np.testing.assert_allclose(again.poses.positions, clip.poses.positions, atol=1e-5)
    np.testing.assert_allclose(again.poses.quaternions, clip.poses.quaternions, atol=1e-7)


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 1e38])
def test_a_joint_that_is_nowhere_at_rest_has_no_bone_and_is_told(number: float) -> None:
    clip = swinging_body()
    skin = Skin(np.eye(3), np.array([[0, 1, 2]]), np.zeros((3, 4), dtype=int), np.eye(4)[[0, 0, 0]])
    damaged = replace(clip.rest_body, skin=skin, ends=np.full(len(JOINTS), 0.1))
    damaged.tails[2, 1] = damaged.rest.positions[5, 0] = damaged.skin.vertices[1, 1] = number
    sound, done = repaired(damaged)
    nowhere = np.isin(np.arange(len(JOINTS)), (2, 5))
    np.testing.assert_array_equal(sound.ends, np.where(nowhere, 0.0, 0.1))
    np.testing.assert_array_equal(sound.tails, np.where(nowhere[:, None], 0.0, damaged.tails))
    np.testing.assert_array_equal(sound.rest.positions, np.where(nowhere[:, None], 0.0, damaged.rest.positions))
    assert sound.skin is None
    assert done == (
        "drew no bones for joints that are nowhere at rest (2: Head, Glove)",
        "left out a skin with numbers that are missing, not finite or too large",
    )
    made = make_clip(Trajectory("walk", clip.times, clip.poses, rest_body=damaged), "walk.fbx", "walk", "blender")
    assert made.repairs == done
    np.testing.assert_array_equal(made.rest_body.tails, sound.tails)


def test_the_size_of_a_body_is_that_from_where_it_branches() -> None:
    # A reference on the ground, the root of the body as its child, and an arm and a leg.
    parents = np.array([-1, 0, 1, 1, 3])
    places = np.array([[0, 0, 0], [0, 50, 0], [0, 51, 0], [0, 49.5, 0], [0, 49.2, 0.4]])
    assert size_of(parents, places) == pytest.approx(1.8)
    chain = np.array([-1, 0, 1])
    assert size_of(chain, np.array([[0, 0, 0], [3.0, 0, 0], [3, 4, 0]])) == pytest.approx(4.0)
    assert size_of(np.array([-1]), np.zeros((1, 3))) == 0.0
