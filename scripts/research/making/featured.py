"""The featured picture of the extension's page: one swing of a hammer between the same two keys, twice.

On the left by Blender's own in-betweens, on the right by the screw. Both hammers are keyed objects, and each ghost is
where Blender shows its hammer on a frame: nothing of the motion is drawn by hand. It is seen along +y, z is up.
"""

from __future__ import annotations

import math
from pathlib import Path

import bmesh
import bpy
from mathutils import Matrix, Quaternion, Vector

from rigid_motion import animation
from rigid_motion_batch.palette import linear
from rigid_motion_batch.scenes.body_scene import registered
from rigid_motion_batch.scenes.materials import ink, surface

from .rendering import add, empty_scene, look_from, render, tubes

SIZE, UNITS = (1920, 1080), 19.2  # pixels, and how wide the picture is in the scene

LENGTH = 4.3  # from the hammer's origin, in its head, to where the hand holds it
GRIP = Vector((0.0, 0.0, -LENGTH))  # where that is on the hammer
SWING = math.radians(62.0)  # how far a key leans to its side
FIRST, LAST, BETWEEN = 1, 61, 3  # the frames of the keys, and how many ghosts are between them
HAND = -1.85  # the height of the hand

HEAD = ((0.0, 0.34, 0.7), (0.42, 0.25, 0.3), (0.66, 0.38, 0.3), (-0.42, 0.25, 0.3), (-0.66, 0.38, 0.3))
"""The parts of its head along x: middle, radius and length."""

BACKGROUND, WOOD, STEEL = "#303030", "#B98A54", "#C9CED6"
NATIVE, NATIVE_GHOST = "#F08A3C", "#A05F33"
RIGID, RIGID_GHOST = "#38B6FF", "#2A7CAD"
WORDS, FAINT = "#E6E6E6", "#9A9A9A"


def make(path: Path, samples: int = 32) -> None:
    """Render the picture into a file."""
    empty_scene()
    with registered():
        _lane(-4.75, None, (NATIVE, NATIVE_GHOST), "Blender", "each channel for itself")
        _lane(4.75, "dq_sclerp", (RIGID, RIGID_GHOST), "Rigid Motion", "one body, one motion")
        _write("the grip leaves the hand", (-1.95, 0.0, -3.5), 0.34, NATIVE)
        _write("the grip stays in the hand", (4.75, 0.0, -2.95), 0.34, RIGID)
        _write("The same two keys", (0.0, 0.0, -4.72), 0.36, FAINT)
        _surroundings(bpy.context.scene)
        look_from((0.0, -20.0, 0.0), (math.radians(90.0), 0.0, 0.0), UNITS)
        render(path, SIZE, samples, denoise=True)


def _lane(x: float, mode: str | None, colours: tuple[str, str], title: str, says: str) -> None:
    """Draw a hammer with two keys, its poses on the way, the paths of its head and its grip, and the hand."""
    colour, faint = colours
    hand = Vector((x, 0.0, HAND))
    poses = swing(hammer := _hammer(title), hand, mode)
    step = (LAST - FIRST) // (BETWEEN + 1)
    ghost = surface(f"Ghost of {title}", faint, roughness=0.6)
    for number, frame in enumerate(range(FIRST + step, LAST, step)):
        # One behind the other, so that no two share a surface.
        behind = Matrix.Translation((0.0, 0.9 + 0.05 * number, 0.0))
        _hammer(f"{title} {frame}", ghost).matrix_world = behind @ poses[frame - FIRST]
    _hammer(f"{title} begins").matrix_world = poses[0]
    _hammer(f"{title} ends").matrix_world = poses[-1]
    bpy.data.objects.remove(hammer)
    line = ink(f"Path of {title}", colour)
    _path(f"Head of {title}", [pose.translation + Vector((0.0, -0.7, 0.0)) for pose in poses], 0.045, line)
    grips = [pose @ GRIP + Vector((0.0, -0.7, 0.0)) for pose in poses]
    if max((grip - grips[0]).length for grip in grips) > 0.1:
        _path(f"Grip of {title}", grips, 0.03, line)
    for pose in (poses[0], poses[-1]):
        key = bmesh.new()
        bmesh.ops.create_uvsphere(key, u_segments=32, v_segments=16, radius=0.15)
        place = pose.translation + Vector((0.0, -0.8, 0.0))
        _flat("Key", _mesh("Key", key), ink("Key", "#FFC033")).location = place
    turns, middle = (math.radians(angle) for angle in range(0, 361, 5)), hand + Vector((0.0, -0.75, 0.0))
    ring = [middle + 0.42 * Vector((math.cos(turn), 0.0, math.sin(turn))) for turn in turns]
    _path("Hand", ring, 0.05, ink("Hand", WORDS))
    _write(title, (x, 0.0, 4.22), 0.78, colour)
    _write(says, (x, 0.0, 3.52), 0.36, WORDS)


