"""Random rigs: every way to inherit, rotate and be keyed, with constraints, drivers, strips and scale."""

from __future__ import annotations

from types import SimpleNamespace

import bpy
import numpy as np
from hypothesis import strategies as st

from rigid_motion.animation import write_channel
from rigid_motion.motion.quaternions import normalise
from tests.animation.bones.rigs import INHERIT_SCALES, ORDERS, Rest, new_rig
from tests.animation.scenes import new_object, push_down, write

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


def build(case: SimpleNamespace, name: str = "Rig") -> bpy.types.Object:
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
    rig = new_rig(name, rests)
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
