"""The figure "catching a tool": a drill thrown by one person and caught by another, as shown by a third one's headset.

The two hands and the tool are separate streams, with the same rate and link; a mode interpolates what arrives. A hand
and the tool it holds are one rigid body, so nothing between them should move. The hand is tracked at the wrist, a
hand's length from the grip. All modes are shown at the same moments of the motion; a mode that looks ahead gets there
later. The modes are compared with holding: the tool in the space of the hand that has it, with an update at release
and one at the catch. Seconds, metres.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import bpy
import numpy as np
from matplotlib.axes import Axes

from research.drawing import FAINT, INK, RULE, Model, column, save, seen, write_legend
from research.making.motions import HAND_M, THROW_THERE
from rigid_motion.motion import MODES, Poses, interpolate, measure, rms
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import multiply, rotate, turned, turns_between
from rigid_motion_batch.analysis.modes import label_of
from rigid_motion_batch.palette import DARK, colour_of
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.scenes import layout
from rigid_motion_batch.scenes.film import render_film
from rigid_motion_batch.scenes.scene import set_up_render
from rigid_motion_batch.scenes.settings import SceneSettings

HELD, MOVED = "held", "lerp_slerp"
"""The tool in the space of the hand, and the mode that then interpolates the hands and the flight."""

ENGINES = ("lerp_slerp", "dq_sclerp", "pga_lerp", "motor_spline", HELD)
PASS_S = 1 / 24
"""Seconds of blending from the flight to the catching hand, for the held tool."""

UPDATES_PER_S = (5, 10, 15, 20)  # updates a second
PHASE_COUNT = 6  # senders of the same rate, started at different times within an interval

GRIP_M = np.array((0.0, -HAND_M, 0.0))  # the wrist, in the axes of the tool that the hand holds
_, RELEASE, CATCH, _ = THROW_THERE.moments
WITHDRAWN_S = 0.45  # seconds that the hands take from the throw to rest, and from rest to the catch
READY_OFFSET_M = np.array((-0.08, -0.04, -0.04))  # from the catch to the place where the hand waits for it
END_S = 2.55  # later samples belong to another throw

SHOWN_S = (0.32, 1.90)  # the first and last moments shown
FILM_FPS, SLOW_MOTION_FACTOR = 30, 3.0  # of the film
FILM_SIZE = (720, 1220)  # pixels: like the picture, but smaller
HEIGHT_PX, ROW_PX = 1700, 299  # pixels: of the picture, and of each mode's row
HEIGHT_M = HEIGHT_PX / 250  # metres spanned by the picture's height
TRAIL_SECONDS = 0.7  # of the motion

YAW_RAD = np.radians(52.0)
"""The rotation of the scene towards the viewer, so that neither the throw nor the tool is seen end on."""

MIDDLE_M = np.array((0.0, 0.40, 1.14))  # the centre of the throw
LABELS = {HELD: "Straight, in the space of the hand"}
COLOURS = {mode: colour_of(mode) for mode in ENGINES} | {HELD: "#009E73"}
HANDS = {"thrower": "#3A6EA5", "catcher": "#7A5C99"}  # the hands, and the colours of their controllers

Bodies = Mapping[str, Poses]
"""The poses of the tool and of both hands, (n,) each."""


# -- in numbers --------------------------------------------------------------------------------------------------------


def bodies(clip: Clip) -> tuple[np.ndarray, Bodies]:
    """Return the times of a clip's first throw, shape (n,), and the poses at these times."""
    part = clip.times <= END_S
    times, tool = clip.times[part], clip.poses[part]
    held = Poses(tool.positions + rotate(tool.quaternions, GRIP_M), tool.quaternions)
    let_go, caught = _recorded(times)
    throwing, catching = times <= let_go, times >= caught
    ready = Poses(held[catching].positions[:1] + READY_OFFSET_M, held[catching].quaternions[:1])
    thrown = [*times[throwing], let_go + WITHDRAWN_S, END_S], joined((held[throwing], held[[0, 0]]))
    awaited = [times[0] - 1.0, caught - WITHDRAWN_S, *times[catching]], joined((ready[[0, 0]], held[catching]))
    hands = {
        hand: interpolate(*keys, times, "motor_spline") for hand, keys in zip(HANDS, (thrown, awaited), strict=True)
    }
    return times, {"tool": tool, **hands}


def _recorded(times: np.ndarray) -> tuple[float, float]:
    """Return the times of the last sample before the tool is released, and of the first after it is caught."""
    return float(times[times <= RELEASE][-1]), float(times[times >= CATCH][0])


def ticks_of(times: np.ndarray, rate: float) -> np.ndarray:
    """Return the sending times of a sender, from the first sample on."""
    return times[0] + np.arange(int((times[-1] - times[0]) * rate + 1e-6) + 1) / rate


