"""The section *Whole bodies* of the page about key reduction, as lines of Markdown."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from rigid_motion.motion import Poses
from rigid_motion_batch.decimated_bodies import VARIES

from . import against_decimate, against_greedy, against_published, feet, timing
from .bodies import RADIUS, Body, repeated
from .rigs import MOST_FRAMES, UnusableRigError, import_rig

TOLERANCE = 0.01
"""Metres, of every joint's ball."""

HEIGHT = 1.7
"""Metres that every body's largest extent is made."""

MODE = "motor_spline"
"""Where one mode is enough."""

CYCLE, CYCLE_FRAMES, CYCLE_SECONDS = "pab_walk", 450, 5.0
"""The file with a cycle that is gone on with; for so many frames; and the goal for these."""

WIDTH = 120
"""Of the page's lines."""

LONG, LONG_SECONDS = "cmu_01_01", 30.0
"""The file that is timed uncut, and the goal for it."""


def section(paths: list[Path], recordings: list[tuple[str, float, Poses]]) -> Iterator[str]:
    """All that is measured of the bodies in files; of single recordings (names, frames a second, poses), the time."""
    _say("bodies ...")
    found: dict[str, Body] = {}
    decimated, left_out = [], []
    for path in paths:
        _say(f"{path.name}, Decimate ...")
        try:
            rig = import_rig(path)
        except UnusableRigError as error:
            left_out.append(str(error))
            continue
        body = rig.body()
        found[body.name] = body
        decimated.append((body, against_decimate.measure(rig, body.of_size(HEIGHT), MODE, TOLERANCE)))
    bodies = [body.of_size(HEIGHT) for body in found.values()]
    yield from _bodies(list(found.values()), left_out)
    if not bodies:
        return
    yield from _greedy(bodies)
    yield from _decimate(decimated)
    yield from _ozz(found)
    yield from _salient_poses(bodies)
    yield from _feet(bodies)
    yield from _timing(paths, found, recordings)


def _bodies(bodies: list[Body], left_out: list[str]) -> Iterator[str]:
    yield "## Whole bodies"
    yield ""
    yield from _paragraph(f"""
Bodies are imported by Blender's own importers, BVH turned by quaternions; of recordings longer than {MOST_FRAMES}
frames, these first. Where the armature itself is animated it is a joint too, the one that all others hang on. They are
made the same size: the largest extent of the joints in the first frame, along any axis, becomes {HEIGHT:g} m. The error
is that of every joint with all that it hangs on, the largest displacement of any point in a ball of
{100.0 * RADIUS:g} cm around it, on every frame; {1e3 * TOLERANCE:g} mm are allowed unless told otherwise.
""")
    yield "| body | joints | frames | frames a second | largest extent in the file |"
    yield "|---|---:|---:|---:|---:|"
    for body in bodies:
        yield f"| {body.name} | {len(body.joints)} | {body.frames} | {body.rate:.0f} | {body.extent:.4g} |"
    yield ""
    for why in left_out:
        yield from _paragraph(f"Left out: {why}.")


def _greedy(bodies: list[Body]) -> Iterator[str]:
    yield "### Key poses beside greedy insertion"
    yield ""
    yield from _paragraph(f"""
All joints have keys on the same frames. *Greedy* puts in one key at a time, on the frame that is off most, until none
is by too much; then every key in turn is taken out that can be. The *optimum* is the fewest there can be, by a dynamic
programme that tries every frame as the next key; where what is between two keys depends on two more, it is found for at
most {against_greedy.SHORT} frames. The goal is at most {against_greedy.GOAL:g} of the greedy keys. Where the optimum
is above that, no choice of keys could meet it.
""")
    _say("greedy insertion ...")
    yield from against_greedy.report(bodies, TOLERANCE)
    yield ""


def _decimate(decimated: list[tuple[Body, list[against_decimate.Left]]]) -> Iterator[str]:
    yield "### Keys beside Blender's Decimate"
    yield ""
    yield from _paragraph(f"""
`{MODE}`, with keys of each joint's own and as key poses; and Decimate on all F-curves with one error margin, found by
bisection so that the body is off by the same, measured on what the F-curves show. Counted are channels that vary in the
recording by more than {VARIES:g} (of the file's unit, a quaternion's component or a radian). The numbers are a frame
and a value in each of its channels for a key of a joint, the frame only once for a key pose; six for a key with free
handles; and two for a straight one, as imported. Imported keys may be between frames; what shows there is not measured.
""")
    yield from against_decimate.HEADER
    for body, left in decimated:
        yield from against_decimate.report(body.name, body.frames, left)
    yield ""
    yield from against_decimate.summary([left for _, left in decimated])
    yield ""


