"""Random rigs, with every way to inherit, rotate and be keyed, with constraints, drivers, strips and scale.

Their bones are where Blender poses them. The tolerance promised for reduced keys holds with the extension switched off:
at every eighth of a frame of the Action, no point of the ball around any bone with a promise is off by more, in the
world, and the largest reported error is the true one.
"""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import bpy
import hypothesis
import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

from rigid_motion import animation
from rigid_motion.animation import Refused, reduce_keys_of, write_channel
from rigid_motion.animation.baking.motions import not_promised
from rigid_motion.animation.queries.polls import with_more_keys_than
from rigid_motion.animation.transforms import transform_of
from rigid_motion.animation.transforms.posing import Hierarchy
from rigid_motion.motion.affine import AffineMaps
from rigid_motion.motion.quaternions import normalise
from tests.animation.bones.poses import shown_of
from tests.animation.bones.rigs import INHERIT_SCALES, ORDERS, Rest, new_rig
from tests.animation.bones.test_rig_reducing import matrices
from tests.animation.keyed import WIDTHS
from tests.animation.oracle import expected_bases, shown_worlds
from tests.animation.scenes import new_object, push_down, write
from tests.blank import blank
from tests.thoroughness import tried

LAST = 30
"""Keys are on frames from 1 to this frame."""

BONES = st.builds(
    SimpleNamespace,
    # The parent is this many bones earlier; 0 for no parent.
    parent=st.integers(0, 3),
    seed=st.integers(0, 1 << 20),
    rotation_mode=st.sampled_from(ORDERS),
    inherit_rotation=st.booleans(),
    inherit_scale=st.sampled_from(INHERIT_SCALES),
    local_location=st.booleans(),
    connected=st.booleans(),
    # Frames from key to key; 0 for no keys.
    step=st.sampled_from((1.0, 1.0, 0.8, 2.0, 5.0, 0.0)),
    interpolation=st.sampled_from(("LINEAR", "LINEAR", "BEZIER", "BEZIER", "SINE", "BOUNCE", "CONSTANT")),
    location=st.booleans(),
    # The type of scale keys, or a still scale.
    scale=st.sampled_from(("", "", "even", "uneven", "negative", "still")),
    # A constraint type, or a driver.
    follows=st.sampled_from((*[""] * 8, "DAMPED_TRACK", "IK", "COPY_ROTATION", "LIMIT_ROTATION", "DRIVER")),
)

RIGS = st.builds(
    SimpleNamespace,
    bones=st.lists(BONES, min_size=1, max_size=6).map(tuple),
    seed=st.integers(0, 1 << 20),
    object_keys=st.booleans(),
    parented=st.booleans(),
    size=st.sampled_from(((1.0, 1.0, 1.0), (0.5, 0.5, 0.5), (1.0, 2.0, 0.7))),
    # The scale of the strip of its Action; 0 for no strip.
    strip=st.sampled_from((0.0, 0.0, 1.0, 1.5, 2.0)),
    mode=st.sampled_from(("motor_spline", "lerp_slerp", "dq_sclerp", "cga_lerp")),
    shared=st.booleans(),
    hold=st.booleans(),
    tolerance=st.sampled_from((0.003, 0.01, 0.05)),
)


def build(case: SimpleNamespace) -> bpy.types.Object:
    """Return the rig of a case, in the open file."""
    random = np.random.default_rng(case.seed)
    rests: list[Rest] = []
    for number, settings in enumerate(case.bones):
        parent = rests[number - settings.parent] if 0 < settings.parent <= number else None
        shift = random.normal(size=3) * (0.0 if settings.connected else 0.1)
        head = parent.tail + shift if parent else random.normal(size=3)
        tail = head + 0.3 * normalise(random.normal(size=3)) * random.uniform(0.4, 1.0)
        inherits = {
            "use_connect": settings.connected and parent is not None,
            "use_inherit_rotation": settings.inherit_rotation,
            "inherit_scale": settings.inherit_scale,
            "use_local_location": settings.local_location,
        }
        above, roll = parent.name if parent else "", random.uniform(-3.0, 3.0)
        rests.append(Rest(f"Bone {number}", head, tail, above, roll, tuple(inherits.items())))
    rig = new_rig("Rig", rests)
    for bone, settings in zip(rig.pose.bones, case.bones, strict=True):
        _key(bone, settings)
    for number, settings in enumerate(case.bones):
        if settings.follows:
            _constrain(rig, number, settings)
    _move(rig, case, random)
    return rig


