"""Tests of bodies in scene files (props, cameras, node hierarchies without a skin) against Blender's own import."""

import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.recordings import Trajectory, read_trajectories
from rigid_motion_batch.recordings.inspecting import inspect
from rigid_motion_batch.recordings.scene_bodies import jointed
from rigid_motion_batch.silencing import silenced
from tests.blank import blank
from tests.gltf.making import Making
from tests.scripts.recordings.blends import FPS, FRAMES, added, export, in_blender, key, on_frames
from tests.scripts.recordings.glbs import turning

bpy = pytest.importorskip("bpy")

TIMES = np.arange(31) / 30

FIGURE = {"Hips": "Place", "Spine": "Hips", "Head": "Spine", "Arm": "Spine", "Leg": "Hips", "Foot": "Leg"}
"""Parents of nodes that are a body."""

ENDINGS = (".glb", ".gltf", ".vrma", ".fbx")

SINGLE = 3e-6
"""Tolerance in metres and radians for objects of about 1 m in single precision."""


def prop(name: str, number: int, **settings: object) -> bpy.types.Object:
    """Add a triangle mesh that flies and turns."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (0.2, 0, 0), (0, 0.1, 0.3)], [], [(0, 1, 2)])
    return moved(added(name, mesh, **settings), number)


def moved(obj: bpy.types.Object, number: int) -> bpy.types.Object:
    obj.rotation_mode = "QUATERNION"
    for frame in FRAMES:
        half = 0.04 * frame + 0.3 * number
        turn = (np.cos(half), 0.6 * np.sin(half), 0.0, 0.8 * np.sin(half))
        key(obj, frame, location=(0.05 * frame, 0.3 * number, np.sin(0.2 * frame)), rotation_quaternion=turn)
    return obj


def stage(path: Path) -> Path:
    """Write a file with three props, one parented to another and one to a scaled parent at rest, and a camera."""
    first = prop("Cup", 0)
    prop("Spoon", 1, parent=first)
    prop("Ring", 2, parent=added("Holder", location=(0, 0, 1), scale=(0.1, 0.1, 0.1), rotation_euler=(0.3, 0, 0.5)))
    moved(added("Eye", bpy.data.cameras.new("Eye")), 3)
    return exported(path)


def figure(path: Path) -> Path:
    """Write a file with a body of six nodes without a skin, below a node at rest, and a prop."""
    nodes = {"Place": added("Place", location=(0, 3, 0))}
    for number, (name, parent) in enumerate(FIGURE.items()):
        nodes[name] = added(name, parent=nodes[parent], rotation_mode="QUATERNION", location=(0.1, 0, 0.3))
        for frame in FRAMES:
            half = 0.03 * frame * (-1) ** number
            key(nodes[name], frame, rotation_quaternion=(np.cos(half), np.sin(half), 0, 0))
    key(nodes["Hips"], 1, location=(0, 0, 1))
    key(nodes["Hips"], 20, location=(0, -1, 1.1))
    prop("Cup", 0)
    return exported(path)


def exported(path: Path) -> Path:
    bpy.context.scene.frame_end = FRAMES[-1]
    # Otherwise a glTF has one animation per object, and an FBX has all objects' animations for each, and Blender plays
    # one of them.
    if path.suffix == ".fbx":
        settings = {"bake_anim_use_all_actions": False, "bake_anim_use_nla_strips": False}
    else:
        settings = {"export_cameras": True, "export_animation_mode": "ACTIVE_ACTIONS"}
    made = export(path.with_suffix(".glb") if path.suffix == ".vrma" else path, **settings)
    return Path(shutil.move(made, path)) if path.suffix == ".vrma" else made


def imported(path: Path, names: Sequence[str]) -> dict[str, Poses]:
    """Return the poses of objects after Blender's own import, from the first key on."""
    bpy.context.scene.render.fps = FPS
    with silenced():
        (bpy.ops.import_scene.fbx if path.suffix == ".fbx" else bpy.ops.import_scene.gltf)(filepath=str(path))

    def show(depsgraph: bpy.types.Depsgraph) -> list:
        shown = (bpy.data.objects[name].evaluated_get(depsgraph) for name in names)
        return [np.concatenate(obj.matrix_world.decompose()[:2]) for obj in shown]

    first = int(min(action.frame_range[0] for action in bpy.data.actions))
    seen = in_blender(range(first, first + len(FRAMES)), show)
    blank()
    return {name: Poses(rows[:, :3], rows[:, 3:]) for name, rows in zip(names, seen, strict=True)}


