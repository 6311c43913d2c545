"""A tool held by one recorded hand and passed to the other: handed over, or thrown and caught.

Both hands are recorded; the tool is simulated. The tool is rigidly attached to the hand that holds it, flies freely
with the hand's velocities after a throw, and is then rigidly attached to the other hand. The other hand's recording is
translated as a whole, without rotation, to be at the right place at that moment.

Four ways to send the tool and both hands, at the same updates per second:

separate  three streams in the world, as from three devices: their updates are at different moments
together  one stream in the world: all updates are at the same moments
marked    the same, with extra updates of all bodies when one hand releases the tool and when the other gets it
held      the tool in the space of the hand that holds it; in the air it is sent in the world, with extra
          updates at these moments

The tool's error is that of its end, `REACH_M` from the hand. Seconds, metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import permutations
from typing import Any

import numpy as np

from rigid_motion.motion import Poses, interpolate, rms
from rigid_motion.motion.poses import inverse, joined, placed
from rigid_motion.motion.quaternions import rotate, turned, turns_between
from rigid_motion_batch.recordings.clips import Clip

REACH_M = 0.3
GRIP_M, TOOL_END_M = np.array((0.0, 0.0, 0.5 * REACH_M)), np.array((0.0, 0.0, 0.5 * REACH_M))
"""The tool's centre in the space of the hand that has it first, and its end in the space of the tool."""

UPDATES_PER_S = (30, 20, 15, 12)
MODES = ("lerp_slerp", "dq_sclerp", "motor_spline")
WAYS = ("separate", "together", "marked", "held")

CHANGE_INTERVAL_S, SENT_AROUND_S = 0.97, 1.2
"""Seconds between the simulated changes of hands, and the duration sent before and after each."""

FLIGHT_S, GRAVITY_M_PER_S2 = 0.5, np.array((0.0, -9.81, 0.0))
KINDS = {"handed over": 0.0, "caught": -FLIGHT_S}
"""Both kinds of changes of hands, with the time at which the giver releases the tool."""

LATE = {"giver": 0.0, "tool": 1 / 3, "taker": 2 / 3}
"""The delay of each separate stream, as a fraction of the update interval."""

SHOWN_PER_S = 90.0
"""Evaluated moments per second."""

PHASE_STEP_RATIO = 0.618
"""The phase of updates shifts by this fraction of the interval from one change to the next."""

VELOCITY_STEP_S = 0.02
"""The time span, in seconds, over which the velocities of a throw are measured."""


@dataclass(frozen=True)
class Change:
    """A change of hands at time 0: two recordings, and the simulated tool."""

    times: np.ndarray
    giver: Poses
    taker: Poses
    let_go: float
    """The time at which the giver releases the tool: before 0 if it is thrown."""

    phase: float
    """The delay of all updates, as a fraction of the interval."""

    def poses(self, body: str, times: np.ndarray) -> Poses:
        """Return the poses of a body, shape (n,)."""
        if body != "tool":
            return interpolate(self.times, getattr(self, body), times, "dq_sclerp")
        flown = self.flown(times)
        taken = placed(self.poses("taker", times), self.grip)
        return joined((flown[times < 0.0], taken[times >= 0.0]))

    def flown(self, times: np.ndarray) -> Poses:
        """Return the poses of the tool before the taker has it."""
        held = self.given(self.poses("giver", np.minimum(times, self.let_go)))
        if self.let_go == 0.0:
            return held
        before, last = self.given(self.poses("giver", self.let_go + np.array((-VELOCITY_STEP_S, 0.0))))
        since = np.maximum(times - self.let_go, 0.0)[:, None]
        velocity = (last.positions - before.positions) / VELOCITY_STEP_S
        angular = turns_between(before.quaternions, last.quaternions) / VELOCITY_STEP_S
        return Poses(
            held.positions + velocity * since + 0.5 * GRAVITY_M_PER_S2 * since**2,
            turned(held.quaternions, angular * since),
        )

    @staticmethod
    def given(hand: Poses) -> Poses:
        """Return the poses of the tool in the giver's hand, shape (n,)."""
        return Poses(hand.positions + rotate(hand.quaternions, GRIP_M), hand.quaternions)

    @cached_property
    def grip(self) -> Poses:
        """The pose of the tool in the taker's hand, shape ()."""
        return placed(inverse(self.poses("taker", np.zeros(1))), self.flown(np.zeros(1)))[0]