def frames_of(step: float) -> np.ndarray:
    return np.append(np.arange(1.0, LAST, step), float(LAST))


def _waves(random: np.random.Generator, frames: np.ndarray, count: int) -> np.ndarray:
    """Return smooth noise of about size 1, shape (n, count)."""
    return np.sin(random.uniform(0.05, 0.35, count) * frames[:, None] + random.uniform(0.0, 6.0, count))


def _key(bone: bpy.types.PoseBone, settings: SimpleNamespace) -> None:
    random = np.random.default_rng(settings.seed)
    bone.rotation_mode = settings.rotation_mode
    frames = frames_of(settings.step) if settings.step else np.array((1.0,))
    turned = 0.7 * _waves(random, frames, 3)
    rows = {"rotation_euler": turned}
    if settings.rotation_mode == "QUATERNION":
        rows = {"rotation_quaternion": normalise(np.column_stack((np.ones(len(frames)), turned)))}
    elif settings.rotation_mode == "AXIS_ANGLE":
        rows = {"rotation_axis_angle": np.column_stack((turned[:, 0], normalise(turned + 2.0)))}
    if settings.location:
        rows["location"] = 0.2 * _waves(random, frames, 3)
    if settings.scale:
        waves = 1.0 + 0.4 * _waves(random, frames, 3)
        scale = {"even": waves[:, :1].repeat(3, axis=1), "negative": waves * (-1.0, 1.0, 1.0)}
        rows["scale"] = scale.get(settings.scale, waves)
    for name, values in rows.items():
        if not settings.step or (name == "scale" and settings.scale == "still"):
            setattr(bone, name, values[0])
        else:
            write(bone, name, frames, values, settings.interpolation)


def _constrain(rig: bpy.types.Object, number: int, settings: SimpleNamespace) -> None:
    bone, other = rig.pose.bones[number], rig.pose.bones[(number + 1) % len(rig.pose.bones)].name
    if settings.follows == "DRIVER":
        driver = bone.driver_add("location", 1).driver
        driver.type, driver.expression = "SCRIPTED", "0.01 * frame"
        return
    constraint = bone.constraints.new(settings.follows)
    if settings.follows == "LIMIT_ROTATION":
        constraint.use_limit_x, constraint.max_x, constraint.owner_space = True, 0.1, "LOCAL"
        return
    target = new_object(f"Target {number}")
    target.location = (0.3, 0.4, 0.5)
    constraint.target = target
    if number + 1 < len(rig.pose.bones) and all(item.name != other for item in bone.children_recursive):
        constraint.target, constraint.subtarget = rig, other
    if settings.follows == "IK":
        constraint.chain_count = 2


def _move(rig: bpy.types.Object, case: SimpleNamespace, random: np.random.Generator) -> None:
    rig.scale = case.size
    if case.parented:
        parent = new_object(f"{rig.name} parent")
        parent.location, parent.rotation_euler = random.normal(size=3), random.normal(size=3)
        rig.parent = parent
    if case.object_keys:
        rig.rotation_mode, frames = "XYZ", frames_of(1.0)
        for path in ("location", "rotation_euler"):
            values, eased = 0.3 * _waves(random, frames, 3), case.bones[0].interpolation
            write_channel(rig, path, frames, values, interpolation=eased)
    data = rig.animation_data
    if case.strip and data is not None and data.action is not None:
        push_down(rig, scale=case.strip)
    bpy.context.view_layer.update()


@hypothesis.settings(max_examples=tried(80), suppress_health_check=[HealthCheck.too_slow])
@given(case=RIGS)
def test_bones_are_where_blender_poses_them(case: SimpleNamespace):
    blank()
    for bone in case.bones:
        bone.follows = ""
    case.strip = 0.0
    rig = build(case)
    frames = np.arange(1.0, LAST + 1.0, 3.0)
    maps = np.stack([expected_bases(bone, frames) for bone in rig.pose.bones])
    channels = AffineMaps(maps[..., :3, :3], maps[..., :3, 3])
    Hierarchy(rig.pose.bones).pose(range(len(maps)), channels, posed := channels.copy())
    truth = shown_of(rig, frames)
    size = max(1.0, np.abs(truth).max())
    np.testing.assert_allclose(posed.origins, truth[..., :3, 3], rtol=0.0, atol=1e-5 * size)
    np.testing.assert_allclose(posed.axes, truth[..., :3, :3], rtol=0.0, atol=1e-5 * size)


ROUNDING = 2e-5
"""Single precision through all bones, relative to the size of a rig of about a metre."""


