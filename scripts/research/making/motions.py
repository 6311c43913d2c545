"""Generated human motions: a hand-held tool that reaches, pivots, is thrown and drives a screw; and a door.

Metres, seconds, radians; right-handed, z up, the person stands at the origin and looks along +y. The tool's own axes
are x to the right, y forward (along the bit), z up, with the origin in the hand: a tool held level points along +y.

The strokes are minimum-jerk (Flash and Hogan, 1985): quintics in time, in the joint angles or in the tool's angles and
positions. Overlapping strokes add up (Flash and Henis, 1991).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import ArrayLike

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import multiply, rotate

from .tracking import turn, unsteadiness

BIT_TIP_M = np.array((0.0, 0.160, 0.062))
"""The tip of the drill's bit, in the tool's axes, in metres."""

CENTRE_OF_MASS = np.array((0.0, 0.010, 0.030))

GRAVITY_M_PER_S2 = np.array((0.0, 0.0, -9.81))

X_AXIS, Y_AXIS, Z_AXIS = np.eye(3)


@dataclass(frozen=True)
class MadeMotion:
    """A motion: its poses at any times (n,), and its duration."""

    duration: float
    poses: Callable[[np.random.Generator, np.ndarray], Poses]


# ---- strokes ---------------------------------------------------------------------------------------------------------


def strokes(times: np.ndarray, onsets: ArrayLike, durations: ArrayLike, amounts: ArrayLike) -> np.ndarray:
    """Return the sum of minimum-jerk strokes at `times` (n,): shape (n,) and the trailing axes of `amounts`.

    Parameters
    ----------
    onsets, durations, amounts : array-like, shapes (k, ...) that broadcast
        Each stroke goes from 0 to its amount; before it is 0, afterwards it stays at its amount.
    """
    onsets, durations, amounts = np.broadcast_arrays(onsets, durations, amounts)
    done = np.clip((times.reshape((-1,) + (1,) * onsets.ndim) - onsets) / durations, 0.0, 1.0)
    return (amounts * done**3 * (10.0 + done * (6.0 * done - 15.0))).sum(axis=1)


@dataclass(frozen=True)
class Knot:
    """A point of a motion: position, velocity and acceleration. At rest, the latter two are 0."""

    time: float
    place: ArrayLike
    velocity: ArrayLike = 0.0
    acceleration: ArrayLike = 0.0


def through(knots: list[Knot], times: np.ndarray) -> np.ndarray:
    """Return the minimum-jerk motion through knots at `times`, shape (n, d), with continuous acceleration.

    It rests before the first knot and after the last. Between two knots of free flight it is a parabola.
    """
    starts = np.array([knot.time for knot in knots])
    place, velocity, acceleration = (
        np.array([np.broadcast_to(getattr(knot, name), np.shape(knots[0].place)) for knot in knots])
        for name in ("place", "velocity", "acceleration")
    )
    segment = np.clip(np.searchsorted(starts, times, side="right") - 1, 0, len(knots) - 2)
    length = np.diff(starts)[segment][:, None]
    u = np.clip((times - starts[segment])[:, None] / length, 0.0, 1.0)
    p0, v0, a0 = place[segment], velocity[segment] * length, acceleration[segment] * length**2
    p1, v1, a1 = place[segment + 1], velocity[segment + 1] * length, acceleration[segment + 1] * length**2
    dp, dv, da = p1 - p0 - v0 - 0.5 * a0, v1 - v0 - a0, a1 - a0  # what is missing at the second knot
    c3 = 10.0 * dp - 4.0 * dv + 0.5 * da
    c4 = -15.0 * dp + 7.0 * dv - da
    c5 = 6.0 * dp - 3.0 * dv + 0.5 * da
    return p0 + u * (v0 + u * (0.5 * a0 + u * (c3 + u * (c4 + u * c5))))


def about(axis: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return rotations by `angles` (n,) about one axis, as quaternions (n, 4)."""
    return turn(angles[:, None] * axis)


def chain(*turns: np.ndarray) -> np.ndarray:
    """Return the product of quaternions, outermost first."""
    return reduce(multiply, turns)


def held_by(point: np.ndarray, places: np.ndarray, quaternions: np.ndarray) -> Poses:
    """Return the poses of a tool whose `point` (3,), in the tool's axes, is at `places` (n, 3)."""
    return Poses(places - rotate(quaternions, point), quaternions)


