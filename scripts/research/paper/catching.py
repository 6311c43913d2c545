"""The figure "catching a tool": a drill thrown by one person and caught by another, as a third one's headset shows it.

The two hands and the tool are streams of their own, at the same rate over the same link, and a mode fills in what
arrives. A hand that holds the tool is one rigid body with it, so nothing between them should move. The hand is tracked
at the wrist, a hand's length from where it holds. All modes are shown at the same moments of the motion; one that looks
ahead gets there later. Seconds, metres.
"""

from __future__ import annotations

from collections.abc import Mapping

import bpy
import numpy as np

from research.making.motions import HAND, THERE
from research.making.rendering import add
from rigid_motion.animation import bake_poses
from rigid_motion.motion import MODES, Poses, interpolate, measure, rms
from rigid_motion.motion.poses import joined
from rigid_motion.motion.quaternions import multiply, rotate
from rigid_motion_batch.analysis.modes import label_of
from rigid_motion_batch.palette import DARK, colour_of
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.scenes import captions, layout, trails
from rigid_motion_batch.scenes.materials import surface
from rigid_motion_batch.scenes.nodes import apply_group
from rigid_motion_batch.scenes.subject import load_subject

from .picture import FAINT, INK, RULE, Sheet
from .table import PHASES

ENGINES = ("lerp_slerp", "dq_sclerp", "pga_lerp", "motor_spline")
RATES = (5, 10, 15, 20)  # updates a second

GRIP = np.array((0.0, -HAND, 0.0))  # where the wrist is, in the axes of the tool that the hand holds
_, RELEASE, CATCH, _ = THERE.moments
WITHDRAWN = 0.45  # seconds that the hands take from the throw to rest, and from rest to the catch
READY = np.array((-0.08, -0.04, -0.04))  # from the catch to where the hand waits for it
END = 2.55  # what comes after is another throw

SHOWN = (0.32, 1.90)  # the moments that are shown, from the first to the last
FPS, SLOWER = 30, 3.0  # of the film
FILM_SIZE = (720, 1004)  # pixels: as the picture, but smaller
TRAIL_SECONDS = 0.7  # of the motion

YAW = np.radians(52.0)
"""By which the scene is turned for the eye, so that neither the throw nor the tool is seen end on."""

MIDDLE = np.array((0.0, 0.40, 1.14))  # of the throw
TITLE = 0.5 - 0.044  # where the first line stands on the sheet
HANDS = {"thrower": "#3A6EA5", "catcher": "#7A5C99"}  # with the colours of their controllers

Bodies = Mapping[str, Poses]
"""The poses of the tool and of both hands, (n,) each."""


# -- in numbers --------------------------------------------------------------------------------------------------------


def bodies(clip: Clip) -> tuple[np.ndarray, Bodies]:
    """Return the times of the first throw of a clip, shape (n,), and the poses then."""
    part = clip.times <= END
    times, tool = clip.times[part], clip.poses[part]
    held = Poses(tool.positions + rotate(tool.quaternions, GRIP), tool.quaternions)
    let_go, caught = _recorded(times)
    throwing, catching = times <= let_go, times >= caught
    ready = Poses(held[catching].positions[:1] + READY, held[catching].quaternions[:1])
    thrown = [*times[throwing], let_go + WITHDRAWN, END], joined((held[throwing], held[[0, 0]]))
    awaited = [times[0] - 1.0, caught - WITHDRAWN, *times[catching]], joined((ready[[0, 0]], held[catching]))
    hands = {
        hand: interpolate(*keys, times, "motor_spline") for hand, keys in zip(HANDS, (thrown, awaited), strict=True)
    }
    return times, {"tool": tool, **hands}


def _recorded(times: np.ndarray) -> tuple[float, float]:
    """Return the last sample before the tool is let go, and the first after it is caught."""
    return float(times[times <= RELEASE][-1]), float(times[times >= CATCH][0])


def ticks_of(times: np.ndarray, rate: float) -> np.ndarray:
    """Return the moments at which a sender sends, from the first sample on."""
    return times[0] + np.arange(int((times[-1] - times[0]) * rate + 1e-6) + 1) / rate


