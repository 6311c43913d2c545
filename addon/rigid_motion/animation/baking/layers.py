"""Offset layers: keys on top of a motion; the visible motion is the motion times the offset, as rigid transforms.

Blender's additive strips add locations along the axes of the parent. So the motion goes to an Empty, the *base*, in the
same space. The object becomes a child of the base, a bone follows it by a *Child Of*; its own channels are the offset,
in an NLA strip whose influence is keyed. All of this is native to Blender and plays without the extension. Merging
writes the visible motion as keys of the previous Action.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from mathutils import Matrix

from ...blender import existing, scene
from ..actions.channels import channelbag_of, copy_fcurve, key_points
from ..actions.reading import read
from ..actions.refusals import refuse_drivers, refuse_layered, refuse_linked
from ..actions.slots import Binding, bindings_in_slot, slots_alone
from ..edits.apply import Readings, Targets, apply_edit, editable_binding
from ..edits.holding import key_components
from ..edits.mode_keys import set_mode_in
from ..evaluation.components import LOCATION, MODE_NAMES, ROTATION, SCALE
from ..evaluation.sources import KeyedTransform
from ..following import follower
from ..holds.apply import has_holders
from ..holds.placing import hang_of
from ..holds.problems import refuse_space
from ..queries.keyed import active_binding
from ..transforms import TURNS_PROPERTY, Refused, Transform, transform_of
from ..transforms.sizes import radius_of
from .originals import remove_unused
from .worlds import alone_in

BELOW, LAYER = "Rigid Motion Base", "Rigid Motion Layer"
"""The names of the NLA tracks: for all else in the Action, and for the offset. Constraints of bones have the latter."""

HELD = n_("{name} is held: Bake to Keys with To World first, or add the layer to what holds it")
CONSTRAINED = n_("{name} has the constraint {constraint}: mute it, or bake it to keys first (Animation > Bake Action)")
OTHERWISE = n_(
    "{name} does not inherit all from its parent bone: check Local Location and Inherit Rotation, and set Inherit "
    "Scale to Full (Bone, Relations)"
)


def strips_of(obj: bpy.types.Object) -> tuple[bpy.types.NlaStrip, bpy.types.NlaStrip] | None:
    """Return the strip below an object's layer, and that of the layer; None if these are not all its animation."""
    data = obj.animation_data
    tracks = [] if data is None else [track for track in data.nla_tracks if track.strips]
    if data is None or [track.name for track in tracks] != [BELOW, LAYER] or (data.action and not data.use_tweak_mode):
        return None
    return tracks[0].strips[0], tracks[1].strips[0]


def is_plain(obj: bpy.types.Object) -> bool:
    """Return whether the layer of an object is in tweak mode and unaltered: its strips have the same frames as their
    Actions, and its influence is 1 throughout.
    """
    strips = strips_of(obj)
    if strips is None or not existing(obj.animation_data).use_tweak_mode:
        return False
    moved = any((strip.frame_start, strip.scale) != (strip.action_frame_start, 1.0) for strip in strips)
    return not moved and bool(np.all(influence_of(strips[1])[:, 1] == 1.0))


def influence_of(layer: bpy.types.NlaStrip) -> np.ndarray:
    """Return frames and values of the keys of a layer's influence, shape (n, 2)."""
    return key_points(existing(layer.fcurves.find("influence"))).astype(float)


def layered(obj: bpy.types.Object) -> list[Transform]:
    """Return the transforms with a base: of the object and its bones."""
    carriers = (obj, *(() if obj.pose is None else obj.pose.bones))
    return [one for one in map(transform_of, carriers) if one.motion.base is not None]


def add_layer(targets: Targets, *, refused: list[Refused] | None = None) -> None:
    """Give targets an offset layer, with no offset on the current frame, and enter its strip.

    The motion of each target goes to an Empty in its place, with its scale if that is keyed and uniform. Bones of one
    rig share a layer. For targets see `edits.apply`.
    """

    def plan(transform: Transform, readings: Readings) -> tuple[Binding, KeyedTransform]:
        refuse_layered(transform)
        if (strips := strips_of(transform.animated)) is None:
            editable_binding(transform, bindings := [binding for binding, _ in readings])
            binding = alone_in(transform, bindings)
        else:
            binding = binding_below(transform, strips)
        refuse_linked(transform, binding)
        source = read(binding)
        refuse_drivers(transform, binding, source.driven)
        if source.held is not None or has_holders(binding):
            raise Refused(HELD, name=transform.name)
        _refuse_space(transform)
        return binding, source

    def act(transform: Transform, planned: tuple[Binding, KeyedTransform]) -> None:
        binding, source = planned
        mode = MODE_NAMES[int(source.modes_at(source.keyed_frames[:1])[0])] if source.channels else "BLENDER"
        parts = [LOCATION, ROTATION, *([SCALE] if source.uniform_scale else [])]
        _attach_to_base(transform, _make_base(transform, binding, parts))
        _enter_layer(transform.animated, binding)
        key_components(transform, transform.components(), ("location", transform.rotation))
        set_mode_in(existing(active_binding(transform)), mode)

    done = apply_edit(targets, plan, act, refused)
    follower.refresh(transform_of(existing(transform.motion.base)) for transform in done)


def _refuse_space(transform: Transform) -> None:
    """Raise `Refused` if no Empty could take the place of a transform and carry it."""
    if not transform.is_part:
        refuse_space(transform)
    else:
        bone = transform.pose_bone.bone
        inherits = bone.parent is None or (bone.use_inherit_rotation and bone.inherit_scale == "FULL")
        if transform.location_axes is not None or not inherits:
            raise Refused(OTHERWISE, name=transform.name)
    for constraint in transform.carrier.constraints:
        if not constraint.mute:
            raise Refused(CONSTRAINED, name=transform.name, constraint=constraint.name)


