"""The scene that compares modes on whole bodies: each mode moves its own figure, side by side, as an ordinary rig.

Like `scene`, with the same frame, header, camera and lights. The bones have keys and modes as an animator would set
them; with the extension, a user can choose other modes; without it, the file still plays.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import bpy
import numpy as np

from rigid_motion import animation
from rigid_motion.motion import Poses, interpolate, shell_error
from rigid_motion_batch.analysis.metrics import key_samples
from rigid_motion_batch.analysis.reconstructions import Reconstruction, identical_modes
from rigid_motion_batch.palette import error_hex, full_colour
from rigid_motion_batch.recordings.rest_bodies import short_names

from . import captions, layout
from .armature import RestFigure
from .bodies import SHADE_COUNT, Bodies, StageMotion, flashes
from .findings import Finding
from .framing import MAX_SMOOTHING_S, Framing, Jointed
from .lanes import Cast
from .materials import ink
from .physique import Physique, body_size, seen_bones
from .scene import LEGEND_SIZE, assemble_scene, begin
from .settings import SceneSettings
from .timeline import Timeline

FADE_FRAMES, FADE_SHARE = 5.0, 0.6
"""Frames that a flash takes to fade; or this fraction of the gap between keys, if that is shorter."""

BAR_WIDTH_RATIO, BAR_GAP_RATIO = 0.24, 0.012
"""The width of the colour bar, and the gap next to it, in units of the frame's height."""

LEAST_TEXT = "shell error 0"

MARGIN_RATIO = 0.04
"""The margin around all joints for the figure's flesh, as a fraction of the figure's size."""

GROUND_RATIO = 0.05
"""The ground visible below the feet, as a fraction of the figure's size."""


def build_body_scene(
    made: Reconstruction, settings: SceneSettings, findings: Sequence[Finding] = ()
) -> bpy.types.Scene:
    """Make the scene of a comparison of whole bodies, in an emptied file.

    Parameters
    ----------
    made : Reconstruction
    settings : SceneSettings
        Subject and deviation are ignored: a body shows itself, unmagnified.
    findings : sequence of Finding
        Further findings to show in the lanes.
    """
    timeline = begin(made, settings)
    lanes_of = identical_modes(made) if settings.distinct else tuple((mode,) for mode in made.keys)
    rest = RestFigure.of(made.clip)
    motion, centre = shown_motion(made, [group[0] for group in lanes_of], timeline, rest)

    shape = Physique.of(made.clip, rest)
    ends = shape.outermost
    recording, *others = (
        Jointed(motion.places(some), motion.carried(some, shape.foremost[ends], shape.vertices[ends]))
        for some in (motion.recording, *motion.modes.values())
    )
    framing = Framing.of(recording, MAX_SMOOTHING_S * settings.fps)
    extent, size = framing.extent(recording, others), body_size(rest)
    extent = replace(
        extent,
        low=extent.low - size * np.array((MARGIN_RATIO, MARGIN_RATIO + GROUND_RATIO, MARGIN_RATIO)),
        high=extent.high + MARGIN_RATIO * size,
    )
    cast = Cast.arranged(
        made,
        settings,
        lanes_of,
        extent,
        _notes(made, motion.modes),
        findings,
        timeline=timeline,
        framing=framing,
        framing_steps=1,
        errors={mode: 1e3 * errors.max(axis=0) for mode, errors in motion.errors.items()},
        joints=tuple(short_names(made.clip.whole_body.joints)),
        worst={mode: errors.argmax(axis=0) for mode, errors in motion.errors.items()},
    )
    full = full_colour(motion.errors.values())
    most = _colour_bar_label(1e3 * full, cast.largest_error)
    reserved = (
        LEGEND_SIZE * (captions.width_of(LEAST_TEXT) + captions.width_of(most)) + BAR_WIDTH_RATIO + 4.0 * BAR_GAP_RATIO
    )
    legend = (
        "grey: recording",
        "ring: the joint that is farthest off",
        f"dots: {'key poses' if made.shared else 'keys'}",
    )
    with registered():
        enter = Bodies(cast, motion, shape, full).enter
        scene = assemble_scene(made, settings, cast, lanes_of, enter, legend, centre, reserved)
    _put_bar(cast, most)
    return scene


