"""Fixtures for live streams: the extension with a free port in its settings, a clock, and a sender."""

from __future__ import annotations

import socket
from collections.abc import Iterator

import bpy
import pytest

import rigid_motion.live.receiving as receiving
from tests.live.performing import FIRST, FPS, Sent


@pytest.fixture
def port(extension) -> int:
    """A free port, set in the settings of the scene."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind(("127.0.0.1", 0))
        number = tried.getsockname()[1]
    extension.scene.rigid_motion_live.port = number
    extension.scene.rigid_motion_live.delay = 0.0
    return number


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time that Blender reads, as a list of one number to be changed."""
    now = [50.0]
    monkeypatch.setattr(receiving.time, "monotonic", lambda: now[0])
    return now


@pytest.fixture
def live(extension) -> bpy.types.PropertyGroup:
    """The live settings of a scene at the frame where recordings begin."""
    extension.scene.render.fps = FPS
    extension.scene.frame_set(FIRST)
    extension.scene.rigid_motion_live.mode = "lerp_slerp"
    return extension.scene.rigid_motion_live


@pytest.fixture
def sent(port) -> Iterator[Sent]:
    """A sender to a port that Blender listens to."""
    assert bpy.ops.rigid_motion.live_listen() == {"FINISHED"}
    sending = Sent(port)
    yield sending
    sending.close()