@pytest.mark.slow
@hypothesis.settings(
    max_examples=tried(60), suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(case=RIGS)
def test_no_bone_that_is_promised_is_off_by_more(tmp_path_factory, case):
    assert not complaints(case, tmp_path_factory.mktemp("promise"))


def complaints(case: SimpleNamespace, folder: Path) -> list[str]:
    """Return the problems after a rig is reduced, saved, and played from both files without the extension.

    They are returned since Blender may have freed the data by the time pytest shows a failure.
    """
    blank()
    animation.register()
    refused: list[Refused] = []
    try:
        rig = build(case)
        recorded, reduced = folder / "recorded.blend", folder / "reduced.blend"
        bpy.ops.wm.save_as_mainfile(filepath=str(recorded))
        targets = list(with_more_keys_than([transform_of(rig), *map(transform_of, rig.pose.bones)], 2))
        # The bones depend on the rig and define its reach.
        radii = np.array([*map(animation.radius_of, rig.pose.bones), 0.0])
        radii /= np.cbrt(abs(np.linalg.det(np.array(rig.matrix_world)[:3, :3])))
        excepted = not_promised(rig)
        promised = np.array([bone.name not in excepted for bone in rig.pose.bones] + [True])
        counts = {transform: key_count(transform) for transform in targets}
        wishes = {"shared": case.shared, "hold": case.hold}
        report = reduce_keys_of(targets, case.mode, case.tolerance, refused=refused, **wishes)
        done = [transform for transform in targets if len(transform.motion.bakes)]
        result = [f"{item.name} has not fewer keys" for item in done if key_count(item) >= counts[item]]
        result += [str(refusal) for refusal in refused if "continues beyond" in str(refusal)]
        if not any(transform.is_part for transform in done) or not promised[:-1].any():
            return result
        bpy.ops.wm.save_as_mainfile(filepath=str(reduced))
    finally:
        animation.unregister()
    frames = 1.0 + np.arange(8.0 * LAST - 7.0) / 8.0 * (case.strip or 1.0)
    shown, truth = (played(path, frames) for path in (reduced, recorded))
    off = float(largest(shown, truth, radii)[promised].max())
    rounding, reported = ROUNDING * (1.0 + float(np.abs(truth).max())), report.largest_error
    is_exact = promised.all() and all(b.step != 0.8 and b.interpolation != "CONSTANT" for b in case.bones)
    if off > min(case.tolerance, reported) + rounding or (is_exact and reported > 1.02 * off + rounding):
        result.append(f"{off} off, {case.tolerance} allowed, {reported} reported")
    if tuple(report.rig.not_promised) != excepted:
        result.append(f"named are {report.rig.not_promised}, not {excepted}")
    return result


def played(path: Path, frames: np.ndarray) -> np.ndarray:
    """Return the world matrices of the bones of the rig in a file, and of the rig itself, (n, bones + 1, 4, 4)."""
    assert not hasattr(bpy.types.Object, "rigid_motion")
    bpy.ops.wm.open_mainfile(filepath=str(path))
    rig = bpy.data.objects["Rig"]
    return np.stack([*matrices(rig, frames).values(), *shown_worlds([rig], frames)], axis=1)


def key_count(transform: object) -> int:
    """Return the number of frames on which any of its channels has a key."""
    data = transform.animated.animation_data
    strip = data.nla_tracks[0].strips[0] if len(data.nla_tracks) else data
    names = [transform.prefix + name for name in WIDTHS]
    fcurves = strip.action.layers[0].strips[0].channelbag(strip.action_slot).fcurves
    times = [point.co.x for curve in fcurves if curve.data_path in names for point in curve.keyframe_points]
    return len(np.unique(np.round(times, 2)))


def largest(shown: np.ndarray, truth: np.ndarray, radii: np.ndarray) -> np.ndarray:
    """Return a lower bound of the largest displacement of any point of each bone's ball (bones,), from many points."""
    points = np.random.default_rng(1).normal(size=(400, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    offset = shown - truth
    # Also both ends of the axis with the largest stretch.
    result = []
    for bone, radius in enumerate(radii):
        turns, moved = offset[:, bone, :3, :3], offset[:, bone, :3, 3]
        _, _, axes = np.linalg.svd(turns)
        ball = radius * np.concatenate((np.tile(points, (len(turns), 1, 1)), axes, -axes), axis=1)
        result.append(np.linalg.norm(ball @ turns.swapaxes(1, 2) + moved[:, None], axis=2).max())
    return np.array(result)