def shown_of(times: np.ndarray, poses: Bodies, rate: float, mode: str, moments: np.ndarray) -> Bodies:
    """Return the poses of every body that a receiver shows at these moments: its updates, interpolated."""
    ticks = ticks_of(times, rate)
    sent = {body: interpolate(times, of_body, ticks, "dq_sclerp") for body, of_body in poses.items()}
    used = MOVED if mode == HELD else mode
    shown = {body: interpolate(ticks, of_body, moments, used) for body, of_body in sent.items()}
    return shown | {"tool": _held(times, poses, ticks, shown, moments)} if mode == HELD else shown


def _held(times: np.ndarray, poses: Bodies, ticks: np.ndarray, shown: Bodies, moments: np.ndarray) -> Poses:
    """Return the tool, moved by its current holder at these moments: a hand, none, the other hand."""
    let_go, caught = _recorded(times)
    flying = np.array((let_go, *ticks[(ticks > let_go) & (ticks < caught)], caught))
    updates = interpolate(times, poses["tool"], flying, "dq_sclerp")
    flown = interpolate(flying, updates, np.clip(moments, let_go, caught), MOVED)
    thrown, taken = (_tool_in(shown[hand]) for hand in HANDS)
    before = joined((thrown[moments <= let_go], flown[moments > let_go]))
    share = np.clip((moments - caught) / PASS_S + 1.0, 0.0, 1.0)
    return _blended(before, taken, share * share * (3.0 - 2.0 * share))


def _blended(first: Poses, second: Poses, shares: np.ndarray) -> Poses:
    """Return poses (n,) between two motions, at these fractions (n,): LERP and SLERP."""
    turns = shares[:, None] * turns_between(first.quaternions, second.quaternions)
    positions = first.positions + shares[:, None] * (second.positions - first.positions)
    return Poses(positions, turned(first.quaternions, turns))


def _tool_in(hand: Poses) -> Poses:
    """Return the poses of the tool as held by a hand, shape (n,)."""
    return Poses(hand.positions - rotate(hand.quaternions, GRIP_M), hand.quaternions)


def figures(clip: Clip) -> dict[str, dict[int, dict[str, float]]]:
    """Return the figures of all modes at all rates."""
    times, poses = bodies(clip)
    return {mode: {rate: view(times, poses, rate, mode) for rate in UPDATES_PER_S} for mode in ENGINES}


def view(times: np.ndarray, poses: Bodies, rate: int, mode: str) -> dict[str, float]:
    """Return the figure in numbers, for one mode at one rate, in metres.

    "error" is the tool's RMS shell error; "slip" the most that it moves in the hand that holds it, between updates at
    all of which it is held; "gap" the distance between the tool and where the catching hand would hold it at the catch,
    as in the figure. "mean_gap", "error" and "slip" cover senders started at different times within an interval.
    """
    result = []
    for phase in range(PHASE_COUNT):
        late = times >= times[0] + phase / (PHASE_COUNT * rate)
        result.append(_one_sender(times[late], {body: of_body[late] for body, of_body in poses.items()}, rate, mode))
    errors, slips, gaps = zip(*result, strict=True)
    return {
        "error": rms(np.concatenate(errors)),
        "slip": float(np.concatenate(slips).max(initial=0.0)),
        "gap": gaps[0],
        "mean_gap": float(np.mean(gaps)),
    }