def assert_same(result: Trajectory, expected: Poses) -> None:
    result = on_frames(result)
    np.testing.assert_allclose(result.times, np.arange(len(FRAMES)) / FPS, atol=1e-9)
    np.testing.assert_allclose(result.poses.positions, expected.positions, atol=SINGLE)
    assert angle_between(result.poses.quaternions, expected.quaternions).max() < 1e-3
    assert (np.abs(np.sum(result.poses.quaternions * expected.quaternions, axis=-1)) > 1.0 - SINGLE).all()
    assert result.poses.scales is None
    assert (result.metres_per_unit, result.rate, result.warnings) == (1.0, float(FPS), ())


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Making:
    """A glTF to fill in, which is read without Blender."""
    monkeypatch.setitem(sys.modules, "bpy", None)
    return Making()


@pytest.mark.parametrize("ending", ENDINGS)
def test_what_moves_alone_is_a_rigid_body_where_blender_imports_it(scene, tmp_path: Path, ending: str) -> None:
    path = stage(tmp_path / f"stage{ending}")
    names = ("Cup", "Spoon", "Ring", "Eye")
    expected = imported(path, names)
    recording = read_trajectories(str(path))
    assert f"{path} holds 4 bodies; took {recording.trajectories[0].name}; others: " in recording.note
    every = {single.name: single for single in read_trajectories(f"{path}:*").trajectories}
    assert every.keys() == {*names} == {*inspect(str(path)).bodies}
    for name in names:
        assert_same(every[name], expected[name])
        (single,) = read_trajectories(f"{path}:{name.lower()}").trajectories
        assert single.name == name
        assert_same(single, expected[name])
    (holder,) = read_trajectories(f"{path}:Holder").trajectories
    assert np.ptp(holder.poses.positions, axis=0).max() == 0.0, "it rests, and can be had by its name"


@pytest.mark.parametrize("ending", ENDINGS)
def test_nodes_that_hang_on_one_another_are_a_body(scene, tmp_path: Path, ending: str) -> None:
    path = figure(tmp_path / f"figure{ending}")
    expected = imported(path, [*FIGURE])
    recording = read_trajectories(str(path))
    (whole,) = recording.trajectories
    assert "took Place of 2 bodies; others: Cup" in recording.note
    assert whole.name == "figure"
    joints = whole.rest_body.joints
    parents = [joints[parent] if parent >= 0 else "Place" for parent in whole.rest_body.parents]
    assert dict(zip(joints, parents, strict=True)) == FIGURE
    world = whole.rest_body.skeleton.in_root_space(on_frames(whole).poses)
    for name in FIGURE:
        np.testing.assert_allclose(world[joints.index(name)].positions, expected[name].positions, atol=SINGLE)
    (hand,) = read_trajectories(f"{path}:Place/Arm").trajectories
    np.testing.assert_allclose(on_frames(hand).poses.positions, expected["Arm"].positions, atol=SINGLE)
    assert len(read_trajectories(f"{path}:*").trajectories) == len(FIGURE) + 1