def measure(clips: Iterable[Clip]) -> dict[str, Any]:
    """Return errors of the tool between recorded hands: by kind of change, mode, way and rate, in metres.

    "held" is the most that the tool slips in the hand while held, away from changes of hands, averaged over all
    changes. "change" is the same near the change, relative to the hand that has the tool. "jump" is its jump at the
    change, and "error" the RMS of its error in the world.
    """
    pairs = list(_pairs(clips))
    result: dict[str, Any] = {"hands": sorted(give.name for give, _ in pairs)}
    for kind, let_go in KINDS.items():
        changes = [change for pair in pairs for change in _changes(*pair, let_go)]
        result["changes"] = len(changes)
        result[kind] = {
            mode: {way: {rate: _figures_of(changes, mode, way, rate) for rate in UPDATES_PER_S} for way in WAYS}
            for mode in MODES
        }
    return result


def _pairs(clips: Iterable[Clip]) -> Iterator[tuple[Clip, Clip]]:
    """Yield the two hands of each recording, in both orders: the first one has the tool first."""
    hands: dict[str, list[Clip]] = {}
    for clip in clips:
        stem, _, side = clip.name.rpartition("_")
        if side in ("left", "right"):
            hands.setdefault(stem, []).append(clip)
    for both in hands.values():
        yield from permutations(both, 2)


def _changes(giver: Clip, taker: Clip, let_go: float) -> Iterator[Change]:
    first, last = max(giver.times[0], taker.times[0]), min(giver.times[-1], taker.times[-1])
    times = np.arange(-SENT_AROUND_S, SENT_AROUND_S, 0.5 / SHOWN_PER_S)
    for number, moment in enumerate(np.arange(first + SENT_AROUND_S, last - SENT_AROUND_S, CHANGE_INTERVAL_S)):
        give, take = (interpolate(it.times, it.poses, moment + times, "dq_sclerp") for it in (giver, taker))
        change = Change(times, give, take, let_go, number * PHASE_STEP_RATIO % 1.0)
        off = change.flown(np.zeros(1)).positions - change.poses("taker", np.zeros(1)).positions
        yield replace(change, taker=Poses(take.positions + off, take.quaternions))


def _figures_of(changes: list[Change], mode: str, way: str, rate: float) -> dict[str, float]:
    """Return the figures of all changes, for one mode, way and rate."""
    margin, rows, errors = 2.5 / rate, [], []
    moments = np.arange(-SENT_AROUND_S + margin, SENT_AROUND_S - margin, 1.0 / SHOWN_PER_S)
    for change in changes:
        giver, tool, taker = _shown(change, moments, mode, way, rate)
        end, taken = _end(tool), _end(placed(taker, change.grip))
        off = np.linalg.norm(end - np.where((moments < 0.0)[:, None], _end(change.given(giver)), taken), axis=1)
        off[(moments >= change.let_go) & (moments < 0.0)] = 0.0
        near = (moments > change.let_go - margin) & (moments < margin)
        jump = np.diff(_end(_shown(change, np.array((-1e-9, 0.0)), mode, way, rate)[1]), axis=0)
        rows.append((off[~near].max(), off[near].max(), np.linalg.norm(jump)))
        errors.append(np.linalg.norm(end - _end(change.poses("tool", moments)), axis=1))
    held, changed, jump = np.mean(rows, axis=0)
    return {"held": held, "change": changed, "jump": jump, "error": rms(np.concatenate(errors))}


def _shown(change: Change, moments: np.ndarray, mode: str, way: str, rate: float) -> list[Poses]:
    """Return the poses of giver, tool and taker that a receiver shows at moments (n,)."""
    ticks = -SENT_AROUND_S + (change.phase + np.arange(int(2.0 * SENT_AROUND_S * rate) - 1)) / rate
    if way == "marked":
        ticks = np.union1d(ticks, (change.let_go, 0.0))
    late = LATE if way == "separate" else dict.fromkeys(LATE, 0.0)
    sent = {body: ticks + share / rate for body, share in late.items()}
    giver, tool, taker = (interpolate(own, change.poses(body, own), moments, mode) for body, own in sent.items())
    if way == "held":
        flying, has = (moments >= change.let_go) & (moments < 0.0), moments >= 0.0
        parts = [change.given(giver)[moments < change.let_go], placed(taker, change.grip)[has]]
        if flying.any():
            own = np.array((change.let_go, *ticks[(ticks > change.let_go) & (ticks < 0.0)], 0.0))
            parts.insert(1, interpolate(own, change.flown(own), moments[flying], mode))
        tool = joined(parts)
    return [giver, tool, taker]


def _end(tool: Poses) -> np.ndarray:
    return tool.positions + rotate(tool.quaternions, TOOL_END_M)
