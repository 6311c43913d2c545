"""One object baked over many frames."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Iterator
from functools import partial

import bpy
import numpy as np

from rigid_motion import animation

from .scenes import MODE, NativeBaking, Size, general, keyed, new_empty, scene_of, set_modes
from .turns import TABLE, Seconds, against, in_turns, judged, told

GOAL = 5
"""Seconds to bake so many frames."""

LONGER_GOAL = 2.2
"""How many times as long twice the frames may take."""


def long_bakes(sizes: tuple[Size, Size], rounds: int) -> Iterator[str]:
    """Baking an object over as many frames as two sizes say, in turns, as lines of Markdown."""
    short, long = sizes
    random = np.random.default_rng(5)
    # Both in one scene, so that they are baked in turns.
    (first,) = scene_of(long, "QUATERNION")
    objects = {long: first, short: keyed(new_empty("Short"), short, "QUATERNION", partial(general, random))}
    set_modes(list(objects.values()), MODE)
    contestants: dict[str, Callable[[], object]] = {}
    for size in sizes:
        contestants[str(size)] = partial(animation.bake, objects[size])
        contestants[f"back from {size}"] = partial(animation.unbake, objects[size])
    seconds = in_turns(rounds, **contestants)
    animation.set_enabled(False)
    beside: Seconds = {}
    for size in sizes:
        # Blender goes through the frames of the whole scene: the other object is not to take part.
        other = objects[long if size is short else short]
        bpy.context.collection.objects.unlink(other)
        native = NativeBaking([objects[size]], range(1, size.frames + 1))
        beside |= in_turns(min(3, rounds), **{str(size): native.bake, f"back from {size}": native.restore})
        bpy.context.collection.objects.link(other)
    animation.set_enabled(True)

    yield f"## Baking one object with {long.keys} keys"
    yield ""
    yield from TABLE
    for size in sizes:
        ours, theirs = seconds[str(size)], beside[str(size)]
        verdict = judged(statistics.median(ours), GOAL, " s")
        yield (
            f"| {size.frames} frames | {told(ours)} | `bake_action_objects`: {told(theirs)} | {against(ours, theirs)} "
            f"| {verdict} |"
        )
    ours, theirs = (
        statistics.median(every[str(long)]) / statistics.median(every[str(short)]) for every in (seconds, beside)
    )
    yield (
        f"| {long.frames} frames beside {short.frames} | {ours:.2f} times as long | {theirs:.2f} times as long | "
        f"| {judged(ours, LONGER_GOAL)} |"
    )
    yield ""
