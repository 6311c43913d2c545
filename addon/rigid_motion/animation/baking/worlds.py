"""World matrices from evaluating the scene frame by frame: the only module that steps through frames.

Matrices are (..., 4, 4) in double precision, frames those of the Action whose keys the editors show.
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
"""Channels whose values differ by less count as still."""

STILLNESS_SAMPLES = 9
"""The number of moments that are compared to find whether a transform is still."""


class Worlds(NamedTuple):
    """Matrices of a transform and other nodes on m frames."""

    prop: np.ndarray
    """World matrices of the transform, from its channels and its holders, shape (m, 4, 4)."""

    local: np.ndarray
    """The same in the space of its channels without a holder, shape (m, 4, 4)."""

    nodes: np.ndarray
    """World matrices of k other nodes, shape (k, m, 4, 4)."""


def alone_in(transform: Transform, bindings: Sequence[Binding]) -> Binding:
    """Return the only binding that moves a transform, if it moves nothing else. Otherwise raise `Refused`."""
    if len(bindings) != 1 or not bindings[0].slot.plays_in(transform.animated):
        raise Refused(IN_STRIPS, name=transform.name)
    if len(bindings[0].users) > 1:
        raise Refused(SEVERAL_REFUSAL, name=transform.name)
    return bindings[0]


def worlds_of(transform: Transform, nodes: Sequence[Node], frames: np.ndarray) -> Worlds:
    """Return matrices of a transform and other nodes on frames (m,) of its Action, evaluating the scene once on each.

    The animator's own constraints on the transform are muted for this, as they come on top of its keys.
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
                _read_worlds(obj.evaluated_get(depsgraph), rows, result.nodes[:, column])
    return result


def _read_worlds(obj: bpy.types.Object, rows: list[tuple[int, int]], worlds: np.ndarray) -> None:
    """Write the world matrices of an object (-1) and its bones, by number, into rows of `worlds` (k, 4, 4)."""
    own = np.array(obj.matrix_world)
    bones = () if obj.pose is None else obj.pose.bones
    numbers = np.empty(16 * len(bones), np.float32)
    if bones:
        bones.foreach_get("matrix", numbers)
    # Blender stores matrices column by column.
    posed = numbers.reshape(-1, 4, 4).transpose(0, 2, 1).astype(float)
    for row, bone in rows:
        worlds[row] = own @ posed[bone] if bone >= 0 else own


@contextmanager
def _as_keyed(transform: Transform) -> Iterator[None]:
    """Let only its keys and holders move a transform, and restore the current frame afterwards."""
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
    """Return the first and last frame on which keys or holders move a transform; `seen` is the visible range."""
    begin, end = source.keyed_range
    if source.goes_on or source.hold_at(begin)[0]:
        begin = min(begin, seen[0])
    if source.goes_on or source.hold_at(end)[0]:
        end = max(end, seen[1])
    return begin, end


def arrivals(source: KeyedTransform, step: float) -> list[Switch]:
    """Return the passes in which the object moves relative to the new holder as it arrives.

    They are longer than a step or a frame, the shorter of the two.
    """
    result = []
    for switch, run in zip(source.switches, source.runs[1:], strict=True):
        if switch.frame - switch.begin > min(step, 1.0) + SAME_FRAME:
            coming = seen_values(run.source, run.moments(np.linspace(switch.begin, switch.frame, STILLNESS_SAMPLES)))
            if np.ptp(coming, axis=1).max() > MAX_CHANNEL_ROUNDING:
                result.append(switch)
    return result


def say_holds(binding: Binding, held: Marks, at_once: Collection[float] = ()) -> None:
    """Mark all keys of a binding with their holds; on the frames `at_once` without frames for the pass.

    Keys without a mode get Blender's own.
    """
    for fcurve in binding.keyed:
        frames, marks = key_points(fcurve)[:, 0].astype(float), read_marks(fcurve)
        write_marks(fcurve, np.where(marks, marks, MODE_NUMBERS["BLENDER"] + 1))
        holds = held.at(frames + 0.5 * SAME_FRAME)
        write_holds(fcurve, np.where(near(frames, np.array([*at_once])), holds - holds % (MOST_FRAMES + 1), holds))
