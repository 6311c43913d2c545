"""Real processes over loopback: what one sends, others show, and a relay passes on; nobody is harmed by strangers."""

from __future__ import annotations

import re
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from rigid_motion.motion import interpolate, shell_error
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.streaming import PACKINGS, TWISTS, Packets, PlayOut
from rigid_motion_batch.streaming.hearing import Hearing
from rigid_motion_batch.streaming.limits import EACH, SILENCE, STREAMS, Cookies
from rigid_motion_batch.streaming.packets import sealed
from rigid_motion_batch.streaming.relay import USERS, Relay
from rigid_motion_batch.streaming.wire import BEAT, CHALLENGE, KEY, Terms, beat, bye, challenge, changed, hello, read
from tests.scripts.streaming.motions import swinging
from tests.thoroughness import THOROUGH

COMMAND = (sys.executable, str(Path(__file__).resolve().parents[2] / "scripts" / "stream.py"))

PATIENCE = 120.0
"""Seconds that nothing takes, however busy the machine is."""

MARGIN = ("--margin", "3")
"""So that a busy machine is in time: a second more is no error."""


def has_ipv6() -> bool:
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as tried:
            tried.bind(("::1", 0))
    except OSError:
        return False
    return True


LOOPBACKS = ["127.0.0.1", *["::1"] * has_ipv6()]


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """A motion of two seconds."""
    return write(tmp_path / "hand.csv", 2.0)


@pytest.fixture
def long_recording(tmp_path: Path) -> Path:
    """One that has not ended before a busy machine has got to it."""
    return write(tmp_path / "long.csv", PATIENCE)


def write(path: Path, seconds: float) -> Path:
    """Write a motion as a logger would."""
    times, poses = swinging(3, seconds)
    rows = np.column_stack((times, poses.positions, poses.quaternions)).tolist()
    path.write_text("\n".join(["t,x,y,z,qw,qx,qy,qz", *(",".join(map(repr, row)) for row in rows)]))
    return path


class Running:
    """A command that runs, of which all that it prints is kept."""

    def __init__(self, *arguments: object) -> None:
        self.process = subprocess.Popen(
            [*COMMAND, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.lines: list[str] = []

    def address(self) -> str:
        """Where it is heard, once it says so."""
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE)
        assert ready, "it does not begin"
        line = self.process.stdout.readline()
        assert line, self.process.stderr.read()
        return line.split()[-1]

    def done(self, code: int = 0) -> str:
        printed, said = self.process.communicate(timeout=PATIENCE)
        assert self.process.returncode == code, said
        return printed


@contextmanager
def running(*arguments: object) -> Iterator[Running]:
    one = Running(*arguments)
    try:
        yield one
    finally:
        one.process.kill()
        one.process.communicate()


def number(printed: str, name: str) -> int:
    return int(re.search(rf"^\s*{name}: (\d+)", printed, re.MULTILINE)[1])


def largest_error(shown: str, recording: Path) -> float:
    """Of what was written, where it shows a moment of the recording."""
    truth, written = (read_clips([str(source)], None)[0][0] for source in (recording, shown))
    within = (written.times >= truth.times[0]) & (written.times <= truth.times[-1])
    assert np.count_nonzero(within) > 100
    expected = interpolate(truth.times, truth.poses, written.times[within])
    return float(shell_error(written.poses[within], expected).max())


def run(*arguments: object) -> subprocess.CompletedProcess:
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=PATIENCE)


# Two processes and more


@pytest.mark.parametrize("host", LOOPBACKS)
def test_what_is_sent_is_shown_to_within_the_tolerance_and_counted_alike(tmp_path, recording, host):
    output = tmp_path / "shown.csv"
    receiving = ("receive", "--port", 0, "--bind", host, "--output", output, "--truth", recording, *MARGIN)
    with running(*receiving) as receiver:
        sent = run("send", recording, "--to", receiver.address(), "--tolerance", "5mm", "--delay", "0.2")
        assert sent.returncode == 0, sent.stderr
        shown = receiver.done()
    for name in ("updates", "heartbeats", "bytes", "bytes without headers"):
        assert number(shown, name) == number(sent.stdout, name)
    assert number(shown, "lost") == number(shown, "damaged") == 0
    assert shown.splitlines()[-1] == str(output)
    # Frames lie between the samples that the sender looks at.
    assert largest_error(output, recording) < 6e-3
    assert float(re.search(r"([\d.e-]+) mm at most", shown)[1]) < 6.0
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_an_even_stream_goes_to_several_receivers(tmp_path, recording):
    outputs = [tmp_path / f"{name}.csv" for name in "ab"]
    listening = [("receive", "--port", 0, "--output", output, *MARGIN) for output in outputs]
    with running(*listening[0]) as first, running(*listening[1]) as second:
        to = [part for one in (first, second) for part in ("--to", one.address())]
        sent = run("send", recording, *to, "--rate", 30, "--packing", "single", "--mode", "motor_spline")
        assert sent.returncode == 0, sent.stderr
        shown = [one.done() for one in (first, second)]
    assert number(sent.stdout, "updates") == 61
    assert [number(printed, "updates") for printed in shown] == [61, 61]
    assert sum(number(printed, "bytes") for printed in shown) == number(sent.stdout, "bytes")
    assert all(largest_error(output, recording) < 0.02 for output in outputs)


