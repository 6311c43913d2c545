"""Tests of BVH joints: worked out by hand, against the matrices of Blender's importer, and wrong files."""

from itertools import permutations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.recordings import ReadingOptions, read_trajectories

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
