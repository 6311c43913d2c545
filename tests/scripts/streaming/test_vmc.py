"""Recordings and streams as VMC, and VMC as streams."""

from __future__ import annotations

import socket
import subprocess
import sys
import time

import numpy as np
import pytest

from rigid_motion.live.sockets import Port
from rigid_motion.motion import Poses, Skeleton
from rigid_motion.streams import Body, Receiver, Sender
from rigid_motion.streams.vmc import write_trackers
from rigid_motion_batch.cli import stream
from rigid_motion_batch.places import CHECKOUT
from rigid_motion_batch.streaming.sending import together
from rigid_motion_batch.streaming.vmc import ToVmc, performed, play
from tests.live.performing import BODY, JOINTS, TIMES_OF_A_SECOND, dance, frames_of_vmc, in_world
from tests.scripts.streaming.test_rooms import HERE, PATIENCE, free_port, running

pytestmark = pytest.mark.network

BVH = """HIERARCHY
ROOT Hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg
  {
    OFFSET 10 0 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    JOINT LeftLeg
    {
      OFFSET 0 -80 0
      CHANNELS 3 Zrotation Xrotation Yrotation
      JOINT LeftFoot
      {
        OFFSET 0 -80 0
        CHANNELS 3 Zrotation Xrotation Yrotation
        End Site
        {
          OFFSET 0 0 20
        }
      }
    }
  }
}
MOTION
Frames: 20
Frame Time: 0.0333333
"""
"""A leg in centimetres that swings, 1.6 m."""


def free_udp_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as tried:
        tried.bind((HERE, 0))
        return tried.getsockname()[1]


HAND = "t,x,y,z,qw,qx,qy,qz\n" + "".join(f"{0.05 * row:g},{0.1 * row:g},0,1,1,0,0,0\n" for row in range(5))


@pytest.fixture
def walk(tmp_path):
    path = tmp_path / "walk.bvh"
    path.write_text(BVH + "".join(f"{row} 165 0 0 0 0 0 {2 * row} 0 0 0 0 0 0 0\n" for row in range(20)))
    return path


@pytest.fixture
def hand(tmp_path):
    path = tmp_path / "hand.csv"
    path.write_text(HAND)
    return path


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
    command = [sys.executable, str(CHECKOUT / "scripts" / "stream.py"), "send", str(walk), "--to-vmc"]
    done = subprocess.run([*command, f"127.0.0.1:{listener.getsockname()[1]}"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    datagrams = received(listener)
    assert f"datagrams: {len(datagrams)}" in done.stdout
    receiver = Receiver(0.0)
    for row, datagram in enumerate(datagrams):
        receiver.take(datagram, 0.01 * row)
    (keys,) = receiver.keys()
    assert keys.moments == pytest.approx(np.arange(20) / 30, abs=1e-3)
    (body,) = keys.bodies
    assert body.joints == ("Root", "Hips", "LeftUpperLeg", "LeftLowerLeg", "LeftFoot")
    # Blender has the y axis of a BVH up; centimetres are found out by the size of the body.
    assert keys.poses["VMC"].positions[1, 5] == pytest.approx([0.05, 0.0, 1.65], abs=1e-5)


def test_a_single_body_is_a_tracker(hand, listener):
    assert stream.main(["send", str(hand), "--to-vmc", f"127.0.0.1:{listener.getsockname()[1]}"]) == 0
    datagrams = received(listener)
    assert len(datagrams) == 5
    assert all(b"/VMC/Ext/Tra/Pos" in datagram for datagram in datagrams)


def test_a_body_without_hips_is_refused(walk, listener, capsys):
    walk.write_text(walk.read_text().replace("Hips", "Tentacle"))
    assert stream.main(["send", str(walk), "--to-vmc", f"127.0.0.1:{listener.getsockname()[1]}"]) == 2
    assert "none of its joints is named as the hips of a person" in capsys.readouterr().err


def test_playing_ends_when_it_is_stopped(walk, listener):
    options = stream.parse(["send", str(walk), "--to-vmc", "127.0.0.1:1"])
    (body,), moments, poses = together(stream._read(options.recordings, options))
    began = time.monotonic()
    assert play(body, moments, poses, listener.getsockname(), [15]) == 0
    assert time.monotonic() - began < 0.3


def test_performers_are_bodies_with_samples():
    receiver = Receiver()
    with Port() as port, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for datagrams in frames_of_vmc(TIMES_OF_A_SECOND):
            for datagram in datagrams:
                other.sendto(datagram, ("127.0.0.1", port.number))
        time.sleep(0.01)
        (keys,) = performed(port, receiver)
        assert performed(port, receiver) == []
    (body,), poses = keys.bodies, keys.poses["VMC"]
    assert keys.moments == pytest.approx(TIMES_OF_A_SECOND, abs=1e-6)
    shown = dict(zip(body.joints, Skeleton(body.parents).in_root_space(poses).positions, strict=True))
    for name, places in zip(JOINTS, in_world(dance(TIMES_OF_A_SECOND)).positions, strict=True):
        assert shown[name] == pytest.approx(places, abs=1e-5)
    # What a sender of a room takes.
    assert Sender([body]).add(float(keys.moments[0]), poses[:, 0])


def test_trackers_beside_a_performer_are_bodies_with_samples():
    receiver = Receiver()
    with Port() as port, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        for moment, datagrams in zip(TIMES_OF_A_SECOND, frames_of_vmc(TIMES_OF_A_SECOND), strict=True):
            ball = {"ball": Poses([moment, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0])}
            for datagram in [*write_trackers(ball), *datagrams]:
                other.sendto(datagram, ("127.0.0.1", port.number))
        time.sleep(0.01)
        (keys,) = performed(port, receiver)
    assert [body.name for body in keys.bodies] == ["VMC", "ball"]
    assert keys.poses["ball"].positions[0, :, 0] == pytest.approx(keys.moments, abs=1e-6)
    assert Sender(keys.bodies).add(float(keys.moments[0]), {name: poses[:, 0] for name, poses in keys.poses.items()})


def test_what_a_receiver_shows_goes_to_another_program(listener):
    ball = Body.rigid("ball")
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["send", "a.csv", "--from-vmc", "39539", "--room", "studio"], "and not both"),
        (["send", "--room", "studio"], "give recordings, or --from-vmc"),
        (["send", "a.csv", "--to-vmc", "127.0.0.1:1", "--room", "studio"], "without a room"),
        (["send", "a.csv"], "give --room NAME"),
        (["receive"], "give --room NAME"),
        (["receive", "--room", "studio", "--to-vmc", "192.0.2.1:39540"], "give --network as well"),
        (["send", "a.csv", "--to-vmc", "192.0.2.1:39540"], "give --network as well"),
    ],
)
def test_what_does_not_go_together_is_said(arguments, said, capsys):
    with pytest.raises(SystemExit) as ended:
        stream.parse(arguments)
    assert ended.value.code == 2
    assert said in capsys.readouterr().err


def test_a_performer_goes_through_a_room_to_another_program(listener):
    room, vmc = ("--room", "studio", "--at", f"{HERE}:{free_port()}"), free_udp_port()
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