@pytest.mark.parametrize("ending", [".glb", ".fbx"])
def test_each_object_has_its_own_animation_of_those_that_blender_exports(scene, tmp_path: Path, ending: str) -> None:
    places = {}
    for number, name in enumerate(("Cup", "Spoon", "Fork")):
        obj = prop(name, number)
        obj.animation_data.action.name = f"{name}Action"
        places[name] = np.column_stack([(0.05 * frame, 0.3 * number, np.sin(0.2 * frame)) for frame in FRAMES]).T
    bpy.context.scene.frame_end = FRAMES[-1]
    recording = read_trajectories(f"{export(tmp_path / f'stage{ending}')}:*")
    assert {single.name for single in recording.trajectories} == {*places}
    for single in recording.trajectories:
        np.testing.assert_allclose(on_frames(single).poses.positions, places[single.name], atol=SINGLE)
    assert ("took its take Spoon|Spoon|SpoonAction; others: Spoon|Spoon|CupAction, " in recording.note) == (
        ending == ".fbx"
    )


def test_a_vrma_names_its_joints_itself(made: Making, tmp_path: Path) -> None:
    """Without the VRMA names, three moving joints would be too few for a body, and the last joint does not move."""
    made.json["nodes"] = [
        *({"name": name, "translation": [0, 0.5, 0], "children": [child]} for child, name in enumerate("abcd", 1)),
        {"name": "e", "translation": [0, 0.5, 0]},
    ]
    bones = {name: {"node": node} for node, name in ((0, "hips"), (1, "spine"), (2, "chest"), (3, "neck"), (4, "head"))}
    made.json["extensions"] = {"VRMC_vrm_animation": {"specVersion": "1.0", "humanoid": {"humanBones": bones}}}
    made.uses("VRMC_vrm_animation")
    made.channel(1, "rotation", made.times(TIMES), turning(TIMES, TIMES))
    (body,) = read_trajectories(str(made.write(tmp_path / "wave.glb").rename(tmp_path / "wave.vrma"))).trajectories
    assert body.rest_body.joints == tuple("abcde")
    tip = body.rest_body.skeleton.in_root_space(body.poses).positions[4]
    np.testing.assert_allclose(
        tip, np.column_stack((-1.5 * np.sin(TIMES), 0 * TIMES, 1 + 1.5 * np.cos(TIMES))), atol=1e-6
    )


def test_takes_of_other_nodes_play_along_and_others_are_told(made: Making, tmp_path: Path) -> None:
    """Some exporters write one animation per object."""
    made.json["nodes"] = [{"name": "Cart", "children": [1]}, {"name": "Wheel", "translation": [1, 0, 0]}]
    places = np.column_stack((TIMES, 0 * TIMES, 0 * TIMES))
    made.channel(0, "translation", made.times(TIMES), places, clip=0)
    made.channel(1, "rotation", made.times(TIMES), turning(TIMES, 2 * TIMES), clip=1)
    made.channel(0, "translation", made.times(TIMES), 2 * places, clip=2)
    path = made.write(tmp_path / "cart.glb")
    wheel = read_trajectories(f"{path}:Wheel")
    np.testing.assert_allclose(wheel.trajectories[0].poses.positions[:, 0], 1 + TIMES, atol=1e-6)
    assert np.degrees(angle_between(*wheel.trajectories[0].poses.quaternions[[0, -1]])) == pytest.approx(114.6, abs=0.1)
    assert wheel.note == "took its take Take0, Take1; others: Take2"


def test_a_prop_that_grows_has_scales_and_one_in_a_file_of_centimetres_has_none(tmp_path: Path) -> None:
    for size in (1.0, 0.01):
        made = Making()
        made.json["nodes"] = [{"name": "Root", "scale": [size] * 3, "children": [1]}, {"name": "Balloon"}]
        made.channel(1, "translation", made.times(TIMES), np.column_stack((TIMES, TIMES, TIMES)) / size)
        if size == 1.0:
            made.channel(1, "scale", made.times(TIMES), np.column_stack([1 + TIMES] * 3))
        (balloon,) = read_trajectories(str(made.write(tmp_path / "balloon.glb"))).trajectories
        np.testing.assert_allclose(balloon.poses.positions[:, 2], TIMES, atol=1e-6)
        if size == 1.0:
            np.testing.assert_allclose(balloon.poses.scales, 1 + TIMES, atol=1e-6)
        else:
            assert balloon.poses.scales is None


