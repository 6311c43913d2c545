"""Receiving live motion: listens to one port, polled by a timer, and shows and records the bodies that arrive.

Listening ends when another file is loaded or the extension is disabled. Objects removed by an undo are created again.
An object deleted by the user is not created again until listening starts anew.
"""

from __future__ import annotations

import itertools
import time
from collections import deque
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import bpy
import numpy as np

from ..blender import armature, existing, persistent, scene, view_layer
from ..motion import Poses
from ..motion.poses import placed
from ..streams import ReceivedKeys, Receiver, StreamBody
from ..streams.playing import HeldPoses, Stream
from ..streams.vmc import VMC
from .driving import Driver, Hand, RigDriver, matched, object_of, seen_hand
from .recording import Take
from .sockets import Address, Port, check_access
from .ticking import Ticking, log

Which = tuple[Stream, str]
"""Identifies a body: its stream, and its name there."""

InHands = tuple[list[tuple[str, str] | None], Poses]
"""The body and the joint that hold an object at each of its keys (k,), None for none; its poses (joints, k) there."""

MOST_AHEAD = 64
"""The maximum number of messages of a body whose keys wait to be shown."""

LIVE = "rigid_motion_live"
"""The scene property that holds the settings, see `ui.live.LiveSettings`."""

is_matching = False
"""True while the program, not a user, fills the table of joints and bones."""


def match_bones(joints: Sequence[str], rig: bpy.types.Object) -> None:
    """Fill the table of joints and the bones that they move, by matching their names."""
    global is_matching
    table, pairs = _settings().bones, matched(joints, [bone.name for bone in armature(rig).bones])
    table.clear()
    _settings().bones_of = rig.name
    is_matching = True
    for joint in joints:
        item = table.add()
        item.name, item.bone = joint, pairs.get(joint, "")
    is_matching = False


def _pairs(body: StreamBody, rig: bpy.types.Object) -> Mapping[str, str]:
    """Return the bone that each joint moves, from the table. A table for other joints or another rig is filled anew."""
    if [item.name for item in _settings().bones] != list(body.joints) or _settings().bones_of != rig.name:
        match_bones(body.joints, rig)
    return {item.name: item.bone for item in _settings().bones if item.bone}


def _settings() -> Any:
    return getattr(scene(), LIVE)


@dataclass(eq=False)
class _ReceivedBody:
    """A received body, its driver and its recording."""

    label: str
    body: StreamBody
    stream: Stream
    driver: Driver | None = None
    is_gone: bool = False
    """True if its object was deleted."""

    poses: Poses | None = None
    """The poses (joints,) to show, and their timestamp by the sender's clock."""
    moment: float = 0.0

    held: HeldPoses | None = None
    """The body and the joint that hold it, and its poses in that joint's space."""
    seen: Poses | None = None
    """The poses (joints,) in which it is shown; a held object is shown in the hand of the rig."""

    ahead: deque[tuple[np.ndarray, Poses, InHands]] = field(default_factory=lambda: deque(maxlen=MOST_AHEAD))
    """Keys that are not shown yet: timestamps (k,), poses (joints, k), and its holders there."""

    take: Take | None = None
    origin: float | None = None
    """The timestamp on the first frame of the recording; None if not known yet, as after a restart of the sender."""

    @property
    def is_taken(self) -> bool:
        """Return whether the body still has the joints that are being recorded."""
        return self.take is not None and self.take.driver.body.joints == self.body.joints


@dataclass
class _Recording:
    """The start and the settings of a recording."""

    begun: float
    first_frame: float
    frames_a_second: float
    mode: str
    tolerance: float


