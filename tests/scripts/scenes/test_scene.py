import dataclasses
from collections.abc import Iterable

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector
from scipy.spatial.transform import Rotation

from rigid_motion.animation import channelbag_of
from rigid_motion.motion import KEYFRAME_MODES, Poses, interpolate
from rigid_motion.motion.quaternions import angle_between, conjugate, multiply, rotate
from rigid_motion_batch.analysis.choices import Tolerance
from rigid_motion_batch.analysis.held import Slip
from rigid_motion_batch.analysis.reconstructions import Reconstruction
from rigid_motion_batch.analysis.reconstructions import reconstruct as choose
from rigid_motion_batch.analysis.results import measured
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.scenes import layout
from rigid_motion_batch.scenes.findings import findings_of
from rigid_motion_batch.scenes.nodes import input_path
from rigid_motion_batch.scenes.scene import build_scene
from rigid_motion_batch.scenes.settings import SceneSettings
from rigid_motion_batch.scenes.subject import vertices_of
from rigid_motion_batch.scenes.timeline import Timeline
from tests.animation.oracle import shown_worlds
from tests.scripts.clips.recordings import reconstruct, swinging_clip
from tests.world_poses import read_poses

SETTINGS = SceneSettings(resolution=(160, 90), fps=12)
TWO = ("lerp_slerp", "dq_sclerp")


def changed(clip: Clip, scale: float | tuple[float, ...] = 1.0, offset: float = 0.0) -> Clip:
    return dataclasses.replace(clip, poses=Poses(clip.poses.positions * scale + offset, clip.poses.quaternions))


