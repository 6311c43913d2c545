"""Tests of choosing the shown moment for a slow viewport, in the time of the test."""

from __future__ import annotations

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.streams import Receiver
from rigid_motion.streams.playing import MAX_FORWARD_RATIO, Fading
from rigid_motion.streams.vmc import write

DELAY, RATE = 0.1, 60.0


@pytest.mark.parametrize("fps", [30.0, 72.0, 240.0])
@pytest.mark.parametrize("speed", [0.3, 1.0, 4.0])
def test_what_was_shown_too_far_ahead_waits_and_does_not_go_back(speed: float, fps: float) -> None:
    """A hand is shown 10 cm too far and turned 0.5 radians too much, and then the true pose arrives."""
    fading, places, turns = Fading(), [], []
    for now in np.arange(-0.2, 1.0 + 1.0 / speed, 1.0 / fps).tolist():
        there, half = speed * now, 0.5 * speed * now
        if now >= 0.0 and not places:
            fading.changed(Poses([[there - 1.0 / fps * speed, 0.0, 0.0]], [[np.cos(half), np.sin(half), 0.0, 0.0]]))
        ahead = 0.0 if now >= 0.0 else 0.1
        half += 0.25 if ahead else 0.0
        pose = fading.show(Poses([[there + ahead, 0.0, 0.0]], [[np.cos(half), np.sin(half), 0.0, 0.0]]), now)
        if now >= 0.0:
            places.append(pose.positions[0, 0] - there)
            turns.append(2.0 * np.arctan2(*pose.quaternions[0, 1::-1]) - 2.0 * half)
    step = speed / fps
    assert np.diff(places).min() >= -step
    assert np.diff(np.unwrap(turns)).min() >= -step - 1e-9
    # The wait lasts as long as the motion takes to catch up.
    for off, ahead, most in ((places, 0.1, 0.005), (np.unwrap(turns), 0.5, 0.02)):
        assert np.abs(off[round((0.4 + ahead / MAX_FORWARD_RATIO / speed) * fps) :]).max() < most


@pytest.mark.parametrize("looks", [0.02, 0.3, 0.4, 0.7, 1.0, 1.2, 1.7])
def test_the_picture_goes_on_however_seldom_somebody_looks(looks: float) -> None:
    receiver, sent, shown = Receiver(DELAY), 0, []
    times = np.arange(0.0, 20.0, looks)
    for now in times.tolist():
        while sent / RATE <= now:
            hips = Poses([np.sin(sent / RATE), 0.0, 1.0], [1.0, 0.0, 0.0, 0.0])
            for datagram in write(sent / RATE, {"Hips": hips}):
                receiver.take(datagram, now)
            sent += 1
        shown += receiver.show(now).values()
    moments = np.array([what.moment for what in shown])
    late = times[-len(moments) :] > 8.0
    behind = (times[-len(moments) :] - moments)[late]
    assert np.diff(moments[late]).min() > 0.9 * looks
    # The shown moment has been received, and is no older than necessary.
    assert behind.min() >= DELAY
    assert behind.max() <= DELAY + looks + 2.0 / RATE
    places = np.array([what.poses["VMC"].positions[1, 0] for what in shown])
    np.testing.assert_allclose(places[late], np.sin(moments[late]), atol=1e-3)