def test_three_users_hear_one_another_through_a_relay(tmp_path, recording):
    outputs = [tmp_path / f"{name}.csv" for name in "abc"]
    with running("relay", "--port", 0) as relay:
        room = relay.address()
        receivers = [Running("receive", "--from", room, "--output", output, *MARGIN) for output in outputs]
        try:
            for receiver in receivers:
                receiver.address()
            for _ in receivers:
                assert "is in the room" in relay.process.stdout.readline()
            senders = [Running("send", recording, "--to", room, "--heartbeat", 0.2) for _ in outputs]
            streams = {sender.process.stdout.readline().split()[1] for sender in senders}
            assert all(number(sender.done(), "updates") > 1 for sender in senders)
            shown = [receiver.done() for receiver in receivers]
        finally:
            for one in receivers:
                one.process.kill()
                one.process.communicate()
        relay.process.send_signal(signal.SIGINT)
        said = relay.done(130)
    for printed, output in zip(shown, outputs, strict=True):
        heard = set(re.findall(r"stream-(\w+) from", printed))
        # One that begins late on a busy machine may find that all others have ended.
        assert heard
        assert heard <= streams
        devices = {line.split(",")[0] for line in output.read_text().splitlines()[1:]}
        assert devices == {f"stream-{stream}" for stream in heard}
    assert number(said, "users") == 6
    assert number(said, "out") > number(said, "in") > 0


def test_who_asks_a_sender_hears_it_and_gets_its_state_at_once(long_recording):
    with (
        running("send", long_recording, "--port", free_port(), "--heartbeat", 5) as sender,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own,
    ):
        host, _, port = sender.address().rpartition(":")
        own.settimeout(PATIENCE)
        own.sendto(hello(), (host, int(port)))
        asked = read(own.recv(2000))
        assert asked.kind == CHALLENGE
        own.sendto(hello(asked.cookie), (host, int(port)))
        state = read(own.recv(2000))
        assert (state.kind, state.terms.mode) == (BEAT, TWISTS)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        return own.getsockname()[1]


def test_over_a_proxy_that_loses_some_the_heartbeats_mend_what_can_be(tmp_path, recording):
    output = tmp_path / "shown.csv"
    random, dropped = np.random.default_rng(0), []
    with (
        running("receive", "--port", 0, "--output", output, *MARGIN) as receiver,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as proxy,
    ):
        host, _, port = receiver.address().rpartition(":")
        proxy.bind(("127.0.0.1", 0))
        proxy.settimeout(0.1)
        over = threading.Event()

        def pass_on() -> None:
            while not over.is_set():
                try:
                    datagram = proxy.recv(2000)
                except TimeoutError:
                    continue
                if read(datagram).kind == KEY and random.random() < 0.3:
                    dropped.append(datagram)
                else:
                    proxy.sendto(datagram, (host, int(port)))

        passing = threading.Thread(target=pass_on)
        passing.start()
        try:
            sent = run("send", recording, "--to", f"127.0.0.1:{proxy.getsockname()[1]}", "--rate", 20)
            shown = receiver.done()
        finally:
            over.set()
            passing.join()
    assert sent.returncode == 0, sent.stderr
    assert dropped
    # The last of them came with the last heartbeat, if it was lost.
    missing = number(sent.stdout, "updates") - number(shown, "updates")
    assert len(dropped) - 1 <= missing <= len(dropped)
    assert number(shown, "lost") == missing
    assert largest_error(output, recording) < 0.5


