import dataclasses
from pathlib import Path

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scipy.spatial.transform import Rotation

from rigid_motion import animation
from rigid_motion.motion import KEYFRAME_MODES, MODES, Poses
from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.analysis.choices import Tolerance, Uniform
from rigid_motion_batch.analysis.reconstructions import Reconstruction, reconstruct
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.recordings import read_clips
from rigid_motion_batch.scenes import layout
from rigid_motion_batch.scenes.armature import RestFigure
from rigid_motion_batch.scenes.bodies import SHADE_COUNT
from rigid_motion_batch.scenes.body_scene import build_body_scene, shown_motion
from rigid_motion_batch.scenes.film import save_blend
from rigid_motion_batch.scenes.physique import BONE
from rigid_motion_batch.scenes.settings import SceneSettings
from rigid_motion_batch.scenes.timeline import Timeline
from tests.scripts.clips.dancers import JOINTS, dancing_clip
from tests.scripts.comparing import shell_errors

BODIES = Path(__file__).parents[1] / "recordings" / "bodies"

SETTINGS = SceneSettings(resolution=(160, 90), fps=24)
TWO = ("lerp_slerp", "motor_spline")
RADIUS = 0.03


def made_of(clip, modes=TWO) -> Reconstruction:
    return reconstruct(clip, Uniform("5"), modes, RADIUS)


def test_a_body_is_in_the_middle_of_the_film_wherever_its_root_stands() -> None:
    (clip,), _ = read_clips([str(BODIES / "static_root.bvh")])
    made = made_of(clip)
    motion, centre = shown_motion(made, TWO[:1], timeline_of(made), RestFigure.of(clip))
    hips = clip.in_blender(made.skeleton.in_root_space(clip.poses))[1].positions
    assert abs(centre[1] - np.ptp(hips[:, 1]) / 2.0 - hips[:, 1].min()) < 0.5, "and not half-way to the root"
    places = motion.places(motion.recording)
    np.testing.assert_allclose(places[..., :2].min(axis=(0, 1)), -places[..., :2].max(axis=(0, 1)), atol=0.2)


def timeline_of(made: Reconstruction) -> Timeline:
    return Timeline.between(float(made.times[0]), float(made.times[-1]), SETTINGS.fps, SETTINGS.slow_motion)


def bones_of_joints() -> list[str]:
    """Return the names of the joints' bones, in the order of joints; Blender has a different order."""
    return [group.name for group in bpy.data.objects["lerp_slerp keys"].vertex_groups]


