"""The scene that compares modes on a rigid object: one object per mode, side by side, with ordinary keys.

Lanes stand side by side in front of the `Frame`, an empty in the plane of the picture that carries all text.
Everything that changes over time is either keyed or a node group that reads the frame: the saved file plays for
anyone, without scripts. The scene's custom properties store where the recording's origin is.

A rigid object (`solids`) moves under every mode. Its channels are the poses of `timeline.ShownMotion`, within its
lane.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import Any, cast

import bpy
import gpu
import numpy as np
from mathutils import Matrix

from rigid_motion import blender
from rigid_motion.blender import existing
from rigid_motion_batch.analysis.reconstructions import Groups, Reconstruction, identical_modes
from rigid_motion_batch.palette import DARK, linear

from . import captions, layout
from .findings import Finding
from .framing import MAX_SMOOTHING_S, Framing, Solid
from .lanes import Cast, Lane, Lanes, remark_on
from .layout import largest_deviation, magnification, magnified
from .pivots import Pivot
from .settings import MODELS, SceneSettings
from .solids import Solids
from .subject import load_subject, vertices_of
from .timeline import ShownMotion, Timeline

LEGEND_SIZE = 0.032
"""The letter size below the lanes, in units of the frame's height, if there is room."""

CLOCK_RATIO = 0.3
"""The width reserved for the time, in units of the frame's height."""

CARD_SAMPLES = "8"
"""Samples per pixel on a graphics card: they cost hardly any time."""

MIN_EDGE_CONTRAST = 0.05
"""Minimum contrast that the compositor takes as an edge: thin grey lines are edges."""

SOFTENED_PIXEL_RATIO = 0.35
"""How much of a pixel is blurred with its neighbours: small letters are less jagged, and still clear."""


def build_scene(
    reconstruction: Reconstruction, settings: SceneSettings, findings: Sequence[Finding] = ()
) -> bpy.types.Scene:
    """Make the scene of a comparison of modes, in an emptied file.

    Parameters
    ----------
    reconstruction : Reconstruction
    settings : SceneSettings
    findings : sequence of Finding
        Further findings to show in the lanes.

    Raises
    ------
    SubjectError
        If the object to show cannot be loaded.
    """
    timeline = begin(reconstruction, settings)
    motion = ShownMotion.of(reconstruction, timeline)
    lanes_of = identical_modes(reconstruction) if settings.distinct else tuple((mode,) for mode in motion.modes)

    mesh = load_subject(settings.subject)
    smoothing = MAX_SMOOTHING_S * settings.fps * timeline.steps
    outline = layout.outermost(vertices_of(mesh))
    framing = Framing.of(Solid(motion.recording, outline), smoothing)
    enlarged = layout.display_scale(motion.recording.positions - framing.focus, float(np.ptp(outline, axis=0).max()))
    mesh.transform(Matrix.Scale(enlarged, 4))
    outline = outline * enlarged

    size, middle = float(np.max(np.ptp(outline, axis=0))), (outline.min(axis=0) + outline.max(axis=0)) / 2.0
    farthest = max(largest_deviation(poses, motion.recording, outline) for poses in motion.modes.values())
    deviation = settings.deviation or magnification(farthest, size)
    deviated = {mode: magnified(poses, motion.recording, deviation, middle) for mode, poses in motion.modes.items()}
    extent = framing.extent(Solid(motion.recording, outline), [Solid(poses, outline) for poses in deviated.values()])
    cast = Cast.arranged(
        reconstruction,
        settings,
        lanes_of,
        extent,
        _notes(reconstruction),
        findings,
        timeline=timeline,
        framing=framing,
        framing_steps=timeline.steps,
    )
    pivot = Pivot.of(reconstruction, cast, motion.recording[:: timeline.steps], enlarged) if findings else None
    solids = Solids(cast, motion, deviated, mesh, layout.telling_point(motion.recording, outline), pivot)
    legend = _legend(cast, deviation, enlarged, float(reconstruction.radii[0]), crosses=bool(pivot))
    scene = assemble_scene(reconstruction, settings, cast, lanes_of, solids.enter, legend, motion.centre)
    # Our own models are closed: back faces cost time and are never visible.
    existing(existing(scene.display).shading).show_backface_culling = settings.subject in MODELS
    scene["deviation_shown_times"] = deviation
    return scene