def shown_of(times: np.ndarray, poses: Bodies, rate: float, mode: str, moments: np.ndarray) -> Bodies:
    """Return what a receiver shows of every body at these moments of the motion: its updates, interpolated."""
    ticks = ticks_of(times, rate)
    sent = {body: interpolate(times, of_body, ticks, "dq_sclerp") for body, of_body in poses.items()}
    return {body: interpolate(ticks, of_body, moments, mode) for body, of_body in sent.items()}


def figures(clip: Clip) -> dict[str, dict[int, dict[str, float]]]:
    """Return all modes at all rates."""
    times, poses = bodies(clip)
    return {mode: {rate: view(times, poses, rate, mode) for rate in RATES} for mode in ENGINES}


def view(times: np.ndarray, poses: Bodies, rate: int, mode: str) -> dict[str, float]:
    """Return the figure in numbers, for one mode at one rate, in metres.

    "error" is the RMS shell error of the tool, "slip" the most that it moves in the hand that holds it, between updates
    at all of which it is held; "gap" is between the tool and where the catching hand would hold it when it is caught,
    as the figure shows it, and "mean_gap" on average over senders that begin one after the other, as are the others.
    """
    result = []
    for phase in range(PHASES):
        late = times >= times[0] + phase / (PHASES * rate)
        result.append(_looked_at(times[late], {body: of_body[late] for body, of_body in poses.items()}, rate, mode))
    errors, slips, gaps = zip(*result, strict=True)
    return {
        "error": rms(np.concatenate(errors)),
        "slip": float(np.concatenate(slips).max(initial=0.0)),
        "gap": gaps[0],
        "mean_gap": float(np.mean(gaps)),
    }


def _looked_at(times: np.ndarray, poses: Bodies, rate: int, mode: str) -> tuple[np.ndarray, np.ndarray, float]:
    """Return for a sender that begins with the first of these times: shell errors, slips while held, and the gap."""
    let_go, caught = _recorded(times)
    moments = times[(times >= SHOWN[0]) & (times <= SHOWN[1])]
    shown = shown_of(times, poses, rate, mode, moments)
    truth = interpolate(times, poses["tool"], moments, "dq_sclerp")
    ticks = ticks_of(times, rate)
    segment = np.searchsorted(ticks, moments, side="right") - 1
    first = ticks[np.maximum(segment - MODES[mode].behind, 0)]
    last = ticks[np.minimum(segment + 1 + MODES[mode].ahead, len(ticks) - 1)]
    holding = zip(HANDS, (last <= let_go, first >= caught), strict=True)
    slips = [_apart(shown["tool"], shown[hand])[held] for hand, held in holding]
    then = shown_of(times, poses, rate, mode, np.array((caught,)))
    gap = float(_apart(then["tool"], then["catcher"])[0])
    return measure(moments, shown["tool"], truth).shell, np.concatenate(slips), gap


def _apart(tool: Poses, hand: Poses) -> np.ndarray:
    """Return how far the tool's origin is from where the hand holds it, shape (n,)."""
    return np.linalg.norm(hand.positions - rotate(hand.quaternions, GRIP) - tool.positions, axis=-1)


# -- as a scene --------------------------------------------------------------------------------------------------------


def frame_moments(caught: float) -> np.ndarray:
    """Return the moments that the frames of the film show, that of the catch among them."""
    rate = FPS * SLOWER
    before, after = (np.floor(abs(end - caught) * rate) for end in SHOWN)
    return caught + np.arange(-before, after + 1.0) / rate


def build(clip: Clip, *, film: bool) -> bpy.types.Scene:
    """Return the scene of the film, or of the picture at the catch, with its gaps."""
    times, poses = bodies(clip)
    result = figures(clip)
    moments = frame_moments(_recorded(times)[1])
    sheet = Sheet(1400, 5.6, frames=len(moments) if film else 1)
    sheet.scene.render.fps = FPS
    if film:
        sheet.scene.render.resolution_x, sheet.scene.render.resolution_y = FILM_SIZE
    cast = _Cast(sheet, interpolate(times, poses["tool"], moments, "dq_sclerp"))
    columns = (np.arange(len(RATES)) - 1.5) * 0.243 * sheet.aspect
    sheet.words("Catching a tool", sheet.left, TITLE, 9.0)
    for rate, x in zip(RATES, columns, strict=True):
        sheet.words(f"{rate} updates/s", x, TITLE - 0.036, 7.0, INK, "CENTER")
    for row, mode in enumerate(ENGINES):
        top = TITLE - 0.050 - row * 0.2135
        sheet.card(0.0, top, 2.0 * -sheet.left, 0.0014, RULE)
        sheet.words(label_of(mode), sheet.left, top - 0.025, 6.5)
        for rate, x in zip(RATES, columns, strict=True):
            cast.perform(mode, rate, shown_of(times, poses, rate, mode, moments), sheet.place(x, top - 0.118))
            sheet.words(f"{1e3 * result[mode][rate]['gap']:.0f} mm", x + 0.06, top - 0.055, 6.5, INK, "CENTER")
    _write_legend(sheet, moments)
    sheet.scene.frame_set(1 + int(np.argmax(moments >= CATCH)))
    return sheet.scene


