"""Rigify's human at a lever, twice, in Pose Mode, with motion paths: the hand with Screw goes along an arc."""

from __future__ import annotations

import bpy
from mathutils import Vector

from examples import figure
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.mode_pictures import (
    MODE,
    NATIVE,
    SCREW,
    SIZE,
    STAND,
    TEXT,
    VIEW_SCALE,
    WOOD,
    aim,
    label,
    linear,
    settle,
)
from tests.rigs import scenes
from tests.rigs.human import human

SHOWN = ("Torso", "Arm.L (IK)")
"""The bone collections that are to be seen."""

WIDTH, APART, CAMERA = 3.3, 1.65, (80, 0, 62)
"""Metres from side to side and between the two rigs, and the rotation of the view in degrees."""

MID = 13
"""A frame on which the hand is about half-way."""


def scenario(hand: Hand) -> Steps[None]:
    """Two rigs with the same keys, of which the second goes by the screw; their hands and paths."""
    bpy.context.preferences.view.ui_scale = 1.5  # pages show pictures smaller than they are
    yield 1.0
    view = hand.area("VIEW_3D")
    settle(view)
    view.spaces.active.overlay.show_relationship_lines = False
    bpy.data.batch_remove(bpy.data.objects)
    aim(view, CAMERA, (0.2, -0.2, 1.28))
    right = view.spaces.active.region_3d.view_rotation @ Vector((1.0, 0.0, 0.0))
    rigs = []
    for side, title, color in ((-0.5, "Blender", NATIVE), (0.5, "Screw", MODE)):
        rig = at_a_lever(title)
        rig.location = side * APART * right
        label(title, rig.location + Vector((0.2, -0.2, 0.72)) - 0.5 * right, color, view)
        rigs.append(rig)
    yield
    for rig in rigs:
        rig.select_set(True)
    bpy.context.view_layer.objects.active = rigs[-1]
    bpy.ops.object.mode_set(mode="POSE")
    rigs[1].pose.bones["hand_ik.L"].rigid_motion.mode = SCREW
    yield
    bpy.context.scene.frame_set(MID)
    native, screw = (stray(rig) for rig in rigs)
    assert native > 0.14, "with Blender's in-betweens the fist leaves the handle"
    assert screw < 2e-4, "by the screw it does not"
    bpy.context.scene.frame_end = scenes.FRAMES[-1]
    for rig, color in zip(rigs, (NATIVE, MODE), strict=True):
        bpy.context.view_layer.objects.active = rig
        with bpy.context.temp_override(window=hand.window, area=view, region=places.region(view)):
            bpy.ops.pose.paths_calculate(range="SCENE")
        path = rig.pose.bones["hand_ik.L"].motion_path
        path.line_thickness, path.use_custom_color = 4, True
        path.color = path.color_post = linear(color)
        rig.pose.animation_visualization.motion_path.show_frame_numbers = False
    part = places.region(view)
    view.spaces.active.region_3d.view_distance = WIDTH * max(part.width, part.height) / SIZE[0] / VIEW_SCALE
    for text in bpy.data.curves:
        text.size = TEXT * WIDTH
    yield
    yield from hand.picture("lever", places.box_around(places.centre(part), *SIZE))


def at_a_lever(name: str) -> bpy.types.Object:
    """A rig with a body and a lever, keyed; its hand selected."""
    rig = human()
    rig.name = name
    for collection in rig.data.collections_all:
        collection.is_visible = collection.name in SHOWN
    skin = bpy.data.materials.new("Skin")  # seen is the color of the object
    body = figure.clothe(rig, skin)
    rod = figure.boxes("Lever", skin, ((0.0, 0.0, 0.27), (0.03, 0.03, 0.66)))
    stand = figure.boxes("Stand", skin, ((0.0, 0.0, -0.4), (0.10, 0.16, 0.8)))
    stand.parent, stand.location = rig, scenes.PIVOT
    grip = figure.boxes("Grip", skin, ((0.0, 0.0, scenes.LEVER), (0.045, 0.045, 0.12)))
    grip.parent = rod
    for obj, color in ((body, (0.58, 0.62, 0.68)), (rod, WOOD), (grip, (1.0, 0.62, 0.2)), (stand, STAND)):
        obj.color, obj.hide_select = (*linear(color), 1.0), True
    scenes.pull_a_lever(rig, rod)
    for bone in rig.pose.bones:
        select(bone, bone.name == "hand_ik.L")
    return rig


def select(bone: bpy.types.PoseBone, chosen: bool) -> None:
    """Blender 5 has it on the pose bone."""
    (bone if hasattr(bone, "select") else bone.bone).select = chosen


def stray(rig: bpy.types.Object) -> float:
    """How far the fist is off the handle on the frame at hand."""
    bones = rig.evaluated_get(bpy.context.evaluated_depsgraph_get()).pose.bones
    lever = next(child for child in rig.children if child.name.startswith("Lever"))
    handle = scenes.PIVOT + lever.rotation_euler.to_matrix() @ Vector((0.0, 0.0, scenes.LEVER))
    return (bones["DEF-hand.L"].matrix @ scenes.GRIP - handle).length