def _hammer(name: str, material: bpy.types.Material | None = None) -> bpy.types.Object:
    """Return a hammer that hangs from its head, where its origin is; of one material, or of wood and steel."""
    mesh = bmesh.new()

    def cone(segments: int, radii: tuple[float, float], depth: float, matrix: Matrix) -> set[bmesh.types.BMFace]:
        ends = {"radius1": radii[0], "radius2": radii[1]}
        made = bmesh.ops.create_cone(mesh, cap_ends=True, segments=segments, depth=depth, matrix=matrix, **ends)
        return {face for vert in made["verts"] for face in vert.link_faces}

    wooden = cone(32, (0.19, 0.135), LENGTH + 0.4, Matrix.Translation((0.0, 0.0, -0.5 * LENGTH - 0.1)))
    across = Matrix.Rotation(math.radians(90.0), 4, "Y")
    for x, radius, depth in HEAD:
        cone(48, (radius, radius), depth, Matrix.Translation((x, 0.0, 0.0)) @ across)
    for face in mesh.faces:
        face.material_index = 0 if face in wooden else 1
    data = _mesh(name, mesh)
    wood, steel = surface("Wood", WOOD, roughness=0.55), surface("Steel", STEEL, roughness=0.3)
    obj = add(name, data, material or wood, material or steel)
    bevel = obj.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments, bevel.limit_method = 0.05, 3, "ANGLE"
    data.shade_smooth()
    data.set_sharp_from_angle(angle=math.radians(30.0))
    return obj


def _mesh(name: str, mesh: bmesh.types.BMesh) -> bpy.types.Mesh:
    data = bpy.data.meshes.new(name)
    mesh.to_mesh(data)
    mesh.free()
    return data


def swing(hammer: bpy.types.Object, hand: Vector, mode: str | None) -> list[Matrix]:
    """Key a hammer so that the hand holds it on both sides, with a mode or, None, with Blender's own in-betweens.

    Returns
    -------
    list of Matrix
        Where Blender shows it on each frame.
    """
    hammer.rotation_mode = "QUATERNION"
    for frame, angle in ((FIRST, -SWING), (LAST, SWING)):
        turn = Quaternion((0.0, 1.0, 0.0), angle)
        hammer.rotation_quaternion = turn
        hammer.location = hand - turn @ GRIP
        hammer.keyframe_insert("location", frame=frame)
        hammer.keyframe_insert("rotation_quaternion", frame=frame)
    for fcurve in animation.channelbag_of(hammer).fcurves:
        for key in fcurve.keyframe_points:
            key.interpolation = "LINEAR"
    if mode is not None:
        animation.set_mode(hammer, mode)
    shown = []
    for frame in range(FIRST, LAST + 1):
        bpy.context.scene.frame_set(frame)
        shown.append(hammer.evaluated_get(bpy.context.evaluated_depsgraph_get()).matrix_world.copy())
    return shown


def _path(name: str, points: list[Vector], radius: float, material: bpy.types.Material) -> None:
    curve = tubes(name, [points], radius)
    curve.use_fill_caps = True
    _flat(name, curve, material)


def _write(text: str, place: tuple[float, float, float], size: float, colour: str) -> None:
    curve = bpy.data.curves.new(text, "FONT")
    curve.body, curve.size, curve.align_x, curve.align_y = text, size, "CENTER", "CENTER"
    obj = _flat(text, curve, ink(f"Words {colour}", colour))
    obj.location, obj.rotation_euler = Vector(place) + Vector((0.0, -2.0, 0.0)), (math.radians(90.0), 0.0, 0.0)


def _flat(name: str, data: bpy.types.ID, material: bpy.types.Material) -> bpy.types.Object:
    """Return an object that is read rather than seen: it throws no shadow and lights nothing."""
    obj = add(name, data, material)
    obj.visible_shadow = obj.visible_diffuse = obj.visible_glossy = False
    return obj


def _surroundings(scene: bpy.types.Scene) -> None:
    """Add a wall behind, and lights."""
    mesh = bpy.data.meshes.new("Wall")
    corners = [(-30.0, 2.2, -20.0), (30.0, 2.2, -20.0), (30.0, 2.2, 20.0), (-30.0, 2.2, 20.0)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    _flat("Wall", mesh, ink("Wall", BACKGROUND))
    scene.world = scene.world or bpy.data.worlds.new("World")
    if scene.world.node_tree is None:
        scene.world.use_nodes = True
    background = next(node for node in scene.world.node_tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*linear("#5A6068"), 1.0)
    background.inputs["Strength"].default_value = 0.55
    for name, place, size, power in (("Key", (-7.0, -9.0, 10.0), 7.0, 1500.0), ("Fill", (9.0, -8.0, 2.0), 9.0, 420.0)):
        light = bpy.data.lights.new(name, "AREA")
        light.energy, light.size = power, size
        obj = add(name, light)
        obj.location = place
        obj.rotation_euler = (-Vector(place)).to_track_quat("-Z", "Y").to_euler()