class _Cast:
    """Whoever moves: one tool, its ghost and two hands to a panel, with the paths of the tool."""

    def __init__(self, sheet: Sheet, truth: Poses) -> None:
        self.sheet, self.truth = sheet, truth
        self.tool, self.controller = load_subject("drill"), load_subject("controller")
        self.ghost = surface("What happened", DARK.ghost, alpha=0.45)
        self.hands = {hand: surface(hand, colour) for hand, colour in HANDS.items()}
        self.tools = {mode: surface(f"Mode {mode}", colour_of(mode)) for mode in ENGINES}
        self.trail = trails.trail_group()
        self.frames = np.arange(1.0, len(truth) + 1.0)

    def perform(self, mode: str, rate: int, shown: Bodies, place: np.ndarray) -> None:
        """Show one panel, its middle at a place."""
        name = f"{mode} {rate}"
        seen = {body: _seen(poses, place) for body, poses in {"truth": self.truth, **shown}.items()}
        self._move(name, self.tool, seen["tool"], self.tools[mode])
        self._move(f"{name} truth", self.tool, seen["truth"], self.ghost, whole=True)
        for hand, paint in self.hands.items():
            self._move(f"{name} {hand}", self.controller, seen[hand], paint)
        self._trace(f"{name} path", seen["tool"], 0.010, colour_of(mode))
        self._trace(f"{name} true path", seen["truth"], 0.004, FAINT)

    def _move(
        self, name: str, mesh: bpy.types.Mesh, poses: Poses, paint: bpy.types.Material, *, whole: bool = False
    ) -> None:
        obj = self.sheet.solid(name, mesh, poses[0], paint, whole=whole)
        obj.rotation_mode = "QUATERNION"
        bake_poses(obj, self.frames, poses)

    def _trace(self, name: str, poses: Poses, radius: float, colour: str) -> None:
        obj = add(name, trails.polyline(name, self.frames, poses.positions))
        window = TRAIL_SECONDS * FPS * SLOWER
        apply_group(obj, self.trail, Past=window, Ahead=0.0, Radius=radius, Taper=0.6, Material=self.sheet.ink(colour))


def _seen(poses: Poses, place: np.ndarray) -> Poses:
    """Return poses turned for the eye, around the middle of the throw."""
    turn = layout.yaw_quaternion(YAW)
    return Poses(rotate(turn, poses.positions - MIDDLE) + place, multiply(turn, poses.quaternions))


def _write_legend(sheet: Sheet, moments: np.ndarray) -> None:
    """Write what is what, and the time."""
    low, right, unit = -0.5 + 0.042, -sheet.left, "s"
    entries = [*((colour, f"{hand}'s hand") for hand, colour in HANDS.items()), (DARK.ghost, "what happened")]
    sheet.key(entries, sheet.left, low, 6.5)
    legend = "coloured: the tool as shown, and its path; mm: from tool to hand at the catch"
    sheet.words(legend, sheet.left, low - 0.028, 6.5, FAINT)
    sheet.words(unit, right, TITLE, 9.0, FAINT, "RIGHT")
    frames = np.arange(1.0, len(moments) + 1.0)
    readout = captions.readout_group("Time in s", 2, sheet.ink(INK))
    time = captions.readout("Time", readout, sheet.size(9.0), frames[[0, -1]], moments[[0, -1]])
    sheet.put(time, right - sheet.size(9.0) * (captions.width_of(unit) + 0.3), TITLE)
