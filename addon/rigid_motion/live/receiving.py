"""What listens: a port, looked at by a timer, and what becomes of what comes. There is one at most.

It ends where a file is loaded, and where the extension is switched off. An undo takes objects away that were made
after it, and they are made again; what is deleted stays away until somebody listens anew.
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
"""A stream, and the name of one of its bodies."""

InHands = tuple[list[tuple[str, str] | None], Poses]
"""The body and the joint that hold something at each of some keys (k,), None for none; its poses (joints, k) there."""

MOST_AHEAD = 64
"""Messages of a body whose keys wait to be shown."""

LIVE = "rigid_motion_live"
"""The name of the settings on scenes, see `ui.live.LiveSettings`."""

is_matching = False
"""True while the program fills the table of joints and bones, and not a user."""


def match_bones(joints: Sequence[str], rig: bpy.types.Object) -> None:
    """Fill the table of which bone of a rig each joint moves, by their names."""
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
    """Return what the table says; it is filled in by names where it is for other joints or for another rig."""
    if [item.name for item in _settings().bones] != list(body.joints) or _settings().bones_of != rig.name:
        match_bones(body.joints, rig)
    return {item.name: item.bone for item in _settings().bones if item.bone}


def _settings() -> Any:
    return getattr(scene(), LIVE)


@dataclass(eq=False)
class _Heard:
    """A body of a stream."""

    label: str
    body: StreamBody
    stream: Stream
    driver: Driver | None = None
    is_gone: bool = False
    """True if its object was deleted."""

    poses: Poses | None = None
    """The poses that are shown of it, shape (joints,), and by the sender's clock when that was."""
    moment: float = 0.0

    held: HeldPoses | None = None
    """The joint that holds it, and its pose there."""
    seen: Poses | None = None
    """Where it is shown (joints,): what is held, in the hand of the rig."""

    ahead: deque[tuple[np.ndarray, Poses, InHands]] = field(default_factory=lambda: deque(maxlen=MOST_AHEAD))
    """Moments (k,) and poses (joints, k) of keys that are not shown yet, and what holds it there."""

    take: Take | None = None
    origin: float | None = None
    """The moment that is on the first frame of the recording; None where the sender has begun since."""

    @property
    def is_taken(self) -> bool:
        """Return whether what comes is of the joints that are recorded."""
        return self.take is not None and self.take.driver.body.joints == self.body.joints


@dataclass
class _Recording:
    """What is recorded, and since when."""

    begun: float
    first_frame: float
    frames_a_second: float
    mode: str
    tolerance: float


