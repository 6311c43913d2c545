"""Where things are in the world as Blender evaluates the scene: the one place that steps through frames.

Matrices are (..., 4, 4) in double precision, frames those of the Action that the keys in the editors are in.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import NamedTuple, cast

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_

from ..actions.channels import key_points
from ..actions.marks import read_marks, write_holds, write_marks
from ..actions.slots import Binding
from ..evaluation.components import MODE_NUMBERS
from ..evaluation.differences import seen_values
from ..evaluation.marks import near
from ..evaluation.runs import MOST_FRAMES, Switch
from ..evaluation.sources import SAME_FRAME, KeyedTransform, Marks
from ..following import follower
from ..holds.dependencies import Node
from ..holds.holders import is_ours
from ..holds.placing import converted, world_matrix
from ..transforms import Refused, Transform

SEVERAL_REFUSAL = n_(
    "{name} shares its Action with others that are elsewhere: give it its own (Object > Relations > Make Single User)"
)
IN_STRIPS = n_("{name} moves by NLA strips: enter its only strip (NLA Editor, Tab), or bake the strips first")

MAX_CHANNEL_ROUNDING = 1e-6
"""Values of channels that differ by less stand still."""

STILLNESS_SAMPLES = 9
"""So many moments tell whether something stands still."""


class Worlds(NamedTuple):
    """Where things are on m frames."""

    prop: np.ndarray
    """What was asked for, by its channels and by what holds it, shape (m, 4, 4)."""

    local: np.ndarray
    """The same as its channels have it where nothing holds it, shape (m, 4, 4)."""

    nodes: np.ndarray
    """Other things, k of them, shape (k, m, 4, 4)."""


def alone_in(transform: Transform, bindings: Sequence[Binding]) -> Binding:
    """Return what moves a transform, if nothing else moves by it. `Refused` where its place depends on more."""
    if len(bindings) != 1 or not bindings[0].slot.plays_in(transform.animated):
        raise Refused(IN_STRIPS, name=transform.name)
    if len(bindings[0].users) > 1:
        raise Refused(SEVERAL_REFUSAL, name=transform.name)
    return bindings[0]


def worlds_of(transform: Transform, nodes: Sequence[Node], frames: np.ndarray) -> Worlds:
    """Return where a transform and other things are on frames (m,) of its Action: the scene is evaluated once on each.

    Constraints of the animator's on the transform do nothing meanwhile: they come on top of its keys.
    """
    result = Worlds(*(np.empty((*shape, len(frames), 4, 4)) for shape in ((), (), (len(nodes),))))
    scene, data = cast(bpy.types.Scene, bpy.context.scene), transform.animated.animation_data
    bones: dict[bpy.types.Object, list[tuple[int, int]]] = {}
    for row, (obj, bone) in enumerate(nodes):
        bones.setdefault(obj, []).append((row, cast(bpy.types.Pose, obj.pose).bones.find(bone) if bone else -1))
    with _as_keyed(transform):
        for column, frame in enumerate(frames.tolist()):
            moment = frame if data is None else data.nla_tweak_strip_time_to_scene(frame)
            whole = int(np.floor(moment))
            scene.frame_set(whole, subframe=moment - whole)
            world, depsgraph = world_matrix(transform), bpy.context.evaluated_depsgraph_get()
            result.prop[column], result.local[column] = world, converted(transform, world, "WORLD", "LOCAL")
            for obj, rows in bones.items():
                _look_at(obj.evaluated_get(depsgraph), rows, result.nodes[:, column])
    return result


def _look_at(obj: bpy.types.Object, rows: list[tuple[int, int]], worlds: np.ndarray) -> None:
    """Put where an object and bones of it are, by their numbers or -1, into rows of matrices (k, 4, 4)."""
    own = np.array(obj.matrix_world)
    bones = () if obj.pose is None else obj.pose.bones
    numbers = np.empty(16 * len(bones), np.float32)
    if bones:
        bones.foreach_get("matrix", numbers)
    # Blender has columns one behind the other.
    posed = numbers.reshape(-1, 4, 4).transpose(0, 2, 1).astype(float)
    for row, bone in rows:
        worlds[row] = own @ posed[bone] if bone >= 0 else own


@contextmanager
def _as_keyed(transform: Transform) -> Iterator[None]:
    """Have a transform be moved by its keys and its holders alone, and the frame be that which is shown afterwards."""
    scene = cast(bpy.types.Scene, bpy.context.scene)
    frame, subframe = scene.frame_current, scene.frame_subframe
    others = [item for item in transform.carrier.constraints if not is_ours(item) and not item.mute]
    with ExitStack() as stack:
        stack.enter_context(follower.follower.own_edits())
        stack.callback(scene.frame_set, frame, subframe=subframe)
        for constraint in others:
            stack.callback(setattr, constraint, "mute", False)
            constraint.mute = True
        yield


def seen_range(source: KeyedTransform, seen: tuple[int, int]) -> tuple[float, float]:
    """Return the first and last frame on which keys or what holds something move it; `seen` is all there is to see."""
    begin, end = source.keyed_range
    if source.goes_on or source.hold_at(begin)[0]:
        begin = min(begin, seen[0])
    if source.goes_on or source.hold_at(end)[0]:
        end = max(end, seen[1])
    return begin, end


def arrivals(source: KeyedTransform, step: float) -> list[Switch]:
    """Return the passes, longer than a step and a frame, to what something moves in as it arrives there."""
    result = []
    for switch, run in zip(source.switches, source.runs[1:], strict=True):
        if switch.frame - switch.begin > min(step, 1.0) + SAME_FRAME:
            coming = seen_values(run.source, run.moments(np.linspace(switch.begin, switch.frame, STILLNESS_SAMPLES)))
            if np.ptp(coming, axis=1).max() > MAX_CHANNEL_ROUNDING:
                result.append(switch)
    return result


def say_holds(binding: Binding, held: Marks, at_once: Collection[float] = ()) -> None:
    """Have all keys of a binding say what they are held in; those on some frames that they are so at once.

    Keys without a mode get Blender's own.
    """
    for fcurve in binding.keyed:
        frames, marks = key_points(fcurve)[:, 0].astype(float), read_marks(fcurve)
        write_marks(fcurve, np.where(marks, marks, MODE_NUMBERS["BLENDER"] + 1))
        holds = held.at(frames + 0.5 * SAME_FRAME)
        write_holds(fcurve, np.where(near(frames, np.array([*at_once])), holds - holds % (MOST_FRAMES + 1), holds))
