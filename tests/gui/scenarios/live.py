"""Live streaming from another program: a performer is received, recorded and undone while it goes on."""

from __future__ import annotations

import socket
import time
from importlib import import_module

import bpy
import numpy as np

from rigid_motion.streams import Sender
from tests.gui import places
from tests.gui.driver import Hand, Steps
from tests.gui.keyed import extension
from tests.live.performing import BODY, dance, heads_of, new_rig

RATE = 60
MOVED = 0.01
"""A dancing performer soon moves more than this, in metres."""


class Program:
    """A sending program: a performer, in real time."""

    def __init__(self, port: int) -> None:
        self._socket, self._to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), ("127.0.0.1", port)
        self._sender = Sender([BODY], rate=RATE)
        self._began, self._sent = time.monotonic(), 0
        # Blender identifies timers by identity, and a bound method is a new object each time.
        self._timer = self._send
        bpy.app.timers.register(self._timer, persistent=True)

    def _send(self) -> float:
        due = int((time.monotonic() - self._began) * RATE)
        for row in range(self._sent, due):
            poses = dance(np.array([row / RATE]))
            for datagram in self._sender.add(row / RATE, {BODY.name: poses[:, 0]}):
                self._socket.sendto(datagram, self._to)
        self._sent = due
        return 0.5 / RATE

    def close(self) -> None:
        bpy.app.timers.unregister(self._timer)
        self._socket.close()


def free_port() -> int:
    """Return a free UDP port, which no other window of the tests uses."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind(("127.0.0.1", 0))
        return int(tried.getsockname()[1])


def rig() -> bpy.types.Object:
    """Return the rig, looked up each time: undo replaces it."""
    return bpy.data.objects["Rig"]


def scenario(hand: Hand) -> Steps[None]:
    receiving = import_module(f"{extension().module}.live.receiving")
    view = hand.area("VIEW_3D")
    bpy.data.batch_remove(bpy.data.objects)
    new_rig()
    rig().show_in_front = True
    live = bpy.context.scene.rigid_motion_live
    live.armature, live.port = rig(), free_port()
    space = view.spaces.active.region_3d
    space.view_location, space.view_distance = (0.2, 0.0, 1.1), 4.0
    bpy.ops.ed.undo_push(message="Rig")
    yield from hand.open_sidebar(view, "Animation")
    assert receiving.listening() is None, "nothing listens until it is asked to"

    header = x, y = yield from hand.find_button(view, "UI", "rigid_motion.live_listen", narrow=True)
    yield from hand.click((x + 60, y))  # the header, to unfold the panel
    yield from hand.click(header)
    program = Program(live.port)
    yield from hand.wait_until(lambda: receiving.listening() and receiving.listening().joints, "the performer is heard")
    bpy.ops.rigid_motion.live_record()
    yield 1.0
    yield from hand.picture("live")
    bpy.ops.rigid_motion.live_finish("EXEC_DEFAULT", True)
    yield from hand.wait_until(lambda: rig().animation_data.action, "the recording is in an action")
    # Undo and redo by keys while the performer goes on.
    yield from hand.hover(places.centre(places.region(view)))
    yield from hand.press("Z", ctrl=True)
    yield from hand.wait_until(lambda: not rig().animation_data, "one undo takes it back")
    before = heads_of(rig())
    yield from hand.wait_until(
        lambda: np.abs(heads_of(rig()) - before).max() > MOVED, "the performer still moves the rig"
    )
    yield from hand.press("Z", ctrl=True, shift=True)
    yield from hand.wait_until(lambda: rig().animation_data.action, "redone")
    yield from hand.click(header)
    yield from hand.wait_until(lambda: receiving.listening() is None, "the button of the header closes the port")
    program.close()