def shown_motion(
    made: Reconstruction, modes: Sequence[str], timeline: Timeline, rest: RestFigure
) -> tuple[StageMotion, np.ndarray]:
    """Return the motion on the stage, and the point that became its origin, shape (3,): the recording's centre, on the
    ground.
    """
    clip = made.clip
    times = timeline.times_of(timeline.frames)

    recording = clip.in_blender(interpolate(clip.times, clip.poses, times, "dq_sclerp"))
    skeleton = made.skeleton
    truth = skeleton.in_root_space(recording)
    seen = truth.positions[seen_bones(rest)]
    low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    centre = np.append((low + high)[:2] / 2.0, low[2])

    def around(poses: Poses, joint: int | None = None) -> Poses:
        """Return the poses with the roots (or the given joint, if it is a root) moved by the centre."""
        if joint is not None:
            return Poses(poses.positions - centre, poses.quaternions) if clip.whole_body.parents[joint] < 0 else poses
        positions = poses.positions.copy()
        positions[clip.whole_body.parents < 0] -= centre
        return Poses(positions, poses.quaternions)

    shown = {mode: clip.in_blender(made.filled_in(mode, times)) for mode in modes}
    keys = {
        mode: [
            (timeline.frames_of(clip.times[own]), around(clip.in_blender(clip.poses[joint][own]), joint))
            for joint, own in enumerate(made.keys[mode])
        ]
        for mode in modes
    }
    errors = {
        mode: shell_error(skeleton.in_root_space(poses), truth, made.radii[:, None]) for mode, poses in shown.items()
    }
    moment = {mode: [own for own, _ in some] for mode, some in keys.items()}
    most = max(len(own) for some in moment.values() for own in some)
    fade = float(np.clip(FADE_SHARE * timeline.frames_per_key(most), 1.0, FADE_FRAMES))
    return StageMotion(
        rest_body=clip.whole_body,
        rest=rest,
        recording=around(recording),
        modes={mode: around(poses) for mode, poses in shown.items()},
        keys=keys,
        errors=errors,
        flashes={mode: flashes(own, timeline.frames, fade) for mode, own in moment.items()},
    ), centre


def _notes(made: Reconstruction, modes: Iterable[str]) -> dict[str, str]:
    """Return mode id to its number of keys, if the modes differ in that."""
    kind = "key poses" if made.shared else "keys"
    counts = {
        mode: len(key_samples(keys)) if made.shared else sum(map(len, keys))
        for mode in modes
        if len((keys := made.keys[mode])[0])
    }
    return {} if len(set(counts.values())) == 1 else {mode: f"{count} {kind}" for mode, count in counts.items()}


def _colour_bar_label(full: float, largest: float) -> str:
    """Return the label at the end of the colour bar: its maximum and the largest error, both in millimetres."""
    top = f"{full:.{captions.decimals_for(full)}f} mm"
    return f"{top} and more, to {largest:.{captions.decimals_for(largest)}f}" if largest > 1.005 * full else top


def _put_bar(cast: Cast, most: str) -> None:
    """Add the colour bar of the bones, at the lower right below the lanes."""
    collection, frame = bpy.data.collections["Captions"], bpy.data.objects["Frame"]
    foot, right = -0.5 + layout.MARGIN_RATIO + 0.004, -cast.layout.cells[0].left

    put = partial(captions.put, frame, collection)
    put(captions.words("Largest shade", most, LEGEND_SIZE, cast.faint, "RIGHT"), right, foot)
    left = right - captions.width_of(most) * LEGEND_SIZE - BAR_GAP_RATIO - BAR_WIDTH_RATIO
    for step in range(SHADE_COUNT):
        colour = ink(f"Shade {step}", error_hex(step / (SHADE_COUNT - 1)))
        part = captions.card(f"Shade {step}", BAR_WIDTH_RATIO / SHADE_COUNT, 0.7 * LEGEND_SIZE, colour, corner=0.0)
        put(
            bpy.data.objects.new(part.name, part),
            left + (step + 0.5) * BAR_WIDTH_RATIO / SHADE_COUNT,
            foot + 0.35 * LEGEND_SIZE,
        )
    put(captions.words("Least shade", LEAST_TEXT, LEGEND_SIZE, cast.faint, "RIGHT"), left - BAR_GAP_RATIO, foot)


@contextmanager
def registered() -> Iterator[None]:
    """Register the extension's properties during the block, unless they are registered already."""
    there = hasattr(bpy.types.PoseBone, "rigid_motion")
    if not there:
        animation.register()
    try:
        yield
    finally:
        if not there:
            animation.unregister()