def _ozz(found: dict[str, Body]) -> Iterator[str]:
    if against_published.OZZ_BODY not in found:
        return
    body = found[against_published.OZZ_BODY]
    yield "### Beside ozz-animation's optimizer"
    yield ""
    yield from _paragraph(f"""
{body.name} in its own size ({body.extent:.2f} m): with {against_published.OZZ_KEYS} of
{against_published.OZZ_BEFORE} keys ozz-animation is off by {1e3 * against_published.OZZ_LARGEST:g} mm at
{100.0 * against_published.OZZ_RADIUS:g} cm from the joints. Each joint has keys of its own here, within the same error
of any point in a ball of that radius. Translation, rotation and scale are tracks of their own there, so a key of a
joint counts once for its translation and once for its rotation, where these vary. A track that stays where it is keeps
one key in ozz-animation, and none at its identity (`Decimate` in `src/animation/offline/decimate.h` takes the last key
away for as long as the one before, or the identity, is within the tolerance); they are counted so here. Translations
that change by less than a hundredth of the tolerance are kept constant first. The goal is half as many.
""")
    _say("ozz-animation ...")
    yield from against_published.ozz(body)
    yield ""


def _salient_poses(bodies: list[Body]) -> Iterator[str]:
    yield "### Beside Salient Poses"
    yield ""
    yield from _paragraph(f"""
Its authors (Roberts, Lewis and Anjyo, "Optimal and interactive keyframe selection for motion capture", 2019) report
medians over 20 clips of their own, which are not at hand: what is below is of other motions, and no race. Key poses
under `{MODE}`, with a budget; the errors are displacements of the joints themselves, and the mean is that of all joints
and frames. That they measure the same is an assumption. The median is of the bodies here that are long enough to
leave two poses.
""")
    _say("Salient Poses ...")
    yield from against_published.salient_poses(bodies, MODE)
    yield ""


def _feet(bodies: list[Body]) -> Iterator[str]:
    yield "### Feet that stand"
    yield ""
    yield from _paragraph(f"""
A joint of a foot (its name tells) stands where it is slower than {100.0 * feet.STILL:g} cm/s in the recording, at most
{100.0 * feet.LOW:g} cm above the lowest that it gets, for at least {feet.SHORTEST:g} s. Its slide is how far it gets
meanwhile, across the ground, from where it began to stand: the largest, and the sum over all contacts; `{MODE}`. Feet
that weigh {feet.WEIGHT:g} keep to {1e3 * TOLERANCE / feet.WEIGHT:g} mm.
""")
    _say("feet ...")
    yield from feet.report(bodies, MODE, TOLERANCE)
    yield ""


def _timing(paths: list[Path], found: dict[str, Body], recordings: list[tuple[str, float, Poses]]) -> Iterator[str]:
    yield "### Time"
    yield ""
    yield from _paragraph(f"""
`{timing.MODE}`, the faster of {timing.RUNS} runs, and in multiples of what greedy insertion of key poses takes for the
same in this run. Seconds are those of the machine at hand, which may have had other work to do.
""")
    _say("time ...")
    timed: list[tuple[Body, float | None]] = []
    if CYCLE in found:
        on = repeated(found[CYCLE].of_size(HEIGHT), CYCLE_FRAMES)
        timed.append((replace(on, name=f"{CYCLE}, walking on"), CYCLE_SECONDS))
    for path in paths:
        if path.stem == LONG:
            timed.append((import_rig(path, most_frames=sys.maxsize).body().of_size(HEIGHT), LONG_SECONDS))
    yield from timing.bodies(timed or [(body.of_size(HEIGHT), None) for body in found.values()], TOLERANCE)
    yield ""
    if CYCLE in found:
        yield f"A frame should cost at most {timing.GOAL_LONGER:g} times as much in a recording that is longer:"
        yield ""
        yield from timing.longer(found[CYCLE].of_size(HEIGHT), CYCLE_FRAMES, TOLERANCE)
        yield ""
    yield from _paragraph(f"""
Single recordings, their first {timing.SAMPLES} samples within {1e3 * timing.SINGLE_TOLERANCE:g} mm at a radius of
{timing.SINGLE_RADIUS:g} m; the goal is {timing.GOAL_SINGLE:g} s:
""")
    yield from timing.recordings(recordings)
    yield ""


def _paragraph(text: str) -> Iterator[str]:
    """Lines of even length, and an empty one."""
    yield from textwrap.wrap(" ".join(text.split()), WIDTH, break_long_words=False, break_on_hyphens=False)
    yield ""


def _say(what: str) -> None:
    print(what, file=sys.stderr, flush=True)