@pytest.mark.parametrize(("stopped_by", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_a_receiver_that_is_stopped_keeps_what_was_shown(tmp_path, long_recording, stopped_by, code):
    output = tmp_path / "shown.csv"
    with (
        running("receive", "--port", 0, "--output", output) as receiver,
        running("send", long_recording, "--to", receiver.address()) as sender,
    ):
        until(lambda: any(path.stat().st_size > 100 for path in tmp_path.glob(".*.csv")))
        receiver.process.send_signal(stopped_by)
        shown = receiver.done(code)
        sender.process.send_signal(stopped_by)
        sent = sender.done(code)
    assert number(sent, "updates") >= number(shown, "updates") > 0
    assert len(read_clips([str(output)], None)[0][0].times) == number(shown, "frames")


def until(met: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not met():
        assert time.monotonic() < end
        time.sleep(0.01)


# What cannot be


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["send", "RECORDING", "--to", "127.0.0.1"], "write HOST:PORT"),
        (["send", "RECORDING", "--to", "::1:9000"], r"\[::1\]:9000"),
        (["send", "RECORDING", "--to", "no.such.host.invalid:9000"], "there is no host"),
        (["send", "missing.csv", "--to", "127.0.0.1:9000"], "missing.csv: no such file"),
        (["send", "RECORDING", "--to", "127.0.0.1:9000", "--rate", "20", "--tolerance", "5mm"], "exclude one another"),
        (["send", "RECORDING", "--to", "127.0.0.1:9000", "--tolerance", "5km"], "give a length such as 5mm"),
        (["send", "RECORDING", "--to", "127.0.0.1:9000", "--rate", "20", "--delay", "0.01"], "needs 0.05 s"),
        (["send", "RECORDING", "--to", "127.0.0.1:9000", "--mode", "motor_spline"], "looks at no later key"),
        (["send", "RECORDING"], "--to HOST:PORT"),
        (["receive", "--output", "FOLDER/shown.csv"], "--from HOST:PORT"),
        (["receive", "--port", "0", "--output", "FOLDER/shown.csv", "--seconds", "0.3"], "no sender came within 0.3 s"),
        (["receive", "--port", "0", "--bind", "192.0.2.1", "--output", "FOLDER/shown.csv"], "no address 192.0.2.1"),
        (["receive", "--port", "0", "--output", "FOLDER"], "is no file to write"),
        (["relay", "--port", "70000"], "is no port"),
    ],
)
def test_what_cannot_be_is_said_in_a_line_with_the_way_out(tmp_path, recording, arguments, says):
    named = {"RECORDING": str(recording), "FOLDER": str(tmp_path)}
    done = run(*(re.sub("RECORDING|FOLDER", lambda found: named[found[0]], argument) for argument in arguments))
    assert done.returncode == 2
    assert re.search(says, done.stderr.splitlines()[-1])
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["hand.csv"]


