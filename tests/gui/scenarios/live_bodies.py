"""A performer that another program sends moves a rig; it is recorded and played again."""

from __future__ import annotations

import socket
import time
from importlib import import_module

import bpy
import numpy as np

from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.scenarios.panel_notes import extension
from tests.live.performing import dance, frames_of_vmc, heads_of, in_world, new_rig

RATE = 60

TOLERANCE = 0.002
WITHIN = 0.005
"""Metres: the live picture goes straight from sample to sample, of which a busy machine leaves some out."""

MOVED = 0.01
"""Metres by which a performer that dances soon has moved."""


class Program:
    """Another program, that sends a performer in real time."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to = ("127.0.0.1", port)
        self._began, self._sent = time.monotonic(), 0
        # Blender tells timers apart by identity, and a method is another object each time.
        self._timer = self._send
        bpy.app.timers.register(self._timer, persistent=True)

    def _send(self) -> float:
        due = int((time.monotonic() - self._began) * RATE)
        for row in range(self._sent, due):
            for datagram in self.datagrams(row):
                self._socket.sendto(datagram, self._to)
        self._sent = due
        return 0.5 / RATE

    def datagrams(self, row: int) -> list[bytes]:
        (frame,) = frames_of_vmc(np.array([row / RATE]))
        return frame

    def close(self) -> None:
        bpy.app.timers.unregister(self._timer)
        self._socket.close()


def free_port() -> int:
    """Return a UDP port that no other window of the tests listens to."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


def rig() -> bpy.types.Object:
    """The rig, asked for anew each time: undo replaces it."""
    return bpy.data.objects["Rig"]


def off_by(moment: float) -> float:
    """Metres by which the rig is not where the performer was."""
    world = in_world(dance(np.array([moment]))).positions[:, 0]
    return float(np.linalg.norm(heads_of(rig()) - world, axis=1).max())


def scenario(hand: Hand) -> Steps[None]:
    receiving = import_module(f"{extension().module}.live.receiving")
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    new_rig()
    rig().select_set(True)
    rig().show_in_front = True
    live = bpy.context.scene.rigid_motion_live
    live.armature, live.tolerance, live.port = rig(), TOLERANCE, free_port()
    space = view.spaces.active.region_3d
    space.view_location, space.view_distance = (0.0, 0.0, 0.9), 4.0
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.open_sidebar(view, "Animation")
    assert receiving.listening() is None, "nothing listens until it is asked to"

    header = x, y = yield from hand.find_button(view, "UI", "rigid_motion.live_listen", narrow=True)
    yield from hand.click((x + 60, y))  # the header, to unfold the panel
    yield from hand.click(header)
    program = Program(live.port)
    yield from hand.wait_until(lambda: receiving.listening() and receiving.listening().joints, "the performer is heard")
    worst = 0.0
    for _ in range(20):
        yield 0.05
        (heard,) = receiving.listening()._heard.values()
        worst = max(worst, off_by(heard.moment))
    assert worst < WITHIN, f"{1000 * worst} mm off while live"
    yield from hand.picture("live")

    bpy.ops.rigid_motion.live_record()
    yield 2.0
    (heard,) = receiving.listening()._heard.values()
    origin = heard.origin
    bpy.ops.rigid_motion.live_finish("EXEC_DEFAULT", True)
    yield from hand.wait_until(lambda: rig().animation_data and rig().animation_data.action, "there are keys")
    # Undone and done again by keys, while the performer goes on.
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(
        lambda: not (rig().animation_data and rig().animation_data.action), "the keys are undone"
    )
    before = heads_of(rig())
    yield from hand.wait_until(
        lambda: np.abs(heads_of(rig()) - before).max() > MOVED, "the performer still moves the rig"
    )
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: rig().animation_data and rig().animation_data.action, "the keys are there again")
    yield from hand.click(header)
    yield from hand.wait_until(lambda: receiving.listening() is None, "the button of the header closes the port")
    program.close()

    first, last = (int(frame) for frame in rig().animation_data.action.frame_range)
    fps = bpy.context.scene.render.fps

    errors = []
    for frame in range(first + 1, last):
        bpy.context.scene.frame_set(frame)
        errors.append(off_by(origin + (frame - first) / fps))
    assert max(errors) < WITHIN, f"{1000 * max(errors)} mm off when played again"
    yield from hand.picture("played-again")
