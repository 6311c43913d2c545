"""Sockets: when they are opened, and when not."""

from __future__ import annotations

import socket
import subprocess
import sys

import bpy
import pytest

from rigid_motion.live import receiving, sending, sockets

pytestmark = pytest.mark.network

NO_SOCKETS = """
import socket
def refuse(*_, **__):
    raise AssertionError("a socket was opened")
socket.socket = socket.getaddrinfo = refuse
import bpy
import rigid_motion
rigid_motion.register()
bpy.ops.wm.read_homefile(use_empty=True)
rigid_motion.unregister()
print("done")
"""


def test_neither_import_nor_registration_nor_a_new_file_opens_a_socket():
    done = subprocess.run([sys.executable, "-c", NO_SOCKETS], capture_output=True, text=True)
    assert done.stdout.splitlines()[-1:] == ["done"], done.stderr


@pytest.mark.parametrize("host", ["0.0.0.0", "192.168.0.7", "example.org", "::", ""])
def test_beyond_it_blender_has_to_be_allowed_online(host, extension, monkeypatch):
    if bpy.app.online_access:
        pytest.skip("this Blender is allowed online")
    with pytest.raises(sockets.NotAllowed, match=r"Allow Online Access, or use 127\.0\.0\.1"):
        sockets.check_access(host)
    live = extension.scene.rigid_motion_live
    live.host = live.to_host = host
    bpy.ops.object.empty_add()
    for operator in (bpy.ops.rigid_motion.live_listen, bpy.ops.rigid_motion.live_send):
        with pytest.raises(RuntimeError, match="Allow Online Access"):
            operator()
    assert receiving.listening() is None
    assert sending.sending() is None


def test_a_flood_is_taken_in_portions(monkeypatch):
    monkeypatch.setattr(sockets, "MOST_AT_ONCE", 500)
    port = sockets.Port("127.0.0.1")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for _ in range(sockets.MOST_AT_ONCE + 20):
            other.sendto(b"x", ("127.0.0.1", port.number))
    assert len(port.received()) == sockets.MOST_AT_ONCE
    assert 0 < len(port.received()) <= 20
    assert port.received() == []
    port.close()


def test_a_socket_that_only_fails_is_looked_at_no_longer_than_a_flood():
    with sockets.Port("127.0.0.1") as port:
        port._socket.close()
        assert port.received() == []