def evaluated_points(obj: bpy.types.Object) -> np.ndarray:
    """Return world positions of the object's vertices as drawn, instances included."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    points = [np.empty((0, 3))]
    for instance in depsgraph.object_instances:
        owner = instance.parent if instance.is_instance else instance.object
        if owner.name == obj.name and instance.object.type == "MESH":
            matrix = np.array(instance.matrix_world)
            points.append(vertices_of(instance.object.data) @ matrix[:3, :3].T + matrix[:3, 3])
    return np.concatenate(points)


def poses_on(frames: np.ndarray, names: Iterable[str]) -> dict[str, Poses]:
    """Return world poses of several objects, stepping through the frames only once."""
    names = list(names)
    worlds = shown_worlds([bpy.data.objects[name] for name in names], frames)
    turns = [Rotation.from_matrix(world[:, :3, :3]).as_quat(scalar_first=True) for world in worlds]
    return {name: Poses(world[:, :3, 3], turn) for name, world, turn in zip(names, worlds, turns, strict=True)}


def timeline_of(made: Reconstruction) -> Timeline:
    return Timeline.between(float(made.times[0]), float(made.times[-1]), SETTINGS.fps, 1.0)


@pytest.mark.parametrize("axes", ["blender", "unity"])
def test_every_mode_is_played_on_every_frame_as_it_was_computed(axes):
    clip = dataclasses.replace(changed(swinging_clip(seconds=1.0), offset=300.0), axes=axes)
    reconstruction = reconstruct(clip, "5")
    scene = build_scene(reconstruction, SETTINGS)
    timeline = timeline_of(reconstruction)
    times = timeline.times_of(timeline.frames)
    centre = np.array(scene["recording_centre_m"])
    results_of = poses_on(
        timeline.frames, [name for mode in KEYFRAME_MODES for name in (f"Lane {mode}", mode, f"{mode} recording")]
    )
    for mode in KEYFRAME_MODES:
        turn = np.array(bpy.data.objects[f"Lane {mode}"].matrix_world.to_quaternion())
        behind = np.array(bpy.data.objects[f"{mode} recording"].delta_location)
        assert rotate(turn, behind) @ layout.AWAY_AXIS == pytest.approx(np.linalg.norm(behind))
        places = results_of[f"Lane {mode}"].positions
        kept = reconstruction.keys[mode][0]
        shown = {
            mode: interpolate(clip.times[kept], clip.poses[kept], times, mode),
            f"{mode} recording": interpolate(clip.times, clip.poses, times, "dq_sclerp"),
        }
        for name, poses in shown.items():
            result = results_of[name]
            expected = to_blender(poses, axes)
            at_home = Poses(
                rotate(conjugate(turn), result.positions - places) + centre - behind * (name != mode),
                multiply(conjugate(turn), result.quaternions),
            )
            assert np.abs(at_home.positions - expected.positions).max() < 1e-5
            assert angle_between(at_home.quaternions, expected.quaternions).max() < 4e-5


@pytest.mark.parametrize(
    ("size", "offset", "modes"),
    [(1e3, 0.0, TWO), ((0.0, 0.0, 3.0), 0.0, TWO), (0.0, 5.0, TWO), (1.0, 1e4, tuple(KEYFRAME_MODES))],
    ids=["a kilometre", "up and down", "on the spot", "far away"],
)
def test_everything_that_moves_stays_within_its_own_card(size, offset, modes):
    scene = build_scene(reconstruct(changed(swinging_clip(seconds=1.0), size, offset), "5", modes), SETTINGS)
    aspect = SETTINGS.resolution[0] / SETTINGS.resolution[1]
    deviating = {mode: f"{mode} deviating" for mode in modes if f"{mode} deviating" in bpy.data.objects}
    moving = {mode: (deviating.get(mode, mode), f"{mode} recording") for mode in modes}
    meshes = {bpy.data.objects[name].data for names in moving.values() for name in names}
    outermost = {mesh: layout.outermost(vertices_of(mesh)) for mesh in meshes}
    for frame in range(1, scene.frame_end + 1, 4):
        scene.frame_set(frame)
        for mode in modes:
            card = bpy.data.objects[f"{mode} card"]
            size = card.data.vertices
            half = np.abs([vertex.co[:2] for vertex in size]).max(axis=0)
            for name in moving[mode]:
                obj = bpy.data.objects[name]
                world = np.array(obj.matrix_world)
                points = outermost[obj.data] @ world[:3, :3].T + world[:3, 3]
                if "Cut" in obj.modifiers:
                    points = evaluated_points(obj)[::10]
                seen = np.array([world_to_camera_view(scene, scene.camera, Vector(point)) for point in points])
                seen = seen.reshape(-1, 3)  # A completely cut object leaves nothing.
                places = (seen[:, :2] - 0.5) * (aspect, 1.0) - np.array(card.location[:2])
                assert (np.abs(places) < half).all()
                assert (seen[:, 2] > scene.camera.data.clip_start).all()
                assert (seen[:, 2] < scene.camera.data.clip_end).all()


def test_everything_that_is_written_is_within_the_picture():
    clip = dataclasses.replace(swinging_clip(seconds=0.6), name="a_recording_with_quite_a_long_name_" * 3)
    scene = build_scene(reconstruct(clip, "7.5"), SETTINGS)
    for obj in bpy.data.objects["Frame"].children:
        corners = evaluated_points(obj) if obj.type == "MESH" else [obj.matrix_world @ Vector(c) for c in obj.bound_box]
        assert len(corners)
        for corner in corners:
            x, y, depth = world_to_camera_view(scene, scene.camera, Vector(corner))
            assert -1e-6 <= x <= 1 + 1e-6, obj.name
            assert -1e-6 <= y <= 1 + 1e-6, obj.name
            assert scene.camera.data.clip_start < depth < scene.camera.data.clip_end


def test_the_number_shows_the_error_of_the_frame_and_the_graph_has_passed_so_far():
    reconstruction = reconstruct(swinging_clip(seconds=1.0), "5", TWO)
    scene = build_scene(reconstruction, SETTINGS)
    timeline = timeline_of(reconstruction)
    times = timeline.times_of(timeline.frames)
    for mode in TWO:
        number, graph = bpy.data.objects[f"{mode} error"], bpy.data.objects[f"{mode} graph"]
        written = channelbag_of(number).fcurves.find(input_path(number.modifiers[0], "Value"), index=0)
        errors = 1e3 * np.interp(times, reconstruction.times, reconstruction.shell(mode)[0])
        right = vertices_of(graph.data)[:, 0]
        drawn = []
        for frame, error in enumerate(errors, start=1):
            scene.frame_set(frame)
            assert written.evaluate(frame) == pytest.approx(error, abs=1e-4)
            drawn.append(evaluated_points(number))
            inside = np.array(graph.matrix_world.inverted())
            passed = (evaluated_points(graph) @ inside[:3, :3].T + inside[:3, 3])[:, 0].max(initial=0.0)
            now = right.max() * (frame - 1) / ((reconstruction.times[-1] - times[0]) * timeline.rate)
            assert passed <= now + 1e-5
            assert not np.any((right > passed + 1e-5) & (right < now - 1e-5))
        assert all(len(points) for points in drawn)
        assert any(len(points) != len(drawn[0]) for points in drawn)


def test_what_was_found_is_written_into_the_lanes_with_what_it_is_above_them():
    made = reconstruct(swinging_clip(seconds=0.6), "5", TWO)
    slipped = [Slip("hand", "swing", mode, "5", 0.001, metres, 0.002, "uniform", None) for mode, metres in
               (("lerp_slerp", 0.0123), ("dq_sclerp", 0.0015))]  # fmt: skip
    rows = [dataclasses.replace(row, still_point_m=0.25) for row in measured(made).rows]
    findings = findings_of(rows, slipped)
    build_scene(made, SETTINGS, findings)
    lines = {mode: [bpy.data.curves[f"{mode} finding {place}"].body for place in (2, 1)] for mode in TWO}
    assert lines == {
        "lerp_slerp": ["slips up to 12.3 mm", "pivot up to 250.0 mm off"],
        "dq_sclerp": ["slips up to 1.5 mm", "pivot up to 250.0 mm off"],
    }
    assert "in hand, which holds it; 2.00 mm in the recording" in bpy.data.curves["Findings"].body
    bpy.context.view_layer.update()
    for name in [f"{mode} finding {place}" for mode in TWO for place in (1, 2)]:
        words, card = bpy.data.objects[name], bpy.data.objects[f"{name.split()[0]} card"]
        right = max(corner[0] for corner in words.bound_box)
        assert words.location.x + right - card.location.x < max(vertex.co.x for vertex in card.data.vertices)
    assert bpy.data.objects["dq_sclerp finding 1"].location.y > bpy.data.objects["dq_sclerp error"].location.y


def test_a_pivot_has_a_cross_where_it_was_and_one_where_the_mode_has_it_as_far_off_as_it_is_measured():
    (clip,), _ = read_clips([str(ASSETS / "pivot.csv")], "blender")
    made = reconstruct(clip, "5", ("bezier", "dq_sclerp"))
    rows = measured(made).rows
    scene = build_scene(made, dataclasses.replace(SETTINGS, deviation=1.0), findings_of(rows))
    assert "crosses: pivot" in bpy.data.curves["Legend"].body
    names = [f"{mode}{pivot}" for mode in ("bezier", "dq_sclerp") for pivot in (" recording pivot", " pivot")]
    places = poses_on(np.arange(1, scene.frame_end + 1), names)
    for row in rows:
        recorded, shown = (places[f"{row.mode}{pivot}"].positions for pivot in (" recording pivot", " pivot"))
        off = layout.project(shown - recorded)[:, :2]
        assert 0.4 * row.still_point_m < np.linalg.norm(off, axis=1).max() < 1.01 * row.still_point_m
        assert np.ptp(layout.project(recorded)[:, :2], axis=0).max() < 0.02
        facing = rotate(places[f"{row.mode} pivot"].quaternions, np.array((0.0, 0.0, 1.0)))
        assert facing @ layout.AWAY_AXIS == pytest.approx(-1.0)
    build_scene(reconstruct(swinging_clip(seconds=0.6), "5", TWO), SETTINGS, findings_of(rows))
    assert "crosses" not in bpy.data.curves["Legend"].body


def test_adaptive_keys_are_marked_in_the_lane_of_the_mode_they_are_of_and_counted_in_its_caption():
    reconstruction = choose(swinging_clip(seconds=1.0), Tolerance("5mm"), ("lerp_slerp", "motor_spline"), 0.1)
    scene = build_scene(reconstruction, SETTINGS)
    assert scene.name == "swing tolerance-5mm"
    assert bpy.data.curves["Choice of keys"].body == "within 5 mm"
    timeline = timeline_of(reconstruction)
    assert len(reconstruction.keys["motor_spline"][0]) < len(reconstruction.keys["lerp_slerp"][0])
    for mode, (keys,) in reconstruction.keys.items():
        marks = bpy.data.objects[f"{mode} keys"].data
        frames = np.empty(len(marks.vertices), dtype=np.float32)
        marks.attributes["frame"].data.foreach_get("value", frames)
        assert np.allclose(frames, timeline.frames_of(reconstruction.clip.times[keys]), atol=1e-4)
        caption = " ".join(bpy.data.curves[f"{mode} names"].body.split())
        engines = ", as most game engines do" if mode == "lerp_slerp" else ""
        assert caption == f"{(len(keys) - 1) / 1.0:.1f} keys/s{engines}"


def test_modes_that_are_one_motion_share_a_lane_that_names_them_all():
    made = reconstruct(swinging_clip(seconds=1.0), "5")
    scene = build_scene(made, dataclasses.replace(SETTINGS, distinct=True))
    lanes = [child.name for child in scene.collection.children if child.name.startswith("Lane ")]
    assert lanes == ["Lane lerp_slerp", "Lane dq_sclerp", "Lane pga_lerp", "Lane motor_spline"]
    assert bpy.data.curves["dq_sclerp title"].body == "Screw"
    assert bpy.data.curves["dq_sclerp names"].body == "= Motor Screw, Spiral"


def test_a_deviation_of_millimetres_is_drawn_larger_and_the_picture_says_how_much():
    clip = swinging_clip(seconds=1.0)
    settings = dataclasses.replace(SETTINGS, deviation=20.0)
    made = reconstruct(clip, "10", TWO)
    scene = build_scene(made, settings)
    assert scene["deviation_shown_times"] == 20.0
    assert "20 times as far off as it is" in bpy.data.curves["Legend"].body
    for mode in TWO:
        true, shown, truth = (bpy.data.objects[name] for name in (mode, f"{mode} deviating", f"{mode} recording"))
        assert true.hide_render
        assert not shown.hide_render
        true.hide_viewport = False
        bpy.context.view_layer.update()
        frames = np.arange(1.0, scene.frame_end + 1.0)
        poses = [read_poses(obj, frames) for obj in (true, shown, truth)]
        middle = np.mean([vertices_of(true.data).min(axis=0), vertices_of(true.data).max(axis=0)], axis=0)
        places = [layout.swept_points(some, middle[None]) for some in poses]
        places[2] -= layout.AWAY_AXIS * truth.delta_location.length
        assert np.allclose(places[1] - places[2], 20.0 * (places[0] - places[2]), atol=1e-5)


def test_an_object_that_would_be_lost_on_its_path_is_shown_larger_and_says_so():
    build_scene(reconstruct(changed(swinging_clip(seconds=1.0), 100.0), "5", TWO), SETTINGS)
    assert "times its size" in bpy.data.curves["Legend"].body
    assert np.ptp(vertices_of(bpy.data.objects["dq_sclerp"].data), axis=0).max() > 0.5


def test_a_clip_shorter_than_a_frame_is_one_frame():
    scene = build_scene(reconstruct(swinging_clip(seconds=0.05), "30", TWO), SETTINGS)
    assert (scene.frame_start, scene.frame_end) == (1, 1)
    assert len(evaluated_points(bpy.data.objects["Time"]))