def test_a_mesh_that_is_compressed_leaves_a_body_without_its_skin(made: Making, tmp_path: Path) -> None:
    made.json["nodes"] = [{"name": "Joint"}, {"name": "Skin", "mesh": 0, "skin": 0}]
    made.json["scenes"] = [{"nodes": [0, 1]}]
    made.json["skins"] = [{"joints": [0]}]
    attributes = {"POSITION": made.accessor(np.zeros((3, 3), dtype="<f4"))}
    compressed = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    made.json["meshes"] = [{"primitives": [{"attributes": attributes, "extensions": compressed}]}]
    made.channel(0, "rotation", made.times(TIMES), turning(TIMES, TIMES))
    recording = read_trajectories(str(made.write(tmp_path / "body.glb")))
    assert recording.trajectories[0].rest_body.skin is None
    assert recording.note == "without its skin: it is compressed by Draco"


@pytest.mark.parametrize(
    ("count", "generations", "is_body"), [(5, 3, True), (4, 4, False), (9, 2, False), (60, 60, True)]
)
def test_few_nodes_or_flat_ones_are_no_body(count: int, generations: int, is_body: bool) -> None:
    parents = np.array([*range(-1, generations - 1), *[0] * (count - generations)])
    every = np.ones(count, dtype=bool)
    assert jointed(parents, every, every) == ([[*range(count)]] if is_body else [])


def test_nodes_have_names_of_their_own_and_what_is_named_and_not_there_is_told(
    made: Making, tmp_path: Path, refusal
) -> None:
    made.json["nodes"] = [{}, {"name": 3}, {"name": "Cup"}, {"name": "Cup"}, {"name": "cup"}, {"name": "Table"}]
    for node in range(5):
        made.channel(node, "translation", made.times(TIMES), np.column_stack((TIMES, TIMES, node * TIMES)))
    path = made.write(tmp_path / "cups.glb")
    names = ["Node_0", "Node_1", "Cup", "Cup.001", "cup"]
    assert [single.name for single in read_trajectories(f"{path}:*").trajectories] == names
    assert refusal(f"{path}:Fork")[1] == "no body named 'Fork'; it holds Node_0, Node_1, Cup, Cup.001, cup, Table"
    assert refusal(f"{path}:CUP")[1].startswith("no body named 'CUP', and 2 that differ from it in their case alone; ")


def test_two_keys_at_one_time_are_a_cut(made: Making, tmp_path: Path) -> None:
    cut = np.array([0.0, 0.5, 0.5, 1.0])
    made.json["nodes"] = [{"name": "Cup"}]
    made.channel(0, "translation", made.times(cut), np.array([[0, 0, 0], [0.1, 0, 0], [2, 0, 0], [2.1, 0, 0]]))
    (cup,) = read_trajectories(str(made.write(tmp_path / "cup.glb"))).trajectories
    for moment, place in ((0.4997, 0.0999), (0.5, 2.0), (0.75, 2.05)):
        sample = np.searchsorted(cup.times, moment + 1e-9) - 1
        assert cup.poses.positions[sample, 0] == pytest.approx(place, abs=1e-3)
    assert len(cup.times) == 62, "60 a second, and one before the cut"
    assert "it jumps" in cup.warnings[0].text


def test_what_moves_in_an_unknown_way_is_told(made: Making, tmp_path: Path) -> None:
    follows = {"VRMC_node_constraint": {"constraint": {"rotation": {"source": 0}}}}
    made.json["nodes"] = [{"name": "Cup"}, {"name": "Lid", "extensions": follows}]
    made.channel(0, "rotation", made.times(TIMES), turning(TIMES, TIMES))
    recording = read_trajectories(str(made.write(tmp_path / "cup.glb")))
    assert recording.note == "node Lid follows others by VRMC_node_constraint, which is not worked out here"
