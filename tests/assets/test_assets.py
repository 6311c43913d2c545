"""The assets are what their script makes, and what they claim to be."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from scipy.interpolate import BPoly
from scipy.signal import find_peaks, savgol_filter
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from assets import make_assets
from research.making.drill import drill
from research.making.motions import (
    BACK,
    CENTRE_OF_MASS,
    FOREARM,
    GRAVITY,
    HAND,
    MOTIONS,
    PITCH,
    SHOULDER,
    SITE,
    THERE,
    TIP,
    UPPER_ARM,
    Knot,
    Throw,
    Y,
    arm,
    strokes,
    through,
)
from research.making.shells import corner_normals, loft, oval, volume
from research.making.tracking import tick, wander
from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import angle_between, rotate

ASSETS = Path(make_assets.__file__).parent


def recorded(name: str) -> tuple[np.ndarray, Poses]:
    t, x, y, z, qx, qy, qz, qw = np.loadtxt(ASSETS / f"{name}.csv", delimiter=",", skiprows=1).T
    return t, Poses(np.stack((x, y, z), axis=1), np.stack((qw, qx, qy, qz), axis=1))


def place_of(point: ArrayLike, poses: Poses) -> np.ndarray:
    return poses.positions + rotate(poses.quaternions, np.broadcast_to(point, poses.positions.shape))


# ---- clips -----------------------------------------------------------------------------------------------------------


def test_the_folder_holds_the_clips_that_the_script_makes_and_no_other_table():
    assert {path.stem for path in ASSETS.glob("*.csv")} == set(MOTIONS)


@pytest.mark.parametrize("name", MOTIONS)
def test_the_script_makes_the_kept_clip_again(name):
    assert make_assets.clip(name) == (ASSETS / f"{name}.csv").read_text(encoding="utf-8")


def test_the_script_writes_whole_files_and_leaves_nothing_else(tmp_path, capsys):
    make_assets.main(["--output", str(tmp_path / "new")])
    written = {path.name for path in (tmp_path / "new").iterdir()}
    assert written - {"models.blend"} == {f"{name}.csv" for name in MOTIONS}
    for name in MOTIONS:
        assert (tmp_path / "new" / f"{name}.csv").read_bytes() == make_assets.clip(name).encode()
    assert "models.blend" in capsys.readouterr().out


def test_a_failure_while_writing_leaves_the_old_file_whole(tmp_path):
    old = tmp_path / "clip.csv"
    old.write_text("old", encoding="utf-8")

    def fail(path: Path) -> None:
        path.write_text("half", encoding="utf-8")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        make_assets.write(old, fail)
    assert old.read_text(encoding="utf-8") == "old"
    assert list(tmp_path.iterdir()) == [old]


@pytest.mark.parametrize("name", MOTIONS)
def test_a_clip_has_the_timer_of_a_90_hz_device(name):
    times, _ = recorded(name)
    steps = np.diff(times)
    assert times[0] == 0.0
    assert 4.0 <= times[-1] <= 5.0
    assert np.median(steps) == pytest.approx(1.0 / 90.0, abs=2e-4)
    assert steps.min() >= 0.007 - 1e-6
    assert steps.max() <= 0.017 + 1e-6
    assert 0.8e-3 < steps.std() < 2e-3
    assert np.mean(steps > 0.0125) > 0.02


@pytest.mark.parametrize("name", MOTIONS)
def test_a_clip_has_unit_quaternions_without_sign_flips(name):
    _, poses = recorded(name)
    np.testing.assert_allclose(np.linalg.norm(poses.quaternions, axis=1), 1.0, atol=2e-6)
    assert np.einsum("ni,ni->n", poses.quaternions[1:], poses.quaternions[:-1]).min() > 0.9


@pytest.mark.parametrize("name", MOTIONS)
def test_a_clip_is_as_noisy_as_a_tracked_controller_and_no_noisier(name):
    times, poses = recorded(name)
    ideal = MOTIONS[name].poses(np.random.default_rng(1), times)
    # What a cubic through the neighbours misses is mostly noise that is new with every frame: fourth differences.
    still = np.linalg.norm(np.gradient(ideal.positions, times, axis=0), axis=1)[2:-2] < 0.1
    noise = np.diff(poses.positions, n=4, axis=0)[still] / np.sqrt(70.0)
    assert still.sum() > 30
    assert 0.04e-3 < np.sqrt(np.mean(noise**2)) < 0.25e-3


@pytest.mark.parametrize("name", MOTIONS)
def test_a_clip_moves_at_the_speeds_of_hands(name):
    times, poses = recorded(name)
    speeds = np.linalg.norm(np.diff(poses.positions, axis=0), axis=1) / np.diff(times)
    rates = np.degrees(angle_between(poses.quaternions[:-1], poses.quaternions[1:])) / np.diff(times)
    assert 0.4 < speeds.max() < 4.0
    assert 150.0 < rates.max() < 800.0


def test_the_reach_is_five_strokes_each_with_one_peak_of_speed():
    times, poses = recorded("reach")
    even = np.arange(0.0, times[-1], 1.0 / 90.0)
    smooth = savgol_filter(
        np.stack([np.interp(even, times, axis) for axis in poses.positions.T], axis=1), 21, 3, axis=0
    )
    speeds = np.linalg.norm(np.gradient(smooth, even, axis=0), axis=1)
    peaks, _ = find_peaks(speeds, prominence=0.15)
    assert len(peaks) == 5
    valleys = [speeds[a:b].min() for a, b in pairwise(peaks)]
    assert max(valleys) < 0.2


def test_the_pivot_keeps_its_tip_in_place_while_the_handle_moves():
    _, poses = recorded("pivot")
    tip = place_of(TIP, poses)
    assert np.linalg.norm(tip - SITE, axis=1).max() < 3e-3
    assert np.ptp(poses.positions, axis=0).max() > 0.15


@pytest.mark.parametrize("way", [THERE, BACK], ids=["there", "back"])
def test_the_thrown_tool_falls_freely_and_turns_evenly(way: Throw):
    times, poses = recorded("throw")
    _, release, catch, _ = way.moments
    flying = (times > release) & (times < catch)
    fit = np.polynomial.polynomial.polyfit(times[flying] - release, place_of(CENTRE_OF_MASS, poses)[flying], 2)
    np.testing.assert_allclose(2.0 * fit[2], GRAVITY, atol=0.15)

    turned = Rotation.from_quat(poses.quaternions[flying][:, [1, 2, 3, 0]])
    rates = (turned[1:] * turned[:-1].inv()).as_rotvec() / np.diff(times[flying])[:, None]
    even = np.radians(way.angles[2] - way.angles[1]) / (catch - release) * way.axis
    np.testing.assert_allclose(rates.mean(axis=0), even, atol=0.05)
    assert np.linalg.norm(rates - even, axis=1).max() < 0.15 * np.linalg.norm(even)
    assert 1.0 <= np.linalg.norm(even) * (catch - release) / (2.0 * np.pi) <= 2.0


@pytest.mark.parametrize("way", [THERE, BACK], ids=["there", "back"])
def test_the_hands_meet_the_flight_in_place_velocity_and_acceleration(way: Throw):
    step = 1e-4
    for knots in (way.path(), way.turning()):
        for moment in way.moments[1:3]:
            before, after = (
                through(knots, moment + step * np.arange(-4, 1)),
                through(knots, moment + step * np.arange(5)),
            )
            np.testing.assert_array_equal(before[-1], after[0])
            for order, tolerance in ((1, 0.02), (2, 0.5)):
                left = np.diff(before, n=order, axis=0)[-1] / step**order
                right = np.diff(after, n=order, axis=0)[0] / step**order
                np.testing.assert_allclose(left, right, atol=tolerance)


def test_the_screw_advances_by_its_pitch_with_every_turn():
    _, poses = recorded("screw")
    tip = place_of(TIP, poses)
    # The side of the tool goes round the line of the bit.
    start = poses.quaternions[:1]
    side = rotate(poses.quaternions, np.broadcast_to((1.0, 0.0, 0.0), tip.shape))
    right, forward, up = (rotate(start, np.eye(3)[axis][None])[0] for axis in range(3))
    turns = np.unwrap(np.arctan2(-side @ up, side @ right)) / (2.0 * np.pi)
    assert 2.0 < turns[-1] - turns[0] < 2.3
    advance = (tip - tip[0]) @ forward
    assert advance[-1] == pytest.approx(PITCH * (turns[-1] - turns[0]), abs=1e-3)
    assert np.polyfit(turns, advance, 1)[0] == pytest.approx(PITCH, rel=0.15)


# ---- what clips are made of ------------------------------------------------------------------------------------------


def test_a_stroke_is_the_minimum_jerk_quintic():
    times = np.linspace(-0.5, 2.0, 101)
    quintic = BPoly.from_derivatives([0.2, 1.1], [[0.0, 0.0, 0.0], [3.0, 0.0, 0.0]])(np.clip(times, 0.2, 1.1))
    np.testing.assert_allclose(strokes(times, [0.2], [0.9], [3.0]), quintic, atol=1e-13)


def test_overlapping_strokes_add_up():
    times = np.linspace(0.0, 2.0, 101)
    both = strokes(times, [[0.1], [0.4]], [[0.8], [1.0]], [[1.0, 2.0], [-0.5, 0.5]])
    each = [strokes(times, [[a]], [[d]], [m]) for a, d, m in ((0.1, 0.8, [1.0, 2.0]), (0.4, 1.0, [-0.5, 0.5]))]
    np.testing.assert_allclose(both, sum(each), atol=1e-15)


def test_a_motion_through_knots_is_scipys_quintic_through_the_same_derivatives():
    rng = np.random.default_rng(3)
    moments = np.cumsum(rng.uniform(0.2, 0.8, 5))
    states = rng.normal(size=(5, 3, 2))
    times = np.linspace(moments[0], moments[-1], 200)
    knots = [Knot(t, *state) for t, state in zip(moments, states, strict=True)]
    np.testing.assert_allclose(through(knots, times), BPoly.from_derivatives(moments, states)(times), atol=1e-11)


def test_the_arm_is_a_chain_of_rigid_bones():
    angles = np.random.default_rng(4).uniform(-1.5, 1.5, (200, 7))
    poses = arm(angles)
    upper = Rotation.from_euler("ZXZ", angles[:, :3])
    fore = upper * Rotation.from_euler("X", angles[:, 3:4])
    hand = fore * Rotation.from_euler("ZXY", angles[:, 4:])
    down = (0.0, 0.0, -1.0)
    grip = SHOULDER + UPPER_ARM * upper.apply(down) + FOREARM * fore.apply(down) + HAND * hand.apply(down)
    np.testing.assert_allclose(poses.positions, grip, atol=1e-13)
    forward = rotate(poses.quaternions, np.broadcast_to(Y, grip.shape))
    np.testing.assert_allclose(forward, hand.apply(down), atol=1e-13)


def test_noise_has_the_power_and_the_band_that_were_asked_for():
    times = np.arange(0.0, 60.0, 1.0 / 90.0)
    noise = wander(np.random.default_rng(5), times, 8, (8.0, 12.0))
    assert np.sqrt(np.mean(noise**2)) == pytest.approx(1.0, abs=0.1)
    power = np.abs(np.fft.rfft(noise, axis=0)) ** 2
    frequencies = np.fft.rfftfreq(len(times), 1.0 / 90.0)
    inside = (frequencies > 7.9) & (frequencies < 12.1)
    assert power[inside].sum() / power.sum() > 0.98


def test_the_timer_never_strays_beyond_its_bounds():
    steps = np.diff(tick(np.random.default_rng(6), 300.0))
    assert 0.007 - 1e-9 <= steps.min() < 0.0085
    assert 0.016 < steps.max() <= 0.017 + 1e-9


# ---- what models are made of -----------------------------------------------------------------------------------------


def test_a_loft_is_closed_and_looks_outward_whichever_way_its_rings_run():
    rings = np.stack([oval((0.0, y, 0.0), (2.0, 0.0, 0.0), (0.0, 0.0, 1.0), points=200) for y in (0.0, 1.0, 3.0)])
    for solid in (loft(rings, "Mode"), loft(rings[::-1], "Mode")):
        assert volume(solid) == pytest.approx(3.0 * 2.0 * np.pi, rel=1e-3)
        assert_closed(solid.faces)


def test_corners_are_flat_on_a_flat_face_smooth_on_a_round_one_and_sharp_between_them():
    rod = loft([oval((0.0, 0.0, z), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), points=32) for z in (0.0, 5.0)], "Metal")
    normals = corner_normals(rod)
    corners = np.concatenate(rod.faces)
    sides, ends = np.split(np.arange(len(corners)), [4 * 32])
    radial = rod.vertices[corners] * (1.0, 1.0, 0.0)
    np.testing.assert_allclose(normals[sides], radial[sides], atol=1e-12)
    np.testing.assert_allclose(np.abs(normals[ends]), np.broadcast_to((0.0, 0.0, 1.0), (64, 3)), atol=1e-12)


def test_the_bit_of_the_drill_ends_where_the_clips_have_the_tip():
    foremost = drill().vertices
    foremost = foremost[foremost[:, 1] > foremost[:, 1].max() - 1e-6]
    np.testing.assert_allclose(foremost.mean(axis=0), 1e3 * TIP, atol=1e-9)


def assert_closed(faces: list[tuple[int, ...]]) -> None:
    """Each edge is run along once in each direction."""
    edges = [edge for face in faces for edge in zip(face, (*face[1:], face[0]), strict=True)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)


# ---- models ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def models():
    """The objects of the kept file and those made anew: {name: (kept, made)}."""
    bpy = pytest.importorskip("bpy")
    from research.making.library import MODELS, build_models

    kinds = ("objects", "meshes", "materials")
    before = {kind: set(getattr(bpy.data, kind)) for kind in kinds}
    made = build_models()
    with bpy.data.libraries.load(str(ASSETS / "models.blend")) as (source, target):
        assert sorted(source.objects) == sorted(source.scenes) == sorted(MODELS)
        target.objects = list(MODELS)
    yield dict(zip(MODELS, zip(target.objects, made, strict=True), strict=True))
    bpy.data.batch_remove([data for kind in kinds for data in set(getattr(bpy.data, kind)) - before[kind]])


def each_model(test):
    return pytest.mark.parametrize("name", ["Drill", "Controller"])(test)


def vertices_of(model) -> np.ndarray:
    return np.array([vertex.co[:] for vertex in model.data.vertices])


def faces_of(model) -> list[tuple[int, ...]]:
    return [tuple(polygon.vertices) for polygon in model.data.polygons]


def material_names(model) -> list[str]:
    return [slot.material.name.split(".")[0] for slot in model.material_slots]


def face_materials(model) -> list[str]:
    return [material_names(model)[polygon.material_index] for polygon in model.data.polygons]


def test_the_file_of_the_models_is_small():
    assert (ASSETS / "models.blend").stat().st_size < 300_000


@each_model
def test_the_script_makes_the_kept_model_again(models, name):
    kept, made = models[name]
    np.testing.assert_allclose(vertices_of(kept), vertices_of(made), atol=1e-7)
    assert faces_of(kept) == faces_of(made)
    assert face_materials(kept) == face_materials(made)
    kept_normals, made_normals = (
        np.array([corner.vector[:] for corner in m.data.corner_normals]) for m in (kept, made)
    )
    np.testing.assert_allclose(kept_normals, made_normals, atol=1e-3)


@each_model
def test_the_kept_materials_have_their_colours_in_the_viewport_and_in_the_nodes(models, name):
    from research.making.library import MATERIALS

    kept, _ = models[name]
    assert sorted(material_names(kept)) == sorted(MATERIALS)
    for slot, wanted in zip(kept.material_slots, material_names(kept), strict=True):
        colour, metallic, roughness = MATERIALS[wanted]
        surface = slot.material.node_tree.nodes["Principled BSDF"]
        assert surface.outputs["BSDF"].is_linked
        np.testing.assert_allclose(slot.material.diffuse_color[:3], colour, atol=1e-6)
        np.testing.assert_allclose(surface.inputs["Base Color"].default_value[:3], colour, atol=1e-6)
        for where in (slot.material.metallic, surface.inputs["Metallic"].default_value):
            assert where == pytest.approx(metallic)
        for where in (slot.material.roughness, surface.inputs["Roughness"].default_value):
            assert where == pytest.approx(roughness)


@each_model
def test_the_tinted_material_is_the_largest_part_of_the_surface(models, name):
    kept, _ = models[name]
    areas = dict.fromkeys(material_names(kept), 0.0)
    for polygon, material in zip(kept.data.polygons, face_materials(kept), strict=True):
        areas[material] += polygon.area
    assert material_names(kept).count("Mode") == 1
    assert areas["Mode"] == max(areas.values())


@each_model
def test_a_model_is_of_closed_shells_that_look_outward(models, name):
    kept, _ = models[name]
    assert not kept.data.validate()
    faces, vertices = faces_of(kept), vertices_of(kept)
    assert_closed(faces)
    group = np.arange(len(vertices))
    while True:
        lowest = group.copy()
        for face in faces:
            lowest[list(face)] = lowest[list(face)].min()
        if (lowest == group).all():
            break
        group = lowest
    for shell in np.unique(group):
        inside = sum(
            np.linalg.det(vertices[[face[0], a, b]])
            for face in faces
            if group[face[0]] == shell
            for a, b in pairwise(face[1:])
        )
        assert inside > 0.0


@each_model
def test_the_shading_of_a_model_follows_its_faces(models, name):
    kept, _ = models[name]
    assert kept.data.has_custom_normals
    assert all(polygon.use_smooth for polygon in kept.data.polygons)
    for polygon in kept.data.polygons:
        for loop in polygon.loop_indices:
            assert kept.data.corner_normals[loop].vector.dot(polygon.normal) > 0.5


@each_model
def test_a_model_is_light_enough_for_a_dozen_in_one_picture(models, name):
    kept, _ = models[name]
    assert sum(len(face) - 2 for face in faces_of(kept)) < 6000


@pytest.mark.parametrize(("name", "length"), [("Drill", 0.22), ("Controller", 0.15)])
def test_a_model_has_its_true_size_is_held_at_its_origin_and_points_forward(models, name, length):
    kept, _ = models[name]
    low, high = vertices_of(kept).min(axis=0), vertices_of(kept).max(axis=0)
    assert np.argmax(high - low) == 1
    assert (high - low)[1] == pytest.approx(length, abs=0.01)
    assert (low < -0.01).all()
    assert (high > 0.01).all()
    np.testing.assert_array_equal(np.array(kept.matrix_world), np.eye(4))


@each_model
def test_no_mirroring_and_no_half_turn_brings_a_model_onto_itself(models, name):
    kept, _ = models[name]
    vertices = vertices_of(kept)
    middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
    tree = cKDTree(vertices)
    for signs in ((-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, 1), (-1, 1, -1), (1, -1, -1)):
        distances, _ = tree.query(middle + signs * (vertices - middle))
        assert distances.max() > 0.005, signs