# ---- reaching --------------------------------------------------------------------------------------------------------

SHOULDER_M = np.array((0.18, 0.0, 1.40))
UPPER_ARM_M, FOREARM_M, HAND_M = 0.30, 0.26, 0.08

JOINT_LAGS = np.array((0.00, 0.00, 0.03, 0.05, 0.08, 0.10, 0.10))
"""Seconds that each joint starts late: the shoulder starts first, the elbow and the wrist follow."""

POSTURES_RAD = np.radians(
    # azimuth, elevation and rotation of the upper arm; elbow flexion; pronation; wrist flexion and deviation
    (
        (-6.0, 8.0, 6.0, 82.0, 0.0, 0.0, 0.0),  # at rest beside the body
        (-30.0, 38.0, -8.0, 58.0, 28.0, 12.0, -8.0),  # the tray, on the right
        (24.0, 58.0, 18.0, 66.0, -18.0, -22.0, 10.0),  # over the site, up and on the left
        (14.0, 56.0, 8.0, 28.0, -34.0, 20.0, 6.0),  # down into it
        (2.0, 80.0, 16.0, 62.0, -62.0, -14.0, -10.0),  # lifted to the light and turned over
        (-6.0, 10.0, 4.0, 84.0, 2.0, 2.0, 0.0),  # back
    )
)
REACH_ONSETS = np.array((0.30, 1.10, 1.88, 2.72, 3.58))
REACH_DURATIONS = np.array((0.78, 0.85, 0.70, 0.80, 0.85))


def reach(rng: np.random.Generator, times: np.ndarray) -> Poses:
    """Return five reaches of an arm with seven joint angles: shoulder, elbow and wrist."""
    angles = POSTURES_RAD[0] + strokes(
        times, REACH_ONSETS[:, None] + JOINT_LAGS, REACH_DURATIONS[:, None], np.diff(POSTURES_RAD, axis=0)
    )
    angles += np.radians(0.25) * unsteadiness(rng, times, len(JOINT_LAGS))
    return arm(angles)


def arm(angles: np.ndarray) -> Poses:
    """Return the pose of the tool for joint angles (n, 7) as in `POSTURES_RAD`; at 0 the arm hangs down."""
    azimuth, elevation, rotation, elbow, pronation, flexion, deviation = angles.T
    upper_arm = chain(about(Z_AXIS, azimuth), about(X_AXIS, elevation), about(Z_AXIS, rotation))
    forearm = multiply(upper_arm, about(X_AXIS, elbow))
    hand = chain(forearm, about(Z_AXIS, pronation), about(X_AXIS, flexion), about(Y_AXIS, deviation))
    grip = (
        SHOULDER_M
        + UPPER_ARM_M * rotate(upper_arm, -Z_AXIS)
        + FOREARM_M * rotate(forearm, -Z_AXIS)
        + HAND_M * rotate(hand, -Z_AXIS)
    )
    # The tool points along the hand; with all angles at 0 the hand hangs down, and this turns the tool level.
    return Poses(grip, multiply(hand, turn(-0.5 * np.pi * X_AXIS)))


# ---- pivoting about the tip ------------------------------------------------------------------------------------------

SITE_M = np.array((0.02, 0.46, 0.98))


def pivot(rng: np.random.Generator, times: np.ndarray) -> Poses:
    """Rest the tip on a point and swing, tilt and roll the handle, in slow sweeps and quick flicks."""
    #         onset, duration, swing, tilt, roll: the last three in degrees
    table = np.array(
        (
            (0.25, 1.10, 46.0, 14.0, 0.0),
            (1.20, 0.60, -62.0, -6.0, 18.0),
            (1.85, 0.38, 34.0, 24.0, -10.0),
            (2.25, 0.32, -30.0, -20.0, 6.0),
            (2.60, 0.36, 28.0, 16.0, -30.0),
            (3.05, 1.20, 6.0, -34.0, 44.0),
            (4.05, 0.45, -16.0, 10.0, -24.0),
        )
    )
    angles = strokes(times, table[:, :1], table[:, 1:2], np.radians(table[:, 2:]))
    angles += np.radians(0.35) * unsteadiness(rng, times, 3)
    slips = 0.25e-3 * unsteadiness(rng, times, 3)
    swing, tilt, roll = angles.T
    quaternions = chain(about(Z_AXIS, swing), about(X_AXIS, np.radians(-48.0) + tilt), about(Y_AXIS, roll))
    return held_by(BIT_TIP_M, SITE_M + slips, quaternions)


