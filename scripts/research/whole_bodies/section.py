"""The section *Whole bodies* of the page about key reduction, as lines of Markdown."""

from __future__ import annotations

import sys
import textwrap
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from rigid_motion.motion import Poses
from rigid_motion_batch.scenes.decimated_bodies import VARIES

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
Blender's own importers read the bodies, BVH with quaternions as the rotation mode. Of longer recordings the first
{MOST_FRAMES} frames are taken. If the armature itself is animated, it counts as a joint, on which all others hang. All
bodies are made the same size: the largest extent of the joints in the first frame, along any axis, becomes {HEIGHT:g}
m. The error is measured where the chain of joints puts a joint: it is the largest displacement of any point in a ball
of {100.0 * RADIUS:g} cm around the joint, on every frame. The tolerance is {1e3 * TOLERANCE:g} mm unless a section
says otherwise.
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
All joints have keys on the same frames. *Greedy* adds one key at a time, on the frame with the largest error, until
all errors are within the tolerance; then it takes out every key that it can do without. The *optimum* is the smallest
possible number of keys, found by dynamic programming, which tries every frame as the next key; for modes that look at
four keys, only bodies of at most {against_greedy.SHORT} frames have it. The goal is at most {against_greedy.GOAL:g} of
the greedy keys. Where the optimum is above that, no choice of keys could meet the goal.
""")
    _say("greedy insertion ...")
    yield from against_greedy.report(bodies, TOLERANCE)
    yield ""


def _decimate(decimated: list[tuple[Body, list[against_decimate.Left]]]) -> Iterator[str]:
    yield "### Keys beside Blender's Decimate"
    yield ""
    yield from _paragraph(f"""
`{MODE}` with keys of each joint's own, and with key poses, beside Decimate on all F-curves. Decimate gets one error
margin, found by bisection so that the body has the same largest error, measured on what the F-curves show. Only
channels count that vary in the recording by more than {VARIES:g} (of the file's unit, a quaternion's component or a
radian). The column *numbers* counts what has to be stored: for a key of a joint its frame and a value in each channel,
where a key pose has its frame only once; six for a key with free handles; and two for a straight key, as imported.
Imported keys may lie between frames; what Blender shows there is not measured.
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
{100.0 * against_published.OZZ_RADIUS:g} cm from the joints. Here each joint gets keys of its own, within the same error
for any point in a ball of that radius. In ozz-animation, translation, rotation and scale are separate tracks, so a key
of a joint counts once for its translation and once for its rotation, where these vary. A track that does not change
keeps one key in ozz-animation, and none if it is the identity (`Decimate` in `src/animation/offline/decimate.h` takes
the last key away as long as the one before, or the identity, is within the tolerance); it is counted in the same way
here. Before the search, translations that change by less than a hundredth of the tolerance are made constant. The goal
is half as many keys.
""")
    _say("ozz-animation ...")
    yield from against_published.ozz(body)
    yield ""


def _salient_poses(bodies: list[Body]) -> Iterator[str]:
    yield "### Beside Salient Poses"
    yield ""
    yield from _paragraph(f"""
Its authors (Roberts, Lewis and Anjyo, "Optimal and interactive keyframe selection for motion capture", 2019) report
medians over 20 clips of their own, which are not available. The numbers below are of other motions, so this is no fair
race. They are for key poses under `{MODE}`, with a budget. The errors are displacements of the joints themselves, and
the mean is over all joints and frames; we assume that the authors measure the same. The median is over the bodies here
that are long enough to leave two poses.
""")
    _say("Salient Poses ...")
    yield from against_published.salient_poses(bodies, MODE)
    yield ""


def _feet(bodies: list[Body]) -> Iterator[str]:
    yield "### Feet that stand"
    yield ""
    yield from _paragraph(f"""
A joint of a foot (known by its name) stands while it is slower than {100.0 * feet.STILL:g} cm/s in the recording and at
most {100.0 * feet.LOW:g} cm above its lowest place, for at least {feet.SHORTEST:g} s. Its slide is how far it moves
across the ground meanwhile, from where it began to stand. The table has the largest slide, and the sum over all
contacts, under `{MODE}`. Feet with a weight of {feet.WEIGHT:g} stay within {1e3 * TOLERANCE / feet.WEIGHT:g} mm.
""")
    _say("feet ...")
    yield from feet.report(bodies, MODE, TOLERANCE)
    yield ""


def _timing(paths: list[Path], found: dict[str, Body], recordings: list[tuple[str, float, Poses]]) -> Iterator[str]:
    yield "### Time"
    yield ""
    yield from _paragraph(f"""
The time of `{timing.MODE}`, the faster of {timing.RUNS} runs, and as a multiple of the time that greedy insertion of
key poses takes for the same in this run. Seconds are those of one machine, which may have had other work to do.
""")
    _say("time ...")
    timed: list[tuple[Body, float | None]] = []
    if CYCLE in found:
        on = repeated(found[CYCLE].of_size(HEIGHT), CYCLE_FRAMES)
        timed.append((replace(on, name=f"{CYCLE}, walking on"), CYCLE_SECONDS))
    timed += [
        (import_rig(path, most_frames=sys.maxsize).body().of_size(HEIGHT), LONG_SECONDS)
        for path in paths
        if path.stem == LONG
    ]
    yield from timing.bodies(timed or [(body.of_size(HEIGHT), None) for body in found.values()], TOLERANCE)
    yield ""
    if CYCLE in found:
        yield f"In a longer recording, a frame should take at most {timing.GOAL_LONGER:g} times as long:"
        yield ""
        yield from timing.longer(found[CYCLE].of_size(HEIGHT), CYCLE_FRAMES, TOLERANCE)
        yield ""
    yield from _paragraph(f"""
The time of single recordings: their first {timing.SAMPLES} samples, within {1e3 * timing.SINGLE_TOLERANCE:g} mm at a
radius of {timing.SINGLE_RADIUS:g} m. The goal is {timing.GOAL_SINGLE:g} s:
""")
    yield from timing.recordings(recordings)
    yield ""


def _paragraph(text: str) -> Iterator[str]:
    """Lines of even length, and an empty one."""
    yield from textwrap.wrap(" ".join(text.split()), WIDTH, break_long_words=False, break_on_hyphens=False)
    yield ""


def _say(what: str) -> None:
    print(what, file=sys.stderr, flush=True)
