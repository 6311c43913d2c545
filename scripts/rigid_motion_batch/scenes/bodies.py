"""Bodies in a scene: a figure for each mode as an ordinary rig, coloured by its errors, and the recording as a ghost.

The errors of joints over time are stored in a separate mesh, with a vertex for each bone and frame. Node groups read it
to colour the bones, flash the joints at their keys, and ring the worst joint: the saved file plays for anyone.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from rigid_motion.blender import action_of, armature, assign, pose_bones
from rigid_motion.motion import KEYFRAME_MODES, Poses
from rigid_motion.motion.quaternions import conjugate, rotate
from rigid_motion_batch.palette import error_hex
from rigid_motion_batch.recordings.rest_bodies import RestBody

from . import layout, physique, trails
from .armature import RestFigure, Rig
from .lanes import Cast, Lane
from .materials import ghost, ink, surface
from .nodes import Group, Socket, add_attribute, apply_group, node_of

SHADE_COUNT = 16
"""The number of colour shades of the bones."""

ERROR, FLASH, WORST = "error", "flash", "worst"
"""Attributes of the errors mesh: the error in metres; the joint's flash and whether it has the ring, 0 to 1."""

IN_FRONT = 0.45
"""The distance of joint markers from the figure towards the camera, in units of the frame's height."""

MIN_RING_ERROR_RATIO = 0.02
"""The worst joint has a ring if its error exceeds this fraction of the error with the last colour."""

# In units of the frame's height.
FLASH_RADIUS = 0.0046
RING_RADIUS = 0.024
RING_THICKNESS = 0.0021
GRID_RADIUS = 0.0013

GROUND_CELL_M = 0.5
"""Metres between ground lines, for a figure of `TYPICAL_HEIGHT_M`; scaled for figures of other sizes."""

TYPICAL_HEIGHT_M = 1.7
GRID_STEPS = 4
"""Points of a ground line from one crossing to the next: the line may end at any of them."""

MOST_CELLS = 120
"""Maximum number of ground lines each way."""


@dataclass(frozen=True, eq=False)
class StageMotion:
    """The motion of a body on the stage for n frames, in metres and Blender's axes, centred on the recording."""

    rest_body: RestBody
    rest: RestFigure
    recording: Poses
    """The joints in their parents' space at each frame, shape (joints, n)."""

    modes: Mapping[str, Poses]
    """Mode id to the same for that mode."""

    keys: Mapping[str, list[tuple[np.ndarray, Poses]]]
    """Mode id to the key frames of each joint, and the poses at these frames."""

    errors: Mapping[str, np.ndarray]
    """Mode id to the error of each joint, shape (joints, n)."""

    flashes: Mapping[str, np.ndarray]
    """Mode id to the flash of each joint, 0 to 1, shape (joints, n)."""

    def places(self, poses: Poses) -> np.ndarray:
        """Return heads and tails of visible bones (n, m, 3), for joints in their parents' space (joints, n)."""
        seen = physique.seen_bones(self.rest)
        joints = self.rest.joints.positions[seen]
        return self.carried(poses, np.tile(seen, 2), np.concatenate((joints, self.rest.tails[seen])))

    def carried(self, poses: Poses, bones: Sequence[int] | np.ndarray, points: np.ndarray) -> np.ndarray:
        """Return points (k, 3) of the rest pose as carried by bones (k,): (n, k, 3).

        `poses` are the joints in their parents' space, shape (joints, n).
        """
        joints = self.rest_body.skeleton.in_root_space(poses)[bones]
        back = conjugate(self.rest.joints.quaternions[bones])
        arms = rotate(back, points - self.rest.joints.positions[bones])
        return (joints.positions + rotate(joints.quaternions, arms[:, None])).transpose(1, 0, 2)