# ---- throwing and catching -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Throw:
    """A throw: a hand swings and lets go, the tool flies and rotates about an axis, the other hand catches it."""

    moments: tuple[float, float, float, float]
    """The times of start, release, catch and rest."""

    centres: tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]
    """The centre of mass at these moments."""

    axis: np.ndarray

    angles: tuple[float, float, float, float] = (0.0, -2.0, 366.0, 360.0)
    """Degrees at these moments. In the hands, the tool turns back for the swing, and on after the catch."""

    def knots(self) -> list[Knot]:
        """Return knots of the centre of mass, and of the angle about the axis in radians.

        A hand that releases or catches the tool moves like the free body, up to the acceleration; in flight the angle
        has a constant rate.
        """
        start, release, catch, rest = self.moments
        held, released, caught, resting = np.column_stack((self.centres, np.radians(self.angles)))
        flight, fall = catch - release, np.append(GRAVITY_M_PER_S2, 0.0)
        velocity = (caught - released) / flight - 0.5 * fall * flight
        return [
            Knot(start, held),
            Knot(release, released, velocity, fall),
            Knot(catch, caught, velocity + fall * flight, fall),
            Knot(rest, resting),
        ]

    def airborne(self, times: np.ndarray) -> np.ndarray:
        """Return 1 in flight and 0 in a hand, with 40 ms transitions for release and grip, shape (n,)."""
        _, release, catch, _ = self.moments
        return strokes(times, [release - 0.04, catch], [0.04, 0.04], [1.0, -1.0])


RIGHT_HAND, LEFT_HAND = (0.27, 0.38, 1.08), (-0.25, 0.40, 1.08)
THROW_THERE = Throw(
    (0.32, 0.76, 1.34, 1.80), (RIGHT_HAND, (0.24, 0.41, 1.18), (-0.27, 0.40, 1.15), LEFT_HAND), axis=X_AXIS
)
THROW_BACK = Throw(
    (2.20, 2.66, 3.28, 3.76),
    (LEFT_HAND, (-0.22, 0.42, 1.20), (0.30, 0.38, 1.14), RIGHT_HAND),
    axis=np.array((12.0, 4.0, -3.0)) / 13.0,
)


def throw(rng: np.random.Generator, times: np.ndarray) -> Poses:
    """Throw from the right hand to the left and back: wind-up, release, a tumble in free flight, catch, absorption."""
    places = through(THROW_THERE.knots() + THROW_BACK.knots(), times)[:, :3]
    turns = [about(way.axis, through(way.knots(), times)[:, 3]) for way in (THROW_THERE, THROW_BACK)]
    poses = held_by(CENTRE_OF_MASS, places, chain(*turns, turn(np.radians(12.0) * X_AXIS)))

    grasp = 1.0 - THROW_THERE.airborne(times) - THROW_BACK.airborne(times)
    sway = grasp[:, None] * unsteadiness(rng, times, 6)
    turned = multiply(poses.quaternions, turn(np.radians(0.4) * sway[:, 3:]))
    return Poses(poses.positions + 0.8e-3 * sway[:, :3], turned)


# ---- driving a screw -------------------------------------------------------------------------------------------------

SCREW_PITCH_M = 2.75e-3
"""The advance per turn of a 6.5 mm cancellous bone screw."""