def test_a_port_that_is_taken_is_named(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        own.bind(("127.0.0.1", 0))
        port = own.getsockname()[1]
        done = run("receive", "--port", port, "--output", tmp_path / "shown.csv")
    assert done.returncode == 2
    assert f"port {port} of 127.0.0.1 is in use" in done.stderr


@pytest.mark.parametrize("command", [(), ("send",), ("receive",), ("relay",)])
def test_help_has_examples(command):
    done = run(*command, "--help")
    assert done.returncode == 0
    assert "examples" in done.stdout
    assert f"stream.py {' '.join(command)}".strip() in done.stdout


# Strangers


ONE, TWO, THREE = (("10.0.0.1", 1), ("10.0.0.2", 2), ("10.0.0.3", 3))


def keys(stream: int, count: int = 3) -> tuple[bytes, list[bytes]]:
    """The first heartbeat of a stream, and its keys."""
    times, poses = swinging()
    packets = Packets.of(times[:count], poses[:count], 0.05, PACKINGS["double"], stream=stream)
    rows = [row.tobytes() for row in packets.data]
    return beat(rows[0], Terms.of("dq_sclerp", 0.05, PlayOut(wait=1.0)), 0.0), rows


def join(room: Relay, address: tuple, time: float = 0.0) -> list[tuple[bytes, tuple]]:
    """Enter a room, and what comes at once."""
    ((asked, to),) = room.accept(hello(), address, time)
    assert to == address
    return room.accept(hello(read(asked).cookie), address, time)


def test_a_newcomer_gets_the_newest_of_each_stream_at_once_and_as_old_as_it_is():
    room, (first, rows) = Relay(), keys(7)
    join(room, ONE)
    assert room.accept(first, ONE, 1.0) == []
    room.accept(rows[1], ONE, 1.05)
    room.accept(rows[2], ONE, 1.1)
    state = join(room, TWO, 1.5)
    assert [to for _, to in state] == [TWO, TWO]
    messages = [read(datagram) for datagram, _ in state]
    assert [(message.kind, message.sequence) for message in messages] == [(BEAT, 0), (KEY, 2)]
    assert [message.age for message in messages] == pytest.approx([0.5, 0.4])
    assert room.accept(rows[2], ONE, 1.6) == [(rows[2], TWO)]


def test_nobody_is_sent_anything_but_a_challenge_who_has_not_answered_one():
    room, (first, rows) = Relay(), keys(7)
    join(room, ONE)
    for datagram in (hello(), hello(b"12345678"), first, rows[1]):
        ((answer, to),) = room.accept(datagram, THREE, 0.1)
        assert (read(answer).kind, to) == (CHALLENGE, THREE)
        assert len(answer) <= len(datagram)
    assert room.accept(first, ONE, 0.2) == []
    cookie = Cookies()
    assert not cookie.fits(ONE, cookie.of(TWO))
    assert room.accept(challenge(b"12345678"), THREE, 0.2) == room.accept(bye(7), THREE, 0.2) == []


def test_a_stream_is_that_of_who_began_it():
    room, (first, rows) = Relay(), keys(7)
    for user in (ONE, TWO, THREE):
        join(room, user)
    assert len(room.accept(first, ONE, 0.1)) == 2
    assert room.accept(rows[1], TWO, 0.1) == room.accept(bye(7), TWO, 0.1) == []
    assert len(room.accept(bye(7), ONE, 0.2)) == 2


def test_who_is_silent_is_forgotten_and_makes_room():
    room = Relay()
    for user in range(USERS):
        join(room, ("10.0.1.1", user))
    assert join(room, ONE, 0.5) == []
    assert ONE not in room.users
    join(room, ONE, 5.0)
    assert ONE in room.users
    assert len(room.users) == USERS
    room.forget(5.0 + SILENCE)
    assert list(room.users) == [ONE]
    room.forget(5.1 + SILENCE)
    assert (len(room.users), room.streams) == (0, 0)


def test_there_are_so_many_streams_and_no_more():
    room, shown = Relay(), []
    hearing = Hearing(lambda *frames: shown.append(frames), shown.append)
    join(room, ONE)
    for stream in range(1, 4 * STREAMS):
        first, _ = keys(stream)
        room.accept(first, ONE, 0.1)
        hearing.accept(first, ONE, 0.1)
    assert room.streams == hearing.streams == STREAMS
    first, _ = keys(999)
    room.accept(first, ONE, 4.0)
    hearing.accept(first, TWO, 4.0)
    assert room.streams == hearing.streams == STREAMS
    assert len(room.accept(first, ONE, 4.1)) == 0
    assert hearing.heard == STREAMS + 1


def test_a_flood_is_cut_off_and_others_are_heard_still():
    hearing = Hearing(lambda *_: None, lambda _: None)
    (first, rows), (other, _) = keys(7), keys(8)
    hearing.accept(first, ONE, 0.0)
    for _ in range(10_000):
        hearing.accept(rows[1], TWO, 0.5)
    assert hearing.refused > 10_000 - EACH - 10
    hearing.accept(other, THREE, 0.5)
    assert hearing.streams == 2


def test_a_stream_goes_on_while_strangers_send_anything_they_like():
    random = np.random.default_rng(0)
    frames = []
    hearing, room = Hearing(lambda number, shown: frames.append(number), lambda _: None), Relay()
    (first, _), cookie = keys(7), Cookies()
    assert len(cookie.of(ONE)) == 8
    count = 1_000_000 if THOROUGH else 50_000
    for batch in range(count // 1000):
        now = batch / 50.0
        hearing.accept(changed(first, age=now), ONE, now)
        data = random.integers(0, 256, (1000, random.integers(26, 152)), dtype=np.uint8)
        data[::2, 24] = random.integers(0, 7, 500)
        data[::2] = sealed(data[::2])
        for place, row in enumerate(data):
            stranger = ("10.9.0.1", place)
            hearing.accept(row.tobytes(), stranger, now)
            assert all(len(answer) <= len(row) for answer, _ in room.accept(row.tobytes(), stranger, now))
        if batch % 10 == 9:
            hearing.show(now)
        assert hearing.streams <= STREAMS
        assert len(room.users) == 0
    assert 7 in frames