class Listening:
    """An open port and the bodies received there. Raises OSError if the port is taken, and NotAllowed."""

    def __init__(self, host: str, port: int) -> None:
        check_access(host)
        self._port = Port(host, port)
        self._receiver = Receiver(_settings().delay)
        self._heard: dict[Which, _ReceivedBody] = {}
        self._recording: _Recording | None = None
        self.complaint = ""
        """Which sender cannot be understood and how to fix it, or why a held recording failed; "" if neither."""

    @property
    def is_recording(self) -> bool:
        return self._recording is not None

    @property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """The joints of each received body, by its label."""
        return {heard.label: heard.body.joints for heard in self._heard.values()}

    def tick(self, now: float) -> None:
        """Read the datagrams that arrived, and show the poses that are due."""
        for datagram, address in self._port.received():
            self._receiver.take(datagram, now, address)
        for line in self._receiver.complaints():
            self.complaint = line
            log.warning(line)
        for sender, answer in self._receiver.answers():
            self._port.send(answer, cast(Address, sender))
        self._receiver.steady = _settings().steady
        # Keys take up memory until they are fetched.
        new_keys = self._receiver.keys()
        shown = {
            (stream, body.name): (body, what)
            for stream, what in self._receiver.show(now).items()
            for body in what.bodies
        }
        present = []
        for which, (body, what) in shown.items():
            present.append(heard := self._entry_of(which, body, shown))
            heard.moment, heard.poses, heard.held = what.moment, what.poses[body.name], what.held.get(body.name)
        self._show(present)
        for heard in present:
            if self._recording and heard.driver is not None:
                self._start_take(heard, now)
        for keys in new_keys:
            self._store_keys(keys)
        self._heard = {which: it for which, it in self._heard.items() if which in shown or it.take}

    def _entry_of(self, which: Which, body: StreamBody, present: Container[Which]) -> _ReceivedBody:
        """Return the entry of a body, and create a missing one with a unique label.
        A restarted sender keeps its old label.
        """
        heard = self._heard.get(which)
        if heard is None:
            labels = {it.label for other, it in self._heard.items() if other in present}
            label = next(
                label
                for number in itertools.count(1)
                if (label := body.name if number == 1 else f"{body.name} {number}") not in labels
            )
            before = next((other for other, it in self._heard.items() if it.label == label), None)
            heard = _ReceivedBody(label, body, which[0]) if before is None else self._heard.pop(before)
            self._heard[which] = heard
            heard.stream, heard.origin = which[0], None
        if heard.body is not body:
            heard.body, heard.driver = body, None
        return heard

    def _show(self, present: list[_ReceivedBody]) -> None:
        for heard in present:
            if heard.driver is None and not heard.is_gone:
                heard.driver = self._driver_of(heard)
        held = [heard for heard in present if self._grip_of(heard) is not None]
        for heard in sorted(present, key=held.__contains__):
            if heard in held[:1]:
                view_layer().update()
            heard.seen = self._poses_to_show(heard)
            if heard.driver is not None and not heard.driver.show(heard.seen):
                heard.driver, heard.is_gone = None, True

    def _hand_showing(self, stream: Stream, holder: tuple[str, str]) -> tuple[_ReceivedBody, Hand, Poses] | None:
        """Return the holding body, the hand that shows its joint, and the joint's pose () in that hand, for the names
        of the body and the joint. None while no object shows that joint.
        """
        holding = self._heard.get((stream, holder[0]))
        if holding is None or holding.driver is None or (hand := holding.driver.hand(holder[1])) is None:
            return None
        return holding, *hand

    def _grip_of(self, heard: _ReceivedBody) -> tuple[_ReceivedBody, Hand, Poses] | None:
        """Return the body and the hand that hold a rigid body, and its poses (1,) there; None if not held. Skeletons
        stay where they were sent, because their bones have keys in their rig.
        """
        if heard.held is None or len(heard.body.joints) > 1:
            return None
        if (found := self._hand_showing(heard.stream, heard.held[:2])) is None:
            return None
        holding, hand, joint = found
        return holding, hand, placed(joint, heard.held.poses)

    def _poses_to_show(self, heard: _ReceivedBody) -> Poses:
        """Return the poses (joints,) in which to show a body; a held body is in the hand as Blender evaluated it."""
        if (found := self._grip_of(heard)) is None:
            return existing(heard.poses)
        holding, hand, grip = found
        return placed(seen_hand(hand) if hand[1] else self._poses_to_show(holding)[0], grip)

    def _driver_of(self, heard: _ReceivedBody) -> Driver | None:
        """Return the driver that shows a body; None while its object cannot be created."""
        if len(heard.body.joints) > 1:
            rig, chosen = _settings().armature, _settings().body or heard.label
            is_free = not any(it.driver is not None and it.driver.object == rig for it in self._heard.values())
            if rig is not None and rig.library is None and chosen == heard.label and is_free:
                return RigDriver(rig, heard.body, _pairs(heard.body, rig))
        obj = object_of(heard.label, heard.body)
        if obj is None:
            return None
        names = {name: name for name in heard.body.joints}
        return Driver(obj, heard.body) if len(names) == 1 else RigDriver(obj, heard.body, names)

    def show_again(self) -> None:
        """Show the same poses again, over the keys that a change of frame has evaluated."""
        for heard in self._heard.values():
            if heard.driver is not None and heard.seen is not None:
                heard.driver.show(heard.seen)

    def choose_drivers(self, for_all: bool = False) -> None:
        """Choose the driver of each body anew; with `for_all`, also of bodies whose object is gone."""
        for heard in self._heard.values():
            heard.driver, heard.is_gone = None, heard.is_gone and not for_all

    def record(self, mode: str, tolerance: float) -> None:
        """Start recording, with the first sample on the current frame."""
        render, frame = scene().render, scene().frame_current_final
        self._recording = _Recording(time.monotonic(), frame, render.fps / render.fps_base, mode, tolerance)
        for heard in self._heard.values():
            heard.origin = None
            if heard.driver is not None and heard.poses is not None:
                self._start_take(heard, self._recording.begun)

    def _start_take(self, heard: _ReceivedBody, now: float) -> None:
        """Start recording a body, or continue its recording after its sender restarted."""
        recording = existing(self._recording)
        if heard.origin is None:
            heard.origin = heard.moment - (now - recording.begun)
        if heard.take is None:
            heard.take = Take(
                existing(heard.driver), recording.mode, recording.tolerance if heard.stream.identity == VMC else None
            )
            self._add_shown(heard)

    def _add_shown(self, heard: _ReceivedBody) -> None:
        """Add the poses on screen to the recording, as its first and as its last sample."""
        poses = existing(heard.poses)
        holder, inside = (heard.held[:2], heard.held.poses) if heard.held else (None, poses)
        self._add_samples(heard, np.array([heard.moment]), poses[:, None], ([holder], inside[:, None]))

    def _add_samples(self, heard: _ReceivedBody, moments: np.ndarray, poses: Poses, in_hands: InHands) -> None:
        recording, take = existing(self._recording), existing(heard.take)
        numbers, grips = np.zeros(len(moments), dtype=int), poses.copy()
        holders, inside = in_hands
        for holder in dict.fromkeys(filter(None, holders)):
            _, hand, joint = self._hand_showing(heard.stream, holder) or (None, ("", holder[1]), poses[0, 0])
            at = np.array([one == holder for one in holders])
            numbers[at], grips[:, at] = take.number_of(hand), placed(joint, inside[:, at])
        frames = recording.first_frame + (moments - heard.origin) * recording.frames_a_second
        take.add(frames, poses, numbers, grips)

    def _store_keys(self, keys: ReceivedKeys) -> None:
        """Record keys. Keep keys that are not shown yet, because a recording may begin before they are shown."""
        for name, poses in keys.poses.items():
            heard = self._heard.get((keys.stream, name))
            if heard is None:
                continue
            unheld: InHands = [None] * len(keys.moments), poses
            heard.ahead.append((keys.moments, poses, keys.held.get(name, unheld)))
            if heard.is_taken and heard.origin is not None:
                for waiting in heard.ahead:
                    self._add_samples(heard, *waiting)
                heard.ahead.clear()
            while heard.ahead and heard.ahead[0][0][-1] <= heard.moment:
                heard.ahead.popleft()

    def finish(self) -> int:
        """End the recording and create its keys. Return the number of poses with keys."""
        count = 0
        for heard in self._heard.values():
            if heard.take is not None:
                if heard.is_taken and heard.origin is not None:
                    self._add_shown(heard)
                count += heard.take.write()
                self.complaint = heard.take.refusal or self.complaint
                heard.take = None
        self._recording = None
        return count

    def close(self) -> None:
        self._port.close()


@persistent
def _on_undo(*_: object) -> None:
    running.thing.choose_drivers(for_all=True)


@persistent
def _on_frame(*_: object) -> None:
    running.thing.show_again()


HANDLERS = {"undo_post": _on_undo, "redo_post": _on_undo, "frame_change_post": _on_frame}

running = Ticking("What came over the network cannot be shown", HANDLERS)


def listening() -> Listening | None:
    """Return the open port, None if nothing is listening."""
    return running.thing


def start(host: str, port: int) -> Listening:
    """Listen to this port only. Raises OSError if the port is taken, and NotAllowed."""
    return running.start(lambda: Listening(host, port))


def stop() -> None:
    """Stop listening. An unfinished recording is discarded."""
    running.stop()