def seen(rig: bpy.types.Object, turns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the evaluated joints at the current frame, in the space of the armature, from the poses of their bones."""
    evaluated = rig.evaluated_get(bpy.context.evaluated_depsgraph_get())
    matrices = np.array([evaluated.pose.bones[bone].matrix for bone in bones_of_joints()])
    quaternions = Rotation.from_matrix(matrices[:, :3, :3]) * Rotation.from_quat(turns, scalar_first=True).inv()
    return matrices[:, :3, 3], quaternions.as_quat(scalar_first=True)


def turns_of(rig: bpy.types.Object, rest: RestFigure) -> np.ndarray:
    """Return the rotations from joints to their bones."""
    bones = np.array([rig.data.bones[bone].matrix_local for bone in bones_of_joints()])[:, :3, :3]
    joints = Rotation.from_quat(rest.joints.quaternions, scalar_first=True)
    return (joints.inv() * Rotation.from_matrix(bones)).as_quat(scalar_first=True)


def assert_played(made: Reconstruction, scene: bpy.types.Scene, modes: tuple[str, ...]) -> None:
    timeline = timeline_of(made)
    times = timeline.times_of(timeline.frames)
    centre = np.array(scene["recording_centre_m"])
    clip = made.clip
    rest = RestFigure.of(clip)
    expected = {mode: to_blender(made.shown(mode, times), clip.axes) for mode in modes}
    turns = {mode: turns_of(bpy.data.objects[mode], rest) for mode in modes}
    columns = [np.interp(times, clip.times, column) for column in clip.poses.positions[0].T]
    root = to_blender(clip.in_metres(Poses(np.stack(columns, axis=-1), np.zeros((len(times), 4)))), clip.axes).positions
    for number, frame in enumerate(timeline.frames.astype(int).tolist()):
        scene.frame_set(frame)
        for mode in modes:
            places, quaternions = seen(bpy.data.objects[mode], turns[mode])
            assert np.abs(places + centre - expected[mode].positions[:, number]).max() < 2e-5
            assert angle_between(quaternions, expected[mode].quaternions[:, number]).max() < 2e-4
        places, _ = seen(bpy.data.objects[f"{modes[0]} recording"], turns[modes[0]])
        assert np.abs(places[0] + centre - root[number]).max() < 2e-4
    for mode in modes:
        rig, rest_body = bpy.data.objects[f"{mode} recording"], bpy.data.objects[f"{mode} recording figure"]
        assert (rig.matrix_world.translation - rest_body.matrix_world.translation).length < 1e-6
        assert (rig.matrix_world.translation - bpy.data.objects[mode].matrix_world.translation) @ Vector(
            layout.AWAY_AXIS
        ) > 0.1


@pytest.mark.parametrize(("axes", "metres_per_unit", "modes"), [("blender", 1.0, tuple(MODES)), ("unity", 0.0254, TWO)])
def test_every_mode_is_played_on_every_frame_as_it_was_computed(axes, metres_per_unit, modes):
    made = made_of(dancing_clip(axes=axes, metres_per_unit=metres_per_unit), modes)
    assert_played(made, build_body_scene(made, SETTINGS), modes)


def test_keys_between_frames_and_of_each_joint_its_own_are_played_too_from_a_file_without_the_extension(tmp_path):
    made = reconstruct(dancing_clip(rate=97.0), Tolerance("0.02"), TWO, RADIUS)
    assert len({len(own) for own in made.keys["lerp_slerp"]}) > 1
    build_body_scene(made, SETTINGS)
    save_blend(tmp_path / "stage.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "stage.blend"), use_scripts=False)
    assert not hasattr(bpy.types.PoseBone, "rigid_motion")
    assert_played(made, bpy.context.scene, TWO)


def test_bones_have_the_keys_that_were_kept_and_their_mode(tmp_path):
    made = made_of(dancing_clip(still=[2]))
    build_body_scene(made, SETTINGS)
    save_blend(tmp_path / "stage.blend")
    animation.register()
    try:
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "stage.blend"))
        for mode in TWO:
            for joint, name in enumerate(JOINTS):
                bone = bpy.data.objects[mode].pose.bones[name]
                keys = animation.key_frames(bone)
                if joint == 2:
                    assert not len(keys)
                    continue
                expected = timeline_of(made).frames_of(made.clip.times[made.keys[mode][joint]])
                assert keys == pytest.approx(expected, abs=1e-3)
                assert set(animation.modes_of(bone, keys[:-1])) == {mode}
    finally:
        animation.unregister()


def errors_at(made: Reconstruction, mode: str, frame: int) -> np.ndarray:
    """Return the largest displacement of any point of the ball at each joint."""
    time = np.atleast_1d(timeline_of(made).times_of(np.array(float(frame))))
    number = int(np.searchsorted(made.clip.times, time[0] - 1e-9))
    assert made.clip.times[number] == pytest.approx(time[0])
    shown, truth = made.shown(mode, time)[:, 0], made.truth(slice(number, number + 1))[:, 0]
    return shell_errors(shown, truth, RADIUS)


@pytest.mark.parametrize("skin", [False, True], ids=["solids", "skin"])
def test_the_colour_of_each_face_is_that_of_its_joints_error(skin):
    # At this rate, every frame shows a sample.
    made = made_of(dancing_clip(rate=48.0, skin=skin))
    scene = build_body_scene(made, SETTINGS)
    materials = bpy.data.objects["lerp_slerp figure"].data.materials
    full = float(materials[SHADE_COUNT - 1].name.split()[1]) * 1e-3
    for mode in TWO:
        for frame in (1, 4, 9, 15):
            scene.frame_set(frame)
            expected = errors_at(made, mode, frame) / full * SHADE_COUNT
            rest_body = bpy.data.objects[f"{mode} figure"].evaluated_get(bpy.context.evaluated_depsgraph_get())
            bones = [face.value for face in rest_body.data.attributes[BONE].data]
            assert set(bones) == set(range(len(JOINTS)))
            for bone, face in zip(bones, rest_body.data.polygons, strict=True):
                assert face.material_index == pytest.approx(min(max(expected[bone] - 0.5, 0), SHADE_COUNT - 1), abs=0.6)


def instances_of(name: str) -> list[np.ndarray]:
    """Return the positions of the instances of an object."""
    return [
        np.array(instance.matrix_world.translation)
        for instance in bpy.context.evaluated_depsgraph_get().object_instances
        if instance.is_instance and instance.parent.name == name
    ]


def in_picture(scene: bpy.types.Scene, place: np.ndarray) -> np.ndarray:
    return np.array(world_to_camera_view(scene, scene.camera, Vector(place)))[:2]


def test_joints_flash_at_their_keys_and_the_worst_has_the_ring():
    made = made_of(dancing_clip(still=[1], rate=48.0))
    scene = build_body_scene(made, SETTINGS)
    frames = timeline_of(made).frames_of(made.clip.times[made.keys["lerp_slerp"][0]])
    scene.frame_set(int(frames[1]))
    assert len(instances_of("lerp_slerp keys")) == len(JOINTS) - 1
    between = int(frames[2]) - 1
    scene.frame_set(between)
    assert not instances_of("lerp_slerp keys")
    (ring,) = instances_of("lerp_slerp worst joint")
    worst = int(errors_at(made, "lerp_slerp", between).argmax())
    rig = bpy.data.objects["lerp_slerp"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    joint = np.array(rig.matrix_world @ rig.pose.bones[JOINTS[worst]].head)
    # The ring is nearer to the camera, at the same place in the picture.
    assert np.abs(in_picture(scene, ring) - in_picture(scene, joint)).max() < 1e-4
    assert np.linalg.norm(ring - joint) > 0.1


def test_a_skin_is_carried_as_linear_blending_does():
    made = made_of(dancing_clip(skin=True, axes="opengl", metres_per_unit=0.01))
    clip = made.clip
    scene = build_body_scene(made, SETTINGS)
    scene.frame_set(9)
    centre = np.array(scene["recording_centre_m"])
    time = timeline_of(made).times_of(np.array([9.0]))
    skin = clip.rest_body.skin
    shown = made.shown("lerp_slerp", time)[:, 0]
    rest = clip.in_metres(clip.rest_body.rest)
    turns, still = (Rotation.from_quat(some.quaternions, scalar_first=True).as_matrix() for some in (shown, rest))
    vertices = skin.vertices * clip.metres_per_unit
    expected = np.zeros_like(vertices)
    for column in range(4):
        bones = skin.joints[:, column]
        arms = np.einsum("vba,vb->va", still[bones], vertices - rest.positions[bones])
        moved = np.einsum("vab,vb->va", turns[bones], arms) + shown.positions[bones]
        expected += skin.weights[:, column, None] * moved
    expected = expected @ np.array(((1, 0, 0), (0, 0, -1), (0, 1, 0))).T - centre
    rest_body = bpy.data.objects["lerp_slerp figure"].evaluated_get(bpy.context.evaluated_depsgraph_get())
    result = np.array([vertex.co for vertex in rest_body.data.vertices])
    assert np.abs(result - expected).max() < 1e-4


def test_hostile_names_of_joints_are_names_of_bones():
    clip = dancing_clip()
    names = ("a" * 300, "a" * 299, 'quo"te\\', "['x']", "", "Kopf\n<b>\u00e4")
    made = made_of(dataclasses.replace(clip, rest_body=dataclasses.replace(clip.rest_body, joints=names)))
    assert_played(made, build_body_scene(made, SETTINGS), TWO)


@pytest.mark.parametrize(("walked", "modes"), [(0.0, tuple(KEYFRAME_MODES)), (12.0, TWO)], ids=["all", "two walk"])
def test_bodies_stay_within_their_cards(walked, modes):
    made = made_of(dancing_clip(walked=walked), modes)
    scene = build_body_scene(made, SETTINGS)
    for frame in range(1, scene.frame_end + 1, 8):
        scene.frame_set(frame)
        depsgraph = bpy.context.evaluated_depsgraph_get()
        for mode in modes:
            card = bpy.data.objects[f"{mode} card"]
            corners = np.array([in_picture(scene, card.matrix_world @ vertex.co) for vertex in card.data.vertices])
            for name in (f"{mode} figure", f"{mode} recording figure"):
                rest_body = bpy.data.objects[name].evaluated_get(depsgraph)
                points = np.array([in_picture(scene, rest_body.matrix_world @ v.co) for v in rest_body.data.vertices])
                assert (points >= corners.min(axis=0)).all()
                assert (points <= corners.max(axis=0)).all()