def binding_below(transform: Transform, strips: tuple[bpy.types.NlaStrip, bpy.types.NlaStrip]) -> Binding:
    """Return the binding that moves a transform below its layer."""
    key = existing(strips[0].action), strips[0].action_slot_handle
    slot = next(slot for slot in slots_alone(transform.animated) if slot.key == key)
    return bindings_in_slot(slot, (transform.prefix,))[0]


def _make_base(transform: Transform, binding: Binding, parts: Iterable[str]) -> bpy.types.Object:
    """Return a new Empty with the motion of these parts of a transform, in the same space. The transform loses it."""
    carrier, obj = transform.carrier, transform.animated
    base = bpy.data.objects.new(f"{carrier.name} Base", None)
    for collection in obj.users_collection:
        collection.objects.link(base)
    base.rotation_mode = carrier.rotation_mode
    base.empty_display_size = radius_of(carrier)
    moved = {transform.properties[part] for part in parts}
    for prop in moved:
        setattr(base, prop, getattr(carrier, prop))
        setattr(carrier, prop, cast(Any, carrier.bl_rna.properties[prop]).default_array)
    moved.add(TURNS_PROPERTY)
    for channel, fcurve in list(binding.curves.items()):
        path = channel[0].removeprefix(transform.prefix)
        if path in moved:
            copy_fcurve(fcurve, channelbag_of(base), path)
            binding.remove_curve(channel)
    if not transform.is_part:
        _copy_parenting(base, obj)
        return base
    bone, parent = transform.pose_bone.bone, transform.pose_bone.parent
    base.parent, base.matrix_parent_inverse, offset = obj, Matrix(), bone.matrix_local
    if parent is not None:
        base.parent_type, base.parent_bone = "BONE", parent.name
        offset = parent.bone.matrix_local.inverted() @ offset
    base.matrix_parent_inverse = hang_of(transform_of(base)).inverted() @ offset
    return base


def _attach_to_base(transform: Transform, base: bpy.types.Object) -> None:
    """Parent an object to its base, or constrain a bone to it."""
    transform.motion.base = base
    if transform.is_part:
        constraint = cast(Any, transform.pose_bone.constraints.new("CHILD_OF"))
        constraint.name = LAYER
        constraint.target, constraint.set_inverse_pending = base, False
        # Blender does not convert the result back, so the bone's channels are in the space of the base, not its parent.
        constraint.inverse_matrix, constraint.owner_space, constraint.target_space = Matrix(), "LOCAL", "WORLD"
    else:
        obj = transform.animated
        obj.parent, obj.parent_type, obj.matrix_parent_inverse = base, "OBJECT", Matrix()


def _enter_layer(obj: bpy.types.Object, binding: Binding) -> None:
    """Enter tweak mode for the strip of an object's layer. Create the strips first if there are none."""
    data = existing(obj.animation_data)
    if strips_of(obj) is None:
        action, slot = existing(data.action), data.action_slot
        data.action = None
        offset = bpy.data.actions.new(f"{obj.name} Layer")
        keyed = action.frame_range if any(True for _ in binding.slot.fcurves) else (np.inf, -np.inf)
        # Outside of its strip a layer keeps the values of its ends, even if there are keys.
        first = int(np.floor(min(scene().frame_start, scene().frame_current, keyed[0])))
        last = int(np.ceil(max(scene().frame_end, scene().frame_current, keyed[1])))
        for name, shown, of in ((BELOW, action, slot), (LAYER, offset, offset.slots.new("OBJECT", obj.name))):
            track = data.nla_tracks.new()
            track.name = name
            strip = track.strips.new(name, first, shown)
            strip.action_slot = of
            strip.action_frame_start, strip.action_frame_end = first, last
        # In tweak mode Blender reads the strip's influence only within the range of the Action.
        offset.use_frame_range, offset.frame_start, offset.frame_end = True, first, last
        strip.blend_type, strip.use_animated_influence = "COMBINE", True
        existing(strip.fcurves.find("influence")).keyframe_points.insert(first, 1.0)
    data.nla_tracks.active, existing(strips_of(obj))[1].select = existing(data.nla_tracks.get(LAYER)), True
    data.use_tweak_mode = True


def remove_base(transform: Transform) -> None:
    """Detach a transform from its base, and remove the base if nothing else uses it."""
    base, carrier = existing(transform.motion.base), transform.carrier
    transform.motion.base = None
    if isinstance(carrier, bpy.types.PoseBone):
        for constraint in [one for one in carrier.constraints if getattr(one, "target", None) == base]:
            carrier.constraints.remove(constraint)
    else:
        _copy_parenting(carrier, base)
    if not bpy.data.user_map(subset=[base], value_types={"OBJECT"})[base]:
        action = None if base.animation_data is None else base.animation_data.action
        bpy.data.objects.remove(base)
        if action is not None:
            remove_unused(action)


def remove_layer(obj: bpy.types.Object) -> None:
    """Restore the Action below an object's layer, and remove the layer."""
    data, (below, layer) = existing(obj.animation_data), existing(strips_of(obj))
    data.use_tweak_mode = False
    action, slot, offset = below.action, below.action_slot, existing(layer.action)
    for name in (LAYER, BELOW):
        data.nla_tracks.remove(existing(data.nla_tracks.get(name)))
    data.action, data.action_slot = action, slot
    remove_unused(offset)


def _copy_parenting(obj: bpy.types.Object, model: bpy.types.Object) -> None:
    """Give an object the same parent as another object, in the same way."""
    obj.parent, obj.parent_type, obj.parent_bone = model.parent, model.parent_type, model.parent_bone
    obj.matrix_parent_inverse = model.matrix_parent_inverse