class Listening:
    """A port that is listened to. Raises OSError where it is taken, and NotAllowed."""

    def __init__(self, host: str, port: int) -> None:
        check_access(host)
        self._port = Port(host, port)
        self._receiver = Receiver(_settings().delay)
        self._heard: dict[Which, _Heard] = {}
        self._recording: _Recording | None = None
        self.complaint = ""
        """Who cannot be understood, and the way out."""

    @property
    def is_recording(self) -> bool:
        return self._recording is not None

    @property
    def joints(self) -> dict[str, tuple[str, ...]]:
        """The joints of each body that is heard, by its label."""
        return {heard.label: heard.body.joints for heard in self._heard.values()}

    def tick(self, now: float) -> None:
        """Take what came, and show what is due."""
        for datagram, address in self._port.received():
            self._receiver.take(datagram, now, address)
        for line in self._receiver.complaints():
            self.complaint = line
            log.warning(line)
        for sender, answer in self._receiver.answers():
            self._port.send(answer, cast(Address, sender))
        self._receiver.steady = _settings().steady
        # They take up room until they are asked for.
        came = self._receiver.keys()
        shown = {
            (stream, body.name): (body, what)
            for stream, what in self._receiver.show(now).items()
            for body in what.bodies
        }
        present = []
        for which, (body, what) in shown.items():
            present.append(heard := self._heard_of(which, body, shown))
            heard.moment, heard.poses, heard.held = what.moment, what.poses[body.name], what.held.get(body.name)
        self._show(present)
        for heard in present:
            if self._recording and heard.driver is not None:
                self._follow(heard, now)
        for keys in came:
            self._keep(keys)
        self._heard = {which: it for which, it in self._heard.items() if which in shown or it.take}

    def _heard_of(self, which: Which, body: StreamBody, present: Container[Which]) -> _Heard:
        """Return what is known of a body. It has a label of its own;
        a sender that begins again goes on with its old one.
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
            heard = _Heard(label, body, which[0]) if before is None else self._heard.pop(before)
            self._heard[which] = heard
            heard.stream, heard.origin = which[0], None
        if heard.body is not body:
            heard.body, heard.driver = body, None
        return heard

    def _show(self, present: list[_Heard]) -> None:
        for heard in present:
            if heard.driver is None and not heard.is_gone:
                heard.driver = self._driver_of(heard)
        held = [heard for heard in present if self._grip(heard) is not None]
        for heard in sorted(present, key=held.__contains__):
            if heard in held[:1]:
                view_layer().update()
            heard.seen = self._seen(heard)
            if heard.driver is not None and not heard.driver.show(heard.seen):
                heard.driver, heard.is_gone = None, True

    def _hand(self, stream: Stream, holder: tuple[str, str]) -> tuple[_Heard, Hand, Poses] | None:
        """Return the body that holds something by its name and that of a joint, what shows that joint, and its pose ()
        there; None for as long as nothing does.
        """
        holding = self._heard.get((stream, holder[0]))
        if holding is None or holding.driver is None or (hand := holding.driver.hand(holder[1])) is None:
            return None
        return holding, *hand

    def _grip(self, heard: _Heard) -> tuple[_Heard, Hand, Poses] | None:
        """Return what holds a body, and its poses (1,) there. Skeletons are where they were sent, as their bones have
        keys in their rig.
        """
        if heard.held is None or len(heard.body.joints) > 1:
            return None
        if (found := self._hand(heard.stream, heard.held[:2])) is None:
            return None
        holding, hand, joint = found
        return holding, hand, placed(joint, heard.held.poses)

    def _seen(self, heard: _Heard) -> Poses:
        """Return where a body is to be shown (joints,): what is held, in the hand as Blender has it."""
        if (found := self._grip(heard)) is None:
            return existing(heard.poses)
        holding, hand, grip = found
        return placed(seen_hand(hand) if hand[1] else self._seen(holding)[0], grip)

    def _driver_of(self, heard: _Heard) -> Driver | None:
        """Return what shows a body; None for as long as nothing can."""
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
        """Show what is shown on top of what another frame has keyed."""
        for heard in self._heard.values():
            if heard.driver is not None and heard.seen is not None:
                heard.driver.show(heard.seen)

    def choose_drivers(self, for_all: bool = False) -> None:
        """Choose anew what shows each body, of those whose object is gone as well where asked to."""
        for heard in self._heard.values():
            heard.driver, heard.is_gone = None, heard.is_gone and not for_all

    def record(self, mode: str, tolerance: float) -> None:
        """Keep what comes from now on, from the current frame on."""
        render, frame = scene().render, scene().frame_current_final
        self._recording = _Recording(time.monotonic(), frame, render.fps / render.fps_base, mode, tolerance)
        for heard in self._heard.values():
            heard.origin = None
            if heard.driver is not None and heard.poses is not None:
                self._follow(heard, self._recording.begun)

    def _follow(self, heard: _Heard, now: float) -> None:
        """Record a body from now on, and go on where its sender began again."""
        recording = existing(self._recording)
        if heard.origin is None:
            heard.origin = heard.moment - (now - recording.begun)
        if heard.take is None:
            heard.take = Take(
                existing(heard.driver), recording.mode, recording.tolerance if heard.stream.identity == VMC else None
            )
            self._add_shown(heard)

    def _add_shown(self, heard: _Heard) -> None:
        """Have the picture itself among what is recorded: where it begins, and where it ends."""
        poses = existing(heard.poses)
        holder, inside = (heard.held[:2], heard.held.poses) if heard.held else (None, poses)
        self._add(heard, np.array([heard.moment]), poses[:, None], ([holder], inside[:, None]))

    def _add(self, heard: _Heard, moments: np.ndarray, poses: Poses, in_hands: InHands) -> None:
        recording, take = existing(self._recording), existing(heard.take)
        numbers, grips = np.zeros(len(moments), dtype=int), poses.copy()
        holders, inside = in_hands
        for holder in dict.fromkeys(filter(None, holders)):
            _, hand, joint = self._hand(heard.stream, holder) or (None, ("", holder[1]), poses[0, 0])
            at = np.array([one == holder for one in holders])
            numbers[at], grips[:, at] = take.number_of(hand), placed(joint, inside[:, at])
        frames = recording.first_frame + (moments - heard.origin) * recording.frames_a_second
        take.add(frames, poses, numbers, grips)

    def _keep(self, keys: ReceivedKeys) -> None:
        """Record keys, or have those at hand that are not shown yet: a recording may begin before they are."""
        for name, poses in keys.poses.items():
            heard = self._heard.get((keys.stream, name))
            if heard is None:
                continue
            nobody: InHands = [None] * len(keys.moments), poses
            heard.ahead.append((keys.moments, poses, keys.held.get(name, nobody)))
            if heard.is_taken and heard.origin is not None:
                for few in heard.ahead:
                    self._add(heard, *few)
                heard.ahead.clear()
            while heard.ahead and heard.ahead[0][0][-1] <= heard.moment:
                heard.ahead.popleft()

    def finish(self) -> int:
        """End the recording and make its keys; say how many poses have keys."""
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
    """Return what listens, if anything does."""
    return running.thing


def start(host: str, port: int) -> Listening:
    """Listen to a port, and to nothing else any more. Raises OSError where it is taken, and NotAllowed."""
    return running.start(lambda: Listening(host, port))


def stop() -> None:
    """Listen no more. What is recorded and not finished is given up."""
    running.stop()
