"""Tests of playing recordings and streams as VMC, and of receiving VMC as streams."""

import socket
import time

import numpy as np
import pytest

from rigid_motion.motion import Poses
from rigid_motion.streams import Receiver, Sender, StreamBody
from rigid_motion_batch.cli import stream
from rigid_motion_batch.streaming.vmc import ToVmc
from tests.live.performing import BODY, TIMES_OF_A_SECOND, dance, frames_of_vmc, in_world
from tests.scripts.bvh_bodies import TIMES, hips_at, write_body
from tests.scripts.processes import ROOT, run_python
from tests.scripts.streaming.test_rooms import LOOPBACK_ADDRESS, PATIENCE, free_port, running

pytestmark = [pytest.mark.blender, pytest.mark.network, pytest.mark.any_blender]


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind((LOOPBACK_ADDRESS, 0))
        return tried.getsockname()[1]


@pytest.fixture
def walk(tmp_path):
    return write_body(tmp_path / "walk.bvh", TIMES[:20], unit=100.0)


@pytest.fixture
def listener():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.setblocking(False)
        yield other


def received(other: socket.socket) -> list[bytes]:
    result = []
    while True:
        try:
            result.append(other.recv(4096))
        except BlockingIOError:
            return result


def test_the_command_plays_a_body_in_real_time(walk, listener):
    place = f"127.0.0.1:{listener.getsockname()[1]}"
    done = run_python(ROOT / "scripts" / "stream.py", "send", walk, "--to-vmc", place)
    assert done.returncode == 0, done.stderr
    datagrams = received(listener)
    assert f"datagrams: {len(datagrams)}" in done.stdout
    receiver = Receiver(0.0)
    for row, datagram in enumerate(datagrams):
        receiver.take(datagram, 0.01 * row)
    (keys,) = receiver.keys()
    assert keys.moments == pytest.approx(np.arange(20) / 30, abs=1e-3)
    (body,) = keys.bodies
    assert body.joints == ("Root", "Hips", "Head", "LeftHand")
    # A BVH's y axis is up in Blender; the size of the body reveals centimetres.
    x, y, z = hips_at(TIMES[:20])[5]
    assert keys.poses["VMC"].positions[1, 5] == pytest.approx([x, -z, y], abs=1e-5)


def test_a_single_body_is_a_tracker(tmp_path, listener):
    hand = tmp_path / "hand.csv"
    hand.write_text(
        "t,x,y,z,qw,qx,qy,qz\n" + "".join(f"{0.05 * row:g},{0.1 * row:g},0,1,1,0,0,0\n" for row in range(5))
    )
    assert stream.main(["send", str(hand), "--to-vmc", f"127.0.0.1:{listener.getsockname()[1]}"]) == 0
    datagrams = received(listener)
    assert len(datagrams) == 5
    assert all(b"/VMC/Ext/Tra/Pos" in datagram for datagram in datagrams)


def test_a_body_without_hips_is_refused(walk, listener, capsys):
    walk.write_text(walk.read_text().replace("Hips", "Tentacle"))
    assert stream.main(["send", str(walk), "--to-vmc", f"127.0.0.1:{listener.getsockname()[1]}"]) == 2
    assert "none of its joints is named as the hips of a person" in capsys.readouterr().err


def test_what_a_receiver_shows_goes_to_another_program(listener):
    ball = StreamBody.rigid("ball")
    sender, receiver, poses = Sender([ball, BODY], rate=60.0), Receiver(), dance(TIMES_OF_A_SECOND)
    to_vmc = ToVmc(listener.getsockname())
    for datagram in sender.describe():
        receiver.take(datagram, 0.0)
    for row, moment in enumerate(TIMES_OF_A_SECOND.tolist()):
        there = {"ball": Poses([[moment, 0.0, 0.0]], [[1.0, 0.0, 0.0, 0.0]]), "dancer": poses[:, row]}
        for datagram in sender.add(moment, there):
            receiver.take(datagram, moment)
        for shown in receiver.show(moment).values():
            to_vmc.show((body, shown.poses[body.name]) for body in shown.bodies)
    to_vmc.close()
    datagrams = received(listener)
    assert any(b"/VMC/Ext/Tra/Pos" in datagram for datagram in datagrams)
    performer = Receiver(0.0)
    for row, datagram in enumerate(datagrams):
        performer.take(datagram, 0.001 * row)
    (keys,) = performer.keys()
    assert keys.poses["VMC"].positions[1, -1] == pytest.approx(in_world(poses).positions[0, -7], abs=0.005)


def test_a_performer_goes_through_a_room_to_another_program(listener):
    room, vmc = ("--room", "studio", "--at", f"{LOOPBACK_ADDRESS}:{free_port()}"), free_udp_port()
    to = f"127.0.0.1:{listener.getsockname()[1]}"
    with (
        running("send", "--from-vmc", vmc, *room, "--user", "ada"),
        running("receive", *room, "--user", "bob", "--to-vmc", to),
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as program,
    ):
        performer, ends = Receiver(0.0), time.monotonic() + PATIENCE
        frames = frames_of_vmc(np.arange(int(60 * PATIENCE)) / 60.0)
        for datagrams in frames:
            for datagram in datagrams:
                program.sendto(datagram, ("127.0.0.1", vmc))
            time.sleep(1.0 / 60.0)
            for datagram in received(listener):
                performer.take(datagram, time.monotonic())
            recorded = performer.keys()
            came = sum(len(keys.moments) for keys in recorded)
            if came or time.monotonic() > ends:
                break
    assert came, "nothing came through the room"
