"""The numbers of whole bodies once more, apart from the program: by 4x4 matrices, SciPy, and what Blender shows.

Other people's bodies are read here by a parser of its own, or frame by frame out of Blender; keys are filled in with
SciPy's Slerp and with logarithms of matrices; and every number of a body and of its joints has to be the program's.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation, Slerp

from rigid_motion_batch.analysis.bodies import reconstruct_body
from rigid_motion_batch.analysis.body_metrics import MeasuredBody, measure_modes
from rigid_motion_batch.analysis.choices import Choice, Tolerance, Uniform
from rigid_motion_batch.analysis.metrics import measure_reconstruction
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.hushing import hushed
from rigid_motion_batch.recordings.clip_reading import read_source
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.options import ReadingOptions
from tests.blank import blank
from tests.recordings import RECORDINGS
from tests.thoroughness import THOROUGH

bpy = pytest.importorskip("bpy")

RIGS = RECORDINGS.with_name("rigs")

pytestmark = [
    pytest.mark.recordings,
    pytest.mark.skipif(not RIGS.is_dir(), reason="the rigs are not beside the checkout"),
]

PLACES = {
    "cmu_01_01": RIGS / "cmu_01_01.bvh",
    "freebvh": RIGS / "freebvh.bvh",
    "beat_saber_body": RECORDINGS / "beat_saber_body.bvh",
    "pab_walk": RIGS / "pab_walk.fbx",
    "pab_run": RIGS / "pab_run.fbx",
}

METRES = {"cmu_01_01": 0.0254 / 0.45, "freebvh": 0.01, "beat_saber_body": 1.0, "pab_walk": 1.0, "pab_run": 1.0}
"""In a unit of each, as their authors say; Blender's importer has FBX in metres."""

MODES = ("lerp_slerp", "dq_sclerp")

WHOLE = ReadingOptions(start=0.0)
"""With the T-pose in front, which the others read as well."""

EXACT = 1e-9
"""Metres, radians, and metres a second."""


@dataclass(frozen=True)
class Body:
    """A recording, read without the program."""

    joints: list[str]
    parents: list[int]
    times: np.ndarray
    local: np.ndarray
    """Where joints are in their parents' space, in metres, shape (joints, n, 4, 4)."""

    up: int
    """The axis that points upwards."""


# -- reading ----------------------------------------------------------------------------------------------------------


def read_bvh(path: Path, metres: float) -> Body:
    head, _, motion = path.read_text(encoding="utf-8").partition("MOTION")
    words = iter(head.split())
    joints, parents, offsets, channels = [], [], [], []
    opened, name, in_end = [-1], "", False
    for word in words:
        match word:
            case "ROOT" | "JOINT":
                name, in_end = next(words), False
            case "End":
                in_end = next(words) == "Site"
            case "{":
                if not in_end:
                    parents.append(opened[-1])
                    joints.append(name)
                opened.append(-2 if in_end else len(joints) - 1)
            case "}":
                opened.pop()
                in_end = False
            case "OFFSET":
                offset = [float(next(words)) for _ in range(3)]
                if not in_end:
                    offsets.append(offset)
            case "CHANNELS":
                channels.append([next(words) for _ in range(int(next(words)))])
    _, frames, *rest = motion.split()
    frame_time = float(rest[2])
    values = np.array(rest[3:], dtype=float).reshape(int(frames), -1)
    local, column = np.zeros((len(joints), len(values), 4, 4)), 0
    for own, offset, named in zip(local, offsets, channels, strict=True):
        own[:] = np.eye(4)
        own[:, :3, 3] = offset
        for channel in named:
            number = values[:, column]
            column += 1
            if channel.endswith("position"):
                own[:, "XYZ".index(channel[0]), 3] = number
            else:
                turn = Rotation.from_rotvec(np.radians(number)[:, None] * np.eye(3)["XYZ".index(channel[0])])
                own[:, :3, :3] = own[:, :3, :3] @ turn.as_matrix()
        own[:, :3, 3] *= metres
    assert column == values.shape[1]
    return Body(joints, parents, np.arange(len(values)) * frame_time, local, up=1)