def screw(rng: np.random.Generator, times: np.ndarray) -> Poses:
    """Drive a screw a little over two turns in six strokes of the wrist, with a rest for each new grip."""
    onsets = np.array((0.25, 0.98, 1.70, 2.42, 3.12, 3.84))
    durations = np.array((0.56, 0.54, 0.52, 0.54, 0.54, 0.56))
    roll = strokes(times, onsets, durations, np.radians((118.0, 132.0, 140.0, 136.0, 128.0, 112.0)))
    roll += np.radians(0.4) * unsteadiness(rng, times, 1)[:, 0]
    # The hand pushes slightly off the axis, so the tool leans, and the lean rotates with the screw.
    lean = np.radians(1.4) * np.stack((np.cos(roll), np.zeros_like(roll), np.sin(roll)), axis=-1)
    lean += np.radians(0.3) * unsteadiness(rng, times, 3) * (1.0, 0.0, 1.0)
    aim, depth = turn(np.radians(-38.0) * X_AXIS), SCREW_PITCH_M * roll / (2.0 * np.pi)
    return held_by(
        BIT_TIP_M, SITE_M + depth[:, None] * rotate(aim, Y_AXIS), chain(aim, turn(lean), about(Y_AXIS, roll))
    )


# ---- a tool in a hand ------------------------------------------------------------------------------------------------

GRIP = Poses(np.array((0.02, 0.26, 0.07)), turn(np.radians((20.0, -8.0, 35.0))))
"""The pose of a long tool's marker, relative to that of the hand that holds it."""


def hold(rng: np.random.Generator, times: np.ndarray) -> Poses:
    """Return the poses of a hand that swings a long tool over the site, turns it over and back, and shakes it."""
    #         onset, duration, sideways, forward, up in metres, then swing, tilt, roll in degrees
    table = np.array(
        (
            (0.30, 0.80, -0.22, 0.12, 0.10, 60.0, 15.0, -20.0),
            (1.05, 0.55, 0.30, 0.04, -0.12, -95.0, -30.0, 40.0),
            (1.60, 0.70, -0.10, -0.06, 0.20, 40.0, 45.0, 110.0),
            (2.30, 0.40, 0.12, 0.05, -0.18, -20.0, -55.0, -70.0),
            (2.68, 0.30, -0.10, 0.00, 0.10, 15.0, 35.0, -30.0),
            (2.96, 0.30, 0.10, 0.00, -0.10, -15.0, -35.0, 30.0),
            (3.30, 0.90, -0.10, -0.15, 0.00, 15.0, 25.0, -60.0),
        )
    )
    moved = strokes(times, table[:, :1], table[:, 1:2], table[:, 2:])
    sway = unsteadiness(rng, times, 6)
    swing, tilt, roll = np.radians(moved[:, 3:] + 0.35 * sway[:, 3:]).T
    quaternions = chain(about(Z_AXIS, swing), about(X_AXIS, np.radians(-20.0) + tilt), about(Y_AXIS, roll))
    return Poses(np.array((0.12, 0.30, 1.10)) + moved[:, :3] + 0.8e-3 * sway[:, :3], quaternions)


def held_in(hand: Poses, grip: Poses) -> Poses:
    """Return the poses (n,) of an object that a hand holds in that grip."""
    places = hand.positions + rotate(hand.quaternions, grip.positions)
    return Poses(places, multiply(hand.quaternions, grip.quaternions))


HOLD = "hold"
"""The recording of two devices: a hand, and the tool it holds."""

# ---- a door ----------------------------------------------------------------------------------------------------------

HINGE_M, DOOR_EDGE_M = np.array((-0.40, 0.70, 1.00)), np.array((-0.80, 0.0, 0.0))
"""The hinge in the world, and relative to the tracker at the door's edge."""


def door(_: np.random.Generator, times: np.ndarray) -> Poses:
    """Push a door open, further to the wall, then slam it; it springs back a little."""
    #         onset, duration, degrees
    table = np.array(((0.3, 0.8, 100.0), (1.25, 0.6, 70.0), (2.3, 0.75, -170.0), (3.05, 0.35, 14.0), (3.4, 0.4, -14.0)))
    opened = strokes(times, table[:, :1], table[:, 1:2], np.radians(table[:, 2:]))
    return held_by(DOOR_EDGE_M, np.broadcast_to(HINGE_M, (len(times), 3)), about(Z_AXIS, opened[:, 0]))


OTHER_MOTIONS = {HOLD: MadeMotion(4.6, hold), "door": MadeMotion(4.6, door)}
"""Motions that the paper's page leaves out."""

MOTIONS = {
    "reach": MadeMotion(4.7, reach),
    "pivot": MadeMotion(4.7, pivot),
    "throw": MadeMotion(4.1, throw),
    "screw": MadeMotion(4.6, screw),
}
