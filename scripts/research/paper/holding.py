"""A tool that is held in one recorded hand and goes to the other: handed over, or thrown and caught.

Both hands are recorded; the tool is made up. It is one rigid body with the hand that holds it, flies freely when it
is thrown, with the hand's velocities, and is one rigid body with the other hand from then on. So that the other hand is
there at that moment, its recording is moved as a whole, without a turn.

Four ways to send it, at the same updates a second of both hands and the tool:

separate  three streams in the world, as of three devices: their updates are not of the same moments
together  one stream in the world: all updates are of the same moments
marked    the same, and all bodies are sent once more at the moments at which a hand lets the tool go and has it
held      the tool in the space of the hand that holds it; in the air it is sent in the world, and once more
          at those moments

A tool is as far off as its end is, `REACH_M` from the hand. Seconds, metres.
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
"""The tool's middle in the space of the hand that has it first, and its end in the space of the tool."""

UPDATES_PER_S = (30, 20, 15, 12)
MODES = ("lerp_slerp", "dq_sclerp", "motor_spline")
WAYS = ("separate", "together", "marked", "held")

CHANGE_INTERVAL_S, SENT_AROUND_S = 0.97, 1.2
"""From one change of hands to the next that is tried, and what is sent before and after it."""

FLIGHT_S, GRAVITY_M_PER_S2 = 0.5, np.array((0.0, -9.81, 0.0))
KINDS = {"handed over": 0.0, "caught": -FLIGHT_S}
"""Both kinds of changes of hands, and when the giver lets go."""

LATE = {"giver": 0.0, "tool": 1 / 3, "taker": 2 / 3}
"""By what share of the interval updates of separate streams are late."""

SHOWN_PER_S = 90.0
"""Moments a second that are looked at."""

PHASE_STEP_RATIO = 0.618
"""Of the interval, by which one sender is later than that of the change before."""

VELOCITY_STEP_S = 0.02
"""Over which the velocities are measured with which a tool is thrown."""


@dataclass(frozen=True)
class Change:
    """A change of hands at the time 0: two recordings, and the tool that is made up."""

    times: np.ndarray
    giver: Poses
    taker: Poses
    let_go: float
    """When the giver has it no more: before 0 where it is thrown."""

    phase: float
    """By what share of the interval all updates are late."""

    def poses(self, body: str, times: np.ndarray) -> Poses:
        """Return where a body is, shape (n,)."""
        if body != "tool":
            return interpolate(self.times, getattr(self, body), times, "dq_sclerp")
        flown = self.flown(times)
        taken = placed(self.poses("taker", times), self.grip)
        return joined((flown[times < 0.0], taken[times >= 0.0]))

    def flown(self, times: np.ndarray) -> Poses:
        """Return where the tool is before the taker has it."""
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
        """Return where the tool is in the giver's hand, shape (n,)."""
        return Poses(hand.positions + rotate(hand.quaternions, GRIP_M), hand.quaternions)

    @cached_property
    def grip(self) -> Poses:
        """The tool in the taker's hand, shape ()."""
        return placed(inverse(self.poses("taker", np.zeros(1))), self.flown(np.zeros(1)))[0]


def measure(clips: Iterable[Clip]) -> dict[str, Any]:
    """Return what becomes of the tool between recorded hands: by kind of change, mode, way and rate, in metres.

    "held" is how far it slips at most in the hand while it is held, away from changes of hands: the mean of that over
    all changes. "change" is the same near the change, where it is off the hand that has it. "jump" is how far it jumps
    there, and "error" the RMS of how far it is off in the world.
    """
    pairs = list(_pairs(clips))
    result: dict[str, Any] = {"hands": sorted(give.name for give, _ in pairs)}
    for kind, let_go in KINDS.items():
        changes = [change for pair in pairs for change in _changes(*pair, let_go)]
        result["changes"] = len(changes)
        result[kind] = {
            mode: {way: {rate: _looked_at(changes, mode, way, rate) for rate in UPDATES_PER_S} for way in WAYS}
            for mode in MODES
        }
    return result


def _pairs(clips: Iterable[Clip]) -> Iterator[tuple[Clip, Clip]]:
    """Yield the two hands of each recording, either of which has the tool first."""
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


def _looked_at(changes: list[Change], mode: str, way: str, rate: float) -> dict[str, float]:
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
    """Return what a receiver shows of the bodies at moments (n,)."""
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