class Bodies:
    """Makes the figures of the lanes, with shared materials, node groups and meshes."""

    def __init__(self, cast: Cast, motion: StageMotion, shape: physique.Physique, full: float) -> None:
        self.cast, self.motion = cast, motion
        self.names = motion.rest_body.joints
        self.size = physique.body_size(motion.rest)
        self.rig: Rig | None = None
        self.ghost_action: bpy.types.Action | None = None
        self.rest_body = physique.CarriedMesh.rest_body("Figure", shape)
        self.ghost = ghost(cast.theme)
        for shade in range(SHADE_COUNT):
            name = f"Error {1e3 * full * shade / (SHADE_COUNT - 1):.3g} mm"
            self.rest_body.mesh.materials.append(surface(name, error_hex(shade / (SHADE_COUNT - 1)), roughness=0.55))
        self.joints = physique.CarriedMesh.joints("Joints", motion.rest)
        self.full = full
        self.colours, self.flashes, self.rings = _colours_group(), _flashes_group(), _rings_group()
        self.grid = ground_grid(motion, GROUND_CELL_M * 2.0 ** round(np.log2(self.size / TYPICAL_HEIGHT_M)))
        self.trail_group = trails.trail_group()
        self.track = ink("Ground", cast.theme.track)

    def enter(self, lane: Lane) -> None:
        """Add the figure of a mode, its ghost, and the ground."""
        mode, motion = lane.mode, self.motion
        rest_body = self._rig(mode, lane)
        if mode in KEYFRAME_MODES:
            self._key(rest_body, motion.keys[mode])
            rest_body.fill_in(mode)
        else:
            frames = self.cast.timeline.frames
            self._key(rest_body, [(frames, motion.modes[mode][joint]) for joint in range(len(self.names))])
        if rest_body.obj.animation_data and rest_body.obj.animation_data.action:
            action_of(rest_body.obj).name = mode
        self._add_ghost(lane)
        self._dress(rest_body, lane)
        self._add_ground(lane)

    def _rig(self, name: str, lane: Lane) -> Rig:
        rig = Rig(name, self.motion.rest, self.names, lane.collection, like=self.rig)
        self.rig = self.rig or rig
        rig.obj.parent = lane.empty
        rig.obj.show_in_front = True
        armature(rig.obj).display_type = "STICK"
        return rig

    @staticmethod
    def _key(rig: Rig, keys: list[tuple[np.ndarray, Poses]]) -> None:
        """Key every bone from poses of joints in their parents' space."""
        for bone, (frames, poses) in enumerate(keys):
            rig.key(bone, frames, rig.channels_of_bone(bone, poses))

    def _add_ghost(self, lane: Lane) -> None:
        rig = self._rig(f"{lane.mode} recording", lane)
        if self.ghost_action is None:
            frames, recording = self.cast.timeline.frames, self.motion.recording
            self._key(rig, [(frames, recording[joint]) for joint in range(len(self.names))])
            if rig.obj.animation_data:
                self.ghost_action = action_of(rig.obj)
                self.ghost_action.name = "recording"
                self.still = [(bone.location.copy(), bone.rotation_quaternion.copy()) for bone in pose_bones(rig.obj)]
        else:
            assign(rig.obj, self.ghost_action)
            for bone, (place, turn) in zip(pose_bones(rig.obj), self.still, strict=True):
                bone.location, bone.rotation_quaternion = place, turn
        rest_body = self._carried(f"{lane.mode} recording figure", self.rest_body, rig, lane)
        rest_body.location = rig.obj.location = self.cast.behind.tolist()
        rest_body.material_slots[0].link = "OBJECT"
        rest_body.material_slots[0].material = self.ghost

    @staticmethod
    def _carried(name: str, carried: physique.CarriedMesh, rig: Rig, lane: Lane) -> bpy.types.Object:
        obj = lane.child(name, carried.mesh)
        carried.hang_on(rig, obj)
        return obj

    def _dress(self, rig: Rig, lane: Lane) -> None:
        mode, metres = lane.mode, self.cast.layout.metres
        errors = self._errors(lane)
        rest_body = self._carried(f"{mode} figure", self.rest_body, rig, lane)
        bones = float(len(self.names))
        apply_group(rest_body, self.colours, Errors=errors, Bones=bones, Shades=SHADE_COUNT / self.full)
        # Facing the camera, in front of the figure; only the lane's rotation needs to be undone.
        turn = -self.cast.framing.yaw
        towards = rotate(layout.yaw_quaternion(turn), -layout.AWAY_AXIS * IN_FRONT * metres).tolist()
        shared = {"Errors": errors, "Bones": bones, "Towards": towards, "Material": self.cast.ink}
        joints = self._carried(f"{mode} keys", self.joints, rig, lane)
        apply_group(joints, self.flashes, Radius=FLASH_RADIUS * metres, **shared)
        ring = self._carried(f"{mode} worst joint", self.joints, rig, lane)
        facing = (np.pi / 2.0 - layout.ELEVATION_RAD, 0.0, turn)
        apply_group(
            ring, self.rings, Radius=RING_RADIUS * metres, Thickness=RING_THICKNESS * metres, Facing=facing, **shared
        )

    def _errors(self, lane: Lane) -> bpy.types.Object:
        """Return an object with the errors of a mode: a vertex per bone and frame, grouped by frame."""
        mode = lane.mode
        errors = self.motion.errors[mode]
        mesh = bpy.data.meshes.new(f"{mode} errors")
        mesh.vertices.add(errors.size)
        worst = (errors == errors.max(axis=0)) & (errors > MIN_RING_ERROR_RATIO * self.full)
        for name, values in ((ERROR, errors), (FLASH, self.motion.flashes[mode]), (WORST, worst)):
            add_attribute(mesh, name, values.T.astype(np.float32).ravel())
        obj = lane.child(f"{mode} errors", mesh)
        obj.hide_render = True
        return obj

    def _add_ground(self, lane: Lane) -> None:
        cast, metres = self.cast, self.cast.layout.metres
        apply_group(
            lane.child(f"{lane.mode} ground", self.grid),
            self.trail_group,
            Past=4.0 * cast.timeline.count,
            Ahead=0.0,
            Radius=GRID_RADIUS * metres,
            Taper=0.0,
            Material=self.track,
            **lane.window(metres),
        )