def begin(made: Reconstruction, settings: SceneSettings) -> Timeline:
    """Empty the file, name its scene after the clip and the choice of keys, and return the timeline."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender.scene().name = f"{made.clip.name} {made.choice.name}"
    return Timeline.between(float(made.times[0]), float(made.times[-1]), settings.fps, settings.slow_motion)


def assemble_scene(
    made: Reconstruction,
    settings: SceneSettings,
    cast: Cast,
    lanes_of: Groups,
    enter: Callable[[Lane], None],
    legend: Sequence[str],
    centre: np.ndarray,
    reserved: float = 0.0,
) -> bpy.types.Scene:
    """Make the lanes, the text around them, camera and lights.

    Parameters
    ----------
    made : Reconstruction
    settings : SceneSettings
    cast : Cast
    lanes_of : tuple of tuple of str
        The modes of each lane.
    enter : callable
        Adds the moving objects to a lane.
    legend : sequence of str
        The parts of the text that explains the picture.
    centre : array, shape (3,)
        The point of the recording that became the origin.
    reserved : float
        The free space to the right of the legend, in units of the frame's height.
    """
    scene = blender.scene()
    plan = cast.layout
    frame = make_frame(plan.metres)
    lanes = Lanes(cast, frame, enter)
    for modes, cell in zip(lanes_of, plan.cells, strict=True):
        lanes.build(modes, cell)
    slow = [f"{settings.slow_motion:g} times slower than life"] if settings.slow_motion != 1.0 else []
    _make_header(made, "   \u00b7   ".join([*legend, *slow]), cast, frame, reserved)
    make_camera(scene, plan.metres, 2.0 * cast.extent.depth)
    make_lights(scene)
    set_up_render(scene, settings, cast.timeline.count, cast.theme.background)
    scene["recording_centre_m"], scene["recording_start_s"] = centre.tolist(), cast.timeline.start
    return scene


def _notes(reconstruction: Reconstruction) -> dict[str, str]:
    """Return mode id to its rate of keys, if the modes have different numbers of keys."""
    counts = {mode: len(keys) for mode, (keys,) in reconstruction.keys.items() if len(keys)}
    if len(set(counts.values())) == 1:
        return {}
    duration = float(np.ptp(reconstruction.times[[0, -1]]))
    return {mode: f"{(count - 1) / duration:.1f} keys/s" for mode, count in counts.items()}


def _legend(cast: Cast, deviation: float, enlarged: float, radius: float, *, crosses: bool) -> list[str]:
    """Return the parts of the legend that explains the picture."""
    full = f"{cast.largest_error:.{captions.decimals_for(cast.largest_error)}f}"
    drawn = f", {deviation:g} times as far off as it is" if deviation > 1.0 else ""
    error = f"mm: how far any point within {100.0 * radius:g} cm is off (graphs up to {full})"
    larger = [f"object {enlarged:.3g} times its size"] if enlarged > 1.0 else []
    marks = ["dots: keys", *(["crosses: pivot"] if crosses else [])]
    return ["grey: recording", f"colour: mode{drawn}", *marks, error, *larger]


def make_frame(metres: float) -> bpy.types.Object:
    """Return an empty in the plane of the picture, behind everything that moves."""
    frame = bpy.data.objects.new("Frame", None)
    frame.rotation_euler.x = math.pi / 2.0 - layout.ELEVATION_RAD
    frame.scale = (metres, metres, metres)
    frame.empty_display_size = 0.1
    return frame


def _make_header(made: Reconstruction, legend: str, cast: Cast, frame: bpy.types.Object, reserved: float) -> None:
    """Make the text above and below the lanes: clip, rate, findings, time and legend."""
    collection = bpy.data.collections.new("Captions")
    blender.scene().collection.children.link(collection)
    collection.objects.link(frame)
    left, line = cast.layout.cells[0].left, 0.5 - layout.MARGIN_RATIO - 0.042
    right = -left

    put = partial(captions.put, frame, collection)
    name_width = captions.width_of(made.clip.name)
    size = min(0.046, 0.5 * (right - left) / name_width)
    put(captions.words("Clip", made.clip.name, size, cast.ink), left, line)
    rate = captions.words("Choice of keys", made.choice.title, 0.034, cast.faint)
    begins = left + name_width * size + 0.03
    put(rate, begins, line)
    if cast.findings:
        remark = "   \u00b7   ".join(map(remark_on, cast.findings))
        begins += 0.034 * captions.width_of(made.choice.title) + 0.06
        size = min(LEGEND_SIZE, max(0.01, right - CLOCK_RATIO - begins) / captions.width_of(remark))
        put(captions.words("Findings", remark, size, cast.faint), begins, line)
    timeline = cast.timeline
    ends = timeline.frames[[0, -1]]
    decimals = captions.readout_group("Time in s", 2, cast.ink)
    put(captions.readout("Time", decimals, 0.046, ends, timeline.times_of(ends) - timeline.start), right - 0.03, line)
    put(captions.words("Seconds", "s", 0.034, cast.faint, "RIGHT"), right, line)

    size = min(LEGEND_SIZE, (right - left - reserved) / captions.width_of(legend))
    put(captions.words("Legend", legend, size, cast.faint), left, -0.5 + layout.MARGIN_RATIO + 0.004)


def make_camera(scene: bpy.types.Scene, metres: float, depth: float) -> None:
    """Make an orthographic camera that faces the frame, in front of everything that moves."""
    lens = bpy.data.cameras.new("Camera")
    camera = bpy.data.objects.new("Camera", lens)
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.rotation_euler.x = math.pi / 2.0 - layout.ELEVATION_RAD
    camera.location = (-layout.AWAY_AXIS * (depth + metres)).tolist()
    lens.type = "ORTHO"
    lens.sensor_fit = "VERTICAL"
    lens.ortho_scale = metres
    lens.clip_start = 0.5 * metres
    lens.clip_end = depth + 1.5 * metres


def make_lights(scene: bpy.types.Scene) -> None:
    """Make two suns for EEVEE and Cycles. Workbench has its own light."""
    for name, strength, pitch, yaw in (("Key light", 3.0, 40.0, -35.0), ("Fill light", 1.2, 60.0, 50.0)):
        light = cast(bpy.types.SunLight, bpy.data.lights.new(name, "SUN"))
        light.energy = strength
        light.angle = math.radians(5.0)
        obj = bpy.data.objects.new(name, light)
        obj.rotation_euler = (math.radians(pitch), 0.0, math.radians(yaw))
        scene.collection.objects.link(obj)


def set_up_render(scene: Any, settings: SceneSettings, frames: int, background: str = DARK.background) -> None:
    """Set engine, size, colours and encoder of a scene with this number of frames."""
    scene.frame_start, scene.frame_end = 1, frames
    scene.frame_set(1)
    render = scene.render
    render.resolution_x, render.resolution_y = settings.resolution
    render.resolution_percentage = 100
    render.fps, render.fps_base = settings.fps, 1.0
    render.engine = _engine_id(settings.engine)
    render.dither_intensity = 0.0  # Flat colours need none, and encode faster without.
    scene.view_settings.view_transform = "Standard"
    _set_background(scene, background)
    _set_up_video(scene)
    quick = settings.engine == "workbench" and settings.antialiasing is None
    in_software = quick and _is_drawn_in_software()
    scene.display.render_aa = settings.antialiasing or ("OFF" if in_software else CARD_SAMPLES)
    if in_software:
        _smooth_edges(scene)
    shading = scene.display.shading
    shading.light, shading.studio_light = "STUDIO", "paint.sl"
    shading.color_type = "MATERIAL"
    shading.show_object_outline = shading.show_shadows = shading.show_cavity = False
    scene.eevee.taa_render_samples = settings.samples
    if hasattr(scene, "cycles"):  # Cycles is an add-on that may be disabled.
        scene.cycles.samples = settings.samples
        scene.cycles.use_denoising = False


def _is_drawn_in_software() -> bool:
    """Whether Blender renders without a graphics card. Before 5.2, Blender cannot tell without a window."""
    if not hasattr(gpu, "init"):
        return True
    with suppress(SystemError):  # No GPU backend here; a render farm may have one.
        gpu.init()
        return gpu.platform.device_type_get() == "SOFTWARE"
    return True


def _smooth_edges(scene: Any) -> None:
    """Smooth edges in the compositor: without a graphics card, samples would take four times as long."""
    if bpy.app.version >= (5, 0):
        tree: Any = bpy.data.node_groups.new("Smooth edges", "CompositorNodeTree")
        effects = getattr(scene, "compositor_effects", None)  # Blender 5.3 warns about the older single node group.
        if effects is None:
            scene.compositing_node_group = tree
        else:
            effects.new("Smooth edges").node_group = tree
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
        output = tree.nodes.new("NodeGroupOutput")
    else:
        scene.use_nodes = True
        tree = scene.node_tree
        tree.nodes.clear()
        output = tree.nodes.new("CompositorNodeComposite")
    kinds = ("RLayers", "AntiAliasing", "Filter")
    rendered, edges, smooth = (tree.nodes.new(f"CompositorNode{kind}") for kind in kinds)
    edges.inputs["Threshold"].default_value = MIN_EDGE_CONTRAST
    smooth.inputs["Factor" if "Factor" in smooth.inputs else "Fac"].default_value = SOFTENED_PIXEL_RATIO
    for earlier, later in ((rendered, edges), (edges, smooth)):
        tree.links.new(earlier.outputs["Image"], later.inputs["Image"])
    tree.links.new(smooth.outputs[0], output.inputs[0])
    scene.render.compositor_device = "CPU"


def _set_up_video(scene: bpy.types.Scene) -> None:
    """Set output to an H.264 MP4 next to the .blend, encoded by Blender itself."""
    image, video = existing(scene.render.image_settings), existing(scene.render.ffmpeg)
    if hasattr(image, "media_type"):  # Blender 5 needs the kind of output first.
        image.media_type = "VIDEO"
    image.file_format = "FFMPEG"
    image.color_mode = "RGB"
    video.format, video.codec, video.audio_codec = "MPEG4", "H264", "NONE"
    video.constant_rate_factor = "HIGH"  # Thin lines and small letters stay sharp.
    video.ffmpeg_preset = "REALTIME"
    video.gopsize = scene.render.fps
    scene.render.use_file_extension = True
    scene.render.use_stamp_date = False  # The same film is the same file, whenever it is rendered.
    scene.render.filepath = "//comparison.mp4"


def _set_background(scene: bpy.types.Scene, background: str) -> None:
    """Set the background colour, for Workbench and for the other engines."""
    scene.world = bpy.data.worlds.new("World")
    colour = linear(background)
    scene.world.color = colour
    if scene.world.node_tree is None:  # Blender 5 has a node tree already, and warns about `use_nodes`.
        scene.world.use_nodes = True
    nodes = existing(scene.world.node_tree).nodes
    socket: Any = next(node for node in nodes if node.bl_idname == "ShaderNodeBackground").inputs["Color"]
    socket.default_value = (*colour, 1.0)


def _engine_id(engine: str) -> str:
    """Return Blender's identifier of an engine. Before Blender 5, EEVEE had another one."""
    if engine == "eevee":
        return "BLENDER_EEVEE" if bpy.app.version >= (5, 0) else "BLENDER_EEVEE_NEXT"
    return {"workbench": "BLENDER_WORKBENCH", "cycles": "CYCLES"}[engine]