def _one_sender(times: np.ndarray, poses: Bodies, rate: int, mode: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Return shell errors, slips while held, and the gap, for a sender that starts with the first of these times."""
    let_go, caught = _recorded(times)
    moments = times[(times >= SHOWN_S[0]) & (times <= SHOWN_S[1])]
    shown = shown_of(times, poses, rate, mode, moments)
    truth = interpolate(times, poses["tool"], moments, "dq_sclerp")
    ticks = ticks_of(times, rate)
    segment = np.searchsorted(ticks, moments, side="right") - 1
    seen = MODES[MOVED if mode == HELD else mode]
    first = ticks[np.maximum(segment - seen.behind, 0)]
    last = ticks[np.minimum(segment + 1 + seen.ahead, len(ticks) - 1)]
    holding = zip(HANDS, (last <= let_go, first >= caught), strict=True)
    slips = [_grip_distances(shown["tool"], shown[hand])[held] for hand, held in holding]
    then = shown_of(times, poses, rate, mode, np.array((caught,)))
    gap = float(_grip_distances(then["tool"], then["catcher"])[0])
    return measure(moments, shown["tool"], truth).shell, np.concatenate(slips), gap


def _grip_distances(tool: Poses, hand: Poses) -> np.ndarray:
    """Return the distance of the tool's origin from where the hand holds it, shape (n,)."""
    return np.linalg.norm(_tool_in(hand).positions - tool.positions, axis=-1)


# -- as a picture ------------------------------------------------------------------------------------------------------


def frame_moments(caught: float) -> np.ndarray:
    """Return the moments shown by the frames of the film, including that of the catch."""
    rate = FILM_FPS * SLOW_MOTION_FACTOR
    before, after = (np.floor(abs(end - caught) * rate) for end in SHOWN_S)
    return caught + np.arange(-before, after + 1.0) / rate


def pictures(clip: Clip) -> tuple[np.ndarray, Callable[[int], Axes]]:
    """Return the moments of the film, shape (n,), and a function that draws one of its frames."""
    times, poses = bodies(clip)
    result = figures(clip)
    moments = frame_moments(_recorded(times)[1])
    tool, controller = Model.of("drill"), Model.of("controller")
    truth = _turned(interpolate(times, poses["tool"], moments, "dq_sclerp"))
    shown = {
        (mode, rate): {body: _turned(of_body) for body, of_body in shown_of(times, poses, rate, mode, moments).items()}
        for mode in ENGINES
        for rate in UPDATES_PER_S
    }

    def draw(frame: int) -> Axes:
        axes = column(HEIGHT_PX)
        pixels = 1 / HEIGHT_PX
        left, columns = axes.get_xlim()[0] + 17 * pixels, (np.arange(len(UPDATES_PER_S)) - 1.5) * 244 * pixels
        trail = slice(max(frame - round(TRAIL_SECONDS * FILM_FPS * SLOW_MOTION_FACTOR), 0), frame + 1)
        axes.text(left, 0.5 - 62 * pixels, "Catching a tool", fontsize=8.5, color=INK)
        axes.text(-left, 0.5 - 62 * pixels, f"{moments[frame]:.2f} s", fontsize=8.5, color=INK, ha="right")
        for rate, x in zip(UPDATES_PER_S, columns, strict=True):
            axes.text(x, 0.5 - 115 * pixels, f"{rate} updates/s", fontsize=6.5, color=INK, ha="center")
        for row, mode in enumerate(ENGINES):
            top = 0.5 - (132 + row * ROW_PX) * pixels
            axes.axhline(top, 0.016, 0.984, color=RULE, linewidth=0.5)
            axes.text(left, top - 35 * pixels, LABELS.get(mode) or label_of(mode), fontsize=6.5, color=INK)
            for rate, x in zip(UPDATES_PER_S, columns, strict=True):
                place, view = (x, top - 165 * pixels), shown[mode, rate]
                for path, width, colour in (
                    (truth, 0.4, FAINT),
                    (view["tool"], 1.0, COLOURS[mode]),
                ):
                    axes.plot(*seen(path.positions[trail], place, HEIGHT_M).T, color=colour, linewidth=width, zorder=-1)
                tool.draw(axes, truth[frame], place, HEIGHT_M, DARK.ghost, whole=True)
                tool.draw(axes, view["tool"][frame], place, HEIGHT_M, COLOURS[mode], whole=False)
                for hand, colour in HANDS.items():
                    controller.draw(axes, view[hand][frame], place, HEIGHT_M, colour, whole=False)
                axes.text(
                    x + 84 * pixels,
                    top - 73 * pixels,
                    f"{1e3 * result[mode][rate]['gap']:.0f} mm",
                    fontsize=6.5,
                    ha="center",
                )
        entries = [*((colour, f"{hand}'s hand") for hand, colour in HANDS.items()), (DARK.ghost, "what happened")]
        write_legend(axes, entries, left, 59 * pixels - 0.5, 6.5)
        legend = "coloured: the tool as shown, and its path; mm: from tool to hand at the catch"
        axes.text(left, 20 * pixels - 0.5, legend, fontsize=6, color=FAINT)
        return axes

    return moments, draw


def write_picture(clip: Clip, path: Path) -> None:
    """Write the picture of the catch."""
    moments, draw = pictures(clip)
    save(draw(int(np.argmax(moments >= CATCH))), path)


def write_film(clip: Clip, path: Path) -> None:
    """Write all frames, encoded by Blender."""
    moments, draw = pictures(clip)
    with tempfile.TemporaryDirectory() as folder:
        frames = [Path(folder, f"{frame:04}.png") for frame in range(len(moments))]
        for number, frame in enumerate(frames):
            save(draw(number), frame)
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        set_up_render(scene, SceneSettings(resolution=FILM_SIZE, fps=FILM_FPS), len(moments), "#FFFFFF")
        strip = scene.sequence_editor_create().strips.new_image("Frames", str(frames[0]), 1, 1, fit_method="STRETCH")
        for frame in frames[1:]:
            strip.elements.append(frame.name)
        scene.render.use_sequencer = True
        render_film(scene, path)


def _turned(poses: Poses) -> Poses:
    """Return poses rotated towards the viewer, around the centre of the throw."""
    turn = layout.yaw_quaternion(YAW_RAD)
    return Poses(rotate(turn, poses.positions - MIDDLE_M), multiply(turn, poses.quaternions))