def frames_and_keys(rig: bpy.types.Object) -> np.ndarray:
    """Whole frames, and the keys that are farther than an eightieth of a frame from these and from one another."""
    first, last = map(round, rig.animation_data.action.frame_range)
    found = list(range(first, last + 1))
    keys = set()
    while rig:
        for layer in rig.animation_data.action.layers if rig.animation_data else ():
            bag = layer.strips[0].channelbag(rig.animation_data.action_slot)
            keys |= {point.co.x for fcurve in bag.fcurves for point in fcurve.keyframe_points}
        rig = rig.parent
    for key in sorted(keys):
        if min(abs(key - frame) for frame in found) >= 0.0125:
            found.append(key)
    return np.array(sorted(found), dtype=float)


def read_fbx(path: Path) -> Body:
    """What an armature shows on every frame and at every key, as Blender imports it by default."""
    blank()
    with hushed(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        bpy.ops.import_scene.fbx(filepath=str(path))
    (rig,) = (obj for obj in bpy.data.objects if obj.type == "ARMATURE")
    scene, bones = bpy.context.scene, list(rig.data.bones)
    frames = frames_and_keys(rig)
    seen = np.empty((len(bones), len(frames), 4, 4))
    for sample, frame in enumerate(frames.tolist()):
        scene.frame_set(int(frame // 1), subframe=frame % 1)
        there = np.array(rig.matrix_world, dtype=float)
        for number, bone in enumerate(bones):
            seen[number, sample] = there @ np.array(rig.pose.bones[bone.name].matrix, dtype=float)
    # A bone goes along its y axis; x is what is left of it across.
    axes, triangle = np.linalg.qr(seen[..., :3, [1, 0]])
    y, x = np.moveaxis(axes * np.sign(np.einsum("...ii->...i", triangle))[..., None, :], -1, 0)
    world = np.zeros_like(seen)
    world[..., 3, 3], world[..., :3, 3] = 1.0, seen[..., :3, 3]
    world[..., :3, :3] = np.stack([x, y, np.cross(x, y)], axis=-1)
    parents = [bones.index(bone.parent) if bone.parent else -1 for bone in bones]
    local = world.copy()
    for number, parent in enumerate(parents):
        if parent >= 0:
            local[number] = np.linalg.inv(world[parent]) @ world[number]
    rate = scene.render.fps / scene.render.fps_base
    names = [bone.name for bone in bones]
    blank()
    return Body(names, parents, (frames - frames[0]) / rate, local, up=2)


@pytest.fixture(scope="module")
def bodies() -> dict[str, Body]:
    """Read when they are wanted, and kept."""

    class Bodies(dict):
        def __missing__(self, name: str) -> Body:
            path = PLACES[name]
            self[name] = read_fbx(path) if path.suffix == ".fbx" else read_bvh(path, METRES[name])
            return self[name]

    return Bodies()


# -- filling in -------------------------------------------------------------------------------------------------------


def evenly(times: np.ndarray, rate: float) -> np.ndarray:
    """The sample nearest to every tick of a clock."""
    ticks = times[0] + np.arange(int((times[-1] - times[0]) * rate + 1e-9) + 1) / rate
    return np.unique([int(np.argmin(np.abs(times - tick))) for tick in ticks])


def stays(own: np.ndarray) -> bool:
    """Whether neither a place nor a quaternion of a joint (n, 4, 4) changes by more than a millionth."""
    quaternions = Rotation.from_matrix(own[:, :3, :3]).as_quat()
    quaternions *= np.where(quaternions @ quaternions[0] < 0.0, -1.0, 1.0)[:, None]
    return max(np.ptp(own[:, :3, 3], axis=0).max(), np.ptp(quaternions, axis=0).max()) <= 1e-6


def lerp_slerp(times: np.ndarray, keys: np.ndarray, at: np.ndarray) -> np.ndarray:
    found = np.tile(np.eye(4), (len(at), 1, 1))
    found[:, :3, :3] = Slerp(times, Rotation.from_matrix(keys[:, :3, :3]))(at).as_matrix()
    for axis in range(3):
        found[:, axis, 3] = np.interp(at, times, keys[:, axis, 3])
    return found


def dq_sclerp(times: np.ndarray, keys: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The screw from each key to the next, run through at one speed."""
    screws = np.array([np.real(logm(np.linalg.solve(a, b))) for a, b in pairwise(keys)])
    segment = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = (at - times[segment]) / np.diff(times)[segment]
    return keys[segment] @ expm(share[:, None, None] * screws[segment])


FILLED_IN = {"lerp_slerp": lerp_slerp, "dq_sclerp": dq_sclerp}


def in_world(local: np.ndarray, parents: list[int]) -> np.ndarray:
    world = local.copy()
    for joint, parent in enumerate(parents):
        if parent >= 0:
            world[joint] = world[parent] @ world[joint]
    return world


# -- measuring --------------------------------------------------------------------------------------------------------


def shell_errors(shown: np.ndarray, truth: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """How far the farthest point of each ball (joints,) moves between matrices (joints, n, 4, 4).

    A point p of the ball moves by d + M p, where d is what the middle moves by, and M the difference of the turns. M
    turns the ball into a disc: M M^T is c^2 times what takes a vector to its part in the plane of the disc, so that
    c^2 is half its trace, and |M^T d| is c times the part of d in that plane. The farthest point of a disc of radius
    r c is away by d across it, and by d along it and r c in one direction: d.d + 2 r |M^T d| + r^2 tr(M M^T) / 2.
    """
    apart, moved = (shown - truth)[..., :3, :3], (shown - truth)[..., :3, 3]
    r = radii[:, None]
    along = np.linalg.norm(np.einsum("...ij,...i->...j", apart, moved), axis=-1)
    return np.sqrt(np.sum(moved**2, axis=-1) + 2.0 * r * along + 0.5 * r**2 * np.sum(apart**2, axis=(-2, -1)))


def spans_on_the_ground(times: np.ndarray, places: np.ndarray, up: int) -> list[tuple[int, int, int]]:
    """Joint, first and last sample wherever a joint (joints, n, 3) is low and slow for a tenth of a second."""
    heights = places[..., up]
    height = np.median(heights.max(axis=0) - heights.min(axis=0))
    low = heights - heights.min() <= 0.12 * height
    found = []
    for joint, path in enumerate(places):
        slow = np.linalg.norm(path[1:] - path[:-1], axis=1) <= 0.06 * height * (times[1:] - times[:-1])
        rests = [
            low[joint, sample] and slow[max(sample - 1, 0)] and slow[min(sample, len(slow) - 1)]
            for sample in range(len(times))
        ]
        first = None
        for sample, rest in enumerate([*rests, False]):
            if rest and first is None:
                first = sample
            elif not rest and first is not None:
                if times[sample - 1] - times[first] >= 0.1:
                    found.append((joint, first, sample - 1))
                first = None
    return found


def slide_of(places: np.ndarray, spans: list[tuple[int, int, int]]) -> float:
    ways = [
        np.linalg.norm(places[joint, first : last + 1] - places[joint, first], axis=1) for joint, first, last in spans
    ]
    return max((float(way.max()) for way in ways), default=0.0)


def rms(values: np.ndarray, axis: int | None = None) -> np.ndarray:
    return np.sqrt(np.mean(values**2, axis=axis))


def assert_near(found: object, expected: object, what: str) -> None:
    assert np.abs(np.asarray(found) - np.asarray(expected)).max() <= EXACT, f"{what}: {found} and not {expected}"


def assert_measured_alike(measured: MeasuredBody, body: Body, mode: str, radii: np.ndarray) -> None:
    """All numbers of a mode: of the keys that the program has, everything else worked out here."""
    made = measured.made
    keys, (row,) = made.keys[mode], [row for row in measured.rows if row.mode == mode]
    rows = [one for one in measured.joints if one.mode == mode]
    moving = [own for own in keys if len(own) > 1]
    samples = slice(moving[0][0], moving[0][-1] + 1)
    times = body.times[samples]
    duration = times[-1] - times[0]

    shown = np.empty_like(body.local[:, samples])
    for joint, own in enumerate(keys):
        poses = body.local[joint, own]
        shown[joint] = poses[0] if len(own) == 1 else FILLED_IN[mode](body.times[own], poses, times)
    shown, truth = in_world(shown, body.parents), in_world(body.local, body.parents)[:, samples]
    shell = shell_errors(shown, truth, radii)
    away = (shown - truth)[..., :3, 3]
    position = np.linalg.norm(away, axis=-1)
    turns = np.swapaxes(truth[..., :3, :3], -1, -2) @ shown[..., :3, :3]
    rotation = Rotation.from_matrix(turns.reshape(-1, 3, 3)).magnitude().reshape(position.shape)
    velocity = np.linalg.norm(np.diff(away, axis=1), axis=-1) / np.diff(times)

    assert row.samples == len(times)
    assert (row.joints, row.keys) == (len(body.joints), sum(map(len, keys)))
    assert row.key_frames == len(set(np.concatenate(moving).tolist()))
    assert_near(row.duration_s, duration, "duration")
    sent = sum(len(own) - 1 for own in moving)
    assert row.keys_per_s == pytest.approx(sent / len(moving) / duration)
    assert row.bytes_per_s == pytest.approx(sent * 7 * 8 / duration)
    assert_near(row.rms_shell_m, rms(shell), "RMS")
    assert_near(row.p95_shell_m, np.quantile(shell, 0.95), "95 percent")
    assert_near(row.max_shell_m, shell.max(), "largest")
    assert row.worst_joint == body.joints[np.argmax(shell.max(axis=1))]
    assert_near(row.rms_position_m, rms(position), "position")
    assert_near(np.radians(row.rms_rotation_deg), rms(rotation), "rotation")
    assert_near(row.rms_velocity_m_s, rms(velocity), "velocity")

    spans = spans_on_the_ground(times, truth[..., :3, 3], body.up)
    assert (row.foot_slide_m is None) == (row.recorded_slide_m is None) == (not spans)
    if spans:
        assert_near(row.foot_slide_m, slide_of(shown[..., :3, 3], spans), "slide")
        assert_near(row.recorded_slide_m, slide_of(truth[..., :3, 3], spans), "slide of the recording")

    assert [one.joint for one in rows] == body.joints
    assert [one.keys for one in rows] == [len(own) for own in keys]
    assert_near([one.rms_shell_m for one in rows], rms(shell, axis=1), "RMS of joints")
    assert_near([one.p95_shell_m for one in rows], np.quantile(shell, 0.95, axis=1), "95 percent of joints")
    assert_near([one.max_shell_m for one in rows], shell.max(axis=1), "largest of joints")
    assert_near([one.rms_position_m for one in rows], rms(position, axis=1), "position of joints")
    assert_near(np.radians([one.rms_rotation_deg for one in rows]), rms(rotation, axis=1), "rotation of joints")
    assert_near([one.rms_velocity_m_s for one in rows], rms(velocity, axis=1), "velocity of joints")
    at = np.rint(np.interp([one.worst_s for one in rows], times - times[0], np.arange(len(times)))).astype(int)
    assert_near(shell[np.arange(len(rows)), at], shell.max(axis=1), "when joints are worst")


def measured_by_the_program(
    name: str, choice: Choice, modes: tuple[str, ...], *, shared: bool = False
) -> tuple[Clip, MeasuredBody, np.ndarray]:
    """As the program does it, with a ball of another size at every joint."""
    (clip,), _ = read_source(str(PLACES[name]), None, WHOLE)
    radii = np.linspace(0.02, 0.2, len(clip.figure.joints))
    made = reconstruct_body(clip, choice, modes, radii, shared=shared)
    return clip, measure_modes(made, radii), radii


# -- tests ------------------------------------------------------------------------------------------------------------


def test_no_point_of_a_ball_moves_further_than_the_formula_says_and_one_as_far() -> None:
    random = np.random.default_rng(3)
    shown, truth = (np.tile(np.eye(4), (20, 1, 1, 1)) for _ in range(2))
    for poses, size in ((shown, 0.1), (truth, 0.0)):
        poses[:, 0, :3, :3] = Rotation.from_rotvec(random.normal(size=(20, 3))).as_matrix()
        poses[:, 0, :3, 3] = size * random.normal(size=(20, 3))
    points = random.normal(size=(200_000, 3))
    points *= 0.07 / np.linalg.norm(points, axis=1, keepdims=True)
    ways = [(a - b)[0, :3, 3] + points @ (a - b)[0, :3, :3].T for a, b in zip(shown, truth, strict=True)]
    farthest = np.array([np.linalg.norm(way, axis=1).max() for way in ways])
    found = shell_errors(shown, truth, np.full(20, 0.07))[:, 0]
    assert (farthest <= found * (1.0 + 1e-12)).all()
    assert (farthest >= found * (1.0 - 1e-3)).all()


@pytest.mark.parametrize("name", PLACES)
def test_bodies_are_read_alike(bodies: dict[str, Body], name: str) -> None:
    (clip,), _ = read_source(str(PLACES[name]), None, WHOLE)
    body = bodies[name]
    assert clip.figure.joints == tuple(body.joints)
    assert clip.figure.parents.tolist() == body.parents
    assert clip.metres_per_unit == pytest.approx(METRES[name])
    np.testing.assert_allclose(clip.times, body.times, rtol=1e-12)
    there = clip.figure.skeleton.in_root_space(clip.poses)
    world = in_world(body.local, body.parents)
    assert_near(there.positions * clip.metres_per_unit, world[..., :3, 3], "places")
    turns = Rotation.from_quat(there.quaternions.reshape(-1, 4), scalar_first=True).as_matrix()
    assert_near(turns, world[..., :3, :3].reshape(-1, 3, 3), "turns")


# Logarithms and exponentials of the longest one's matrices take as long as all else together.
@pytest.mark.parametrize(
    ("name", "mode"),
    [(name, mode) for name in PLACES for mode in MODES if THOROUGH or (name, mode) != ("cmu_01_01", "dq_sclerp")],
)
def test_every_number_of_evenly_spaced_key_poses_is_had_again(bodies: dict[str, Body], name: str, mode: str) -> None:
    body, rate = bodies[name], "5"
    _, measured, radii = measured_by_the_program(name, Uniform(rate), (mode,))
    keys = evenly(body.times, float(rate))
    for own, joint in zip(measured.made.keys[mode], body.local, strict=True):
        assert own.tolist() == (keys[:1] if stays(joint) else keys).tolist()
    assert_measured_alike(measured, body, mode, radii)


@pytest.mark.parametrize("shared", [False, True])
@pytest.mark.parametrize("name", ["freebvh", "pab_run"])
def test_every_number_of_keys_that_the_motion_chooses_is_had_again(
    bodies: dict[str, Body], name: str, shared: bool
) -> None:
    body = bodies[name]
    _, measured, radii = measured_by_the_program(name, Tolerance("1cm"), MODES, shared=shared)
    for mode in MODES:
        moving = [own.tolist() for own in measured.made.keys[mode] if len(own) > 1]
        # One that hardly moves may have a single key too.
        for own, joint in zip(measured.made.keys[mode], body.local, strict=True):
            assert len(own) == 1 or not stays(joint)
        assert all(own == sorted(set(own)) and own[0] == 0 and own[-1] == len(body.times) - 1 for own in moving)
        assert (len(set(map(tuple, moving))) == 1) == shared
        assert_measured_alike(measured, body, mode, radii)
        (row,) = (row for row in measured.rows if row.mode == mode)
        assert row.max_shell_m <= 0.01 * (1.0 + 1e-9)
        assert row.key_frames < len(body.times) or not shared


@pytest.mark.parametrize(
    ("name", "joint"), [("freebvh", "mixamorig:LeftHand"), ("cmu_01_01", "LeftHand"), ("beat_saber_body", "Head")]
)
def test_every_number_of_a_single_joint_is_had_again(bodies: dict[str, Body], name: str, joint: str) -> None:
    body = bodies[name]
    (clip,), _ = read_source(f"{PLACES[name]}:{joint}", None)
    assert clip.figure is None
    made = reconstruct(clip, Uniform("5"), MODES, 0.1)
    keys = evenly(body.times, 5.0)
    samples, unit = slice(0, keys[-1] + 1), METRES[name]
    world = in_world(body.local, body.parents)[body.joints.index(joint)]
    # A single joint is in the unit of the file, whatever the size of the body.
    world[:, :3, 3] /= unit
    for row in measure_reconstruction(made):
        assert made.keys[row.mode].tolist() == keys.tolist()
        shown = FILLED_IN[row.mode](body.times[keys], world[keys], body.times[samples])
        truth = world[samples]
        shell = shell_errors(shown[None], truth[None], np.array([0.1]))[0]
        away = (shown - truth)[:, :3, 3]
        turns = Rotation.from_matrix(np.swapaxes(truth[:, :3, :3], 1, 2) @ shown[:, :3, :3])
        velocity = np.linalg.norm(np.diff(away, axis=0), axis=1) / np.diff(body.times[samples])
        assert (row.keys, row.samples, row.joints) == (len(keys), len(truth), None)
        for found, expected, what in (
            (row.rms_shell_m, rms(shell), "RMS"),
            (row.p95_shell_m, np.quantile(shell, 0.95), "95 percent"),
            (row.max_shell_m, shell.max(), "largest"),
            (row.rms_position_m, rms(np.linalg.norm(away, axis=1)), "position"),
            (np.radians(row.rms_rotation_deg), rms(turns.magnitude()), "rotation"),
            (row.rms_velocity_m_s, rms(velocity), "velocity"),
        ):
            assert_near(found * unit, expected * unit, what)