def ground_grid(motion: StageMotion, spacing: float) -> bpy.types.Mesh:
    """Return a mesh of ground lines, `spacing` metres apart, around the path of a body."""
    reach = 2.5 * physique.body_size(motion.rest)
    way = motion.places(motion.recording).mean(axis=1)[:, :2]
    low, high = way.min(axis=0) - reach, way.max(axis=0) + reach
    spacing = max(spacing, float(np.max(high - low)) / MOST_CELLS)
    first, last = np.floor(low / spacing).astype(int), np.ceil(high / spacing).astype(int)
    points: list[np.ndarray] = []
    edges: list[np.ndarray] = []
    for along in (0, 1):
        across = 1 - along
        steps = np.arange(first[along] * GRID_STEPS, last[along] * GRID_STEPS + 1) * spacing / GRID_STEPS
        for line in np.arange(first[across], last[across] + 1) * spacing:
            own = np.zeros((len(steps), 3))
            own[:, along], own[:, across] = steps, line
            begin = sum(map(len, points))
            points.append(own)
            numbers = begin + np.arange(len(steps))
            edges.append(np.stack((numbers[:-1], numbers[1:]), axis=-1))
    places = np.concatenate(points)
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata(places.tolist(), np.concatenate(edges).tolist(), [])
    add_attribute(mesh, trails.FRAME, np.zeros(len(places), np.float32))
    return mesh


def flashes(key_frames: list[np.ndarray], frames: np.ndarray, fade: float) -> np.ndarray:
    """Return the flash of joints at `frames` (n,), 0 to 1, shape (joints, n): 1 at a key, fading over `fade` frames.

    `key_frames` are the keys of each joint. A joint with a single key does not flash.
    """
    result = np.zeros((len(key_frames), len(frames)))
    for own, flash in zip(key_frames, result, strict=True):
        if len(own) > 1:
            last = np.searchsorted(own, frames + 1e-3, side="right") - 1
            age = frames - own[np.maximum(last, 0)]
            flash[:] = np.where(last >= 0, np.clip(1.0 - age / fade, 0.0, 1.0), 0.0)
    return result


def _error_value(group: Group, name: str) -> Socket:
    """Return the value in the errors mesh for the bone of each face or point, at the shown frame."""
    bone = group.add("GeometryNodeInputNamedAttribute", physique.BONE, settings={"data_type": "INT"})
    frame = group.math("SUBTRACT", group.frame(), 1.0)
    # Blender truncates numbers to get an index.
    number = group.math("ADD", group.math("MULTIPLY_ADD", frame, group.inputs["Bones"], bone), 0.5)
    source = node_of(group.add("GeometryNodeObjectInfo", group.inputs["Errors"])).outputs["Geometry"]
    sample = node_of(group.add("GeometryNodeSampleIndex", source, settings={"data_type": "FLOAT", "domain": "POINT"}))
    sample.clamp = True
    inputs = {socket.name: socket for socket in sample.inputs if socket.enabled}
    group.tree.links.new(group.attribute(name), inputs["Value"])
    group.tree.links.new(number, inputs["Index"])
    return next(socket for socket in sample.outputs if socket.enabled)


def _colours_group() -> bpy.types.NodeTree:
    """Return a node group that picks each face's material by the error of its bone: `Shades` per metre."""
    group = Group("Colours of errors", Errors="Object", Bones="Float", Shades="Float")
    shade = group.math("MULTIPLY", _error_value(group, ERROR), group.inputs["Shades"])
    shade = group.math("MINIMUM", group.math("MAXIMUM", shade, 0.0), SHADE_COUNT - 0.5)
    geometry = node_of(group.add("GeometryNodeSetMaterialIndex", group.inputs["Geometry"]))
    group.tree.links.new(shade, geometry.inputs["Material Index"])
    return group.finish(geometry.outputs[0])


def _flashes_group() -> bpy.types.NodeTree:
    """Return a node group that draws a ball at each joint that has just passed a key."""
    group = Group("Key flashes", Errors="Object", Bones="Float", Radius="Float", Towards="Vector", Material="Material")
    flash = _error_value(group, FLASH)
    dark = group.math("LESS_THAN", flash, 0.02)
    points = group.add("GeometryNodeDeleteGeometry", group.inputs["Geometry"], dark, settings={"domain": "POINT"})
    points = _shifted(group, points)
    ball = group.add("GeometryNodeMeshIcoSphere", 1.0, 1)
    ball = group.add("GeometryNodeSetMaterial", ball, Material=group.inputs["Material"])
    radius = group.math("MULTIPLY", group.inputs["Radius"], flash)
    return group.finish(group.add("GeometryNodeInstanceOnPoints", points, Instance=ball, Scale=radius))


def _rings_group() -> bpy.types.NodeTree:
    """Return a node group that draws a ring around the joint with the largest error."""
    inputs = {"Radius": "Float", "Thickness": "Float", "Towards": "Vector", "Facing": "Vector", "Material": "Material"}
    group = Group("Ring around the worst", Errors="Object", Bones="Float", **inputs)
    other = group.math("LESS_THAN", _error_value(group, WORST), 0.5)
    points = group.add("GeometryNodeDeleteGeometry", group.inputs["Geometry"], other, settings={"domain": "POINT"})
    points = _shifted(group, points)
    circle = group.add("GeometryNodeCurvePrimitiveCircle", Resolution=48)
    group.tree.links.new(group.inputs["Radius"], _input(circle, "Radius"))
    profile = group.add("GeometryNodeCurvePrimitiveCircle", Resolution=6)
    group.tree.links.new(group.inputs["Thickness"], _input(profile, "Radius"))
    ring = group.add("GeometryNodeCurveToMesh", circle, profile)
    ring = group.add("GeometryNodeSetMaterial", ring, Material=group.inputs["Material"])
    turn = group.inputs["Facing"]
    return group.finish(group.add("GeometryNodeInstanceOnPoints", points, Instance=ring, Rotation=turn))


def _shifted(group: Group, points: Socket) -> Socket:
    """Return the points moved towards the camera, in front of everything.

    The camera's rays are parallel, so the points appear at the same place.
    """
    return group.add("GeometryNodeSetPosition", points, Offset=group.inputs["Towards"])


def _input(socket: Socket, name: str) -> Socket:
    """Return the enabled input with this name of a socket's node; several may have the name."""
    return next(item for item in node_of(socket).inputs if item.name == name and item.enabled)
