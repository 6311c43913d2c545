"""The page: what came out, in plain words, beside what the paper says. Markdown.

Every number on it is read from the files of the other steps, and every word that depends on a number is chosen by it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rigid_motion.motion import MODES
from rigid_motion_batch.comparison.report.findings import listed
from rigid_motion_batch.comparison.study.modes import REFERENCE
from rigid_motion_batch.streaming.packets import HEADER

from . import bodies_section, claims, sending_section, strips, triangle
from .bandwidths import Bandwidth
from .bows import SCREW
from .catching import LINK
from .results import Results
from .table import ADAPTIVE, UNIFORM, YARDSTICKS
from .timing import ALGEBRA, AS_GOOD, CONFIDENCE, EQUAL, FAST, FRAMES_PER_S, PAPER, SINGLE, USERS, Timing
from .wording import (
    changed,
    doubt,
    grid,
    heads,
    less,
    needed_cell,
    number,
    papers_row,
    percent,
    percents,
    timed,
    verdict,
)

BLEND = "pga_lerp"
"""The multivectors of the paper."""

SPLINES = ("motor_spline", "motor_spline_causal")

LAST = ("## Running time", "## Bytes", "## Files")
"""Headings of the sections that come last."""

AFTER = {
    sending_section.HEADING: ("## Why a screw wins here and loses there", bodies_section.HEADING, *LAST),
    bodies_section.HEADING: LAST,
}
"""Of sections that may be written alone, the headings that may come after them."""

WHAT_ASSETS_ARE = {
    "pivot": "a tool turned about its resting tip",
    "reach": "an arm that reaches",
    "screw": "a tool that drives a screw",
    "throw": "a tool thrown and caught",
}


def write_page(found: Results) -> str:
    """The whole page."""
    sections = [
        _opening(found),
        _in_short(found),
        _triangle(found),
        _strips(found),
        _engines(found),
        _catching(found),
        _table(found),
        _clip_by_clip(found),
        _look_ahead(found),
        sending_section.sending_section(found.sending, found.sets),
        _bows(found),
        bodies_section.bodies_section(found.of_bodies),
        _running_time(found),
        _bandwidth(found),
        _files(found),
    ]
    return "\n".join(line for section in sections if section for line in [*section, ""]).rstrip() + "\n"


def with_section(page: str, section: str) -> str:
    """A page with this section instead of its own of that heading, or where it belongs; the rest stays as it is."""
    heading = section.partition("\n")[0]
    before, found, after = f"\n{page}".partition(f"\n{heading}\n")
    if found:
        _, following, rest = after.partition("\n## ")
        rest = following + rest
    else:
        places = [place for name in AFTER[heading] if (place := before.find(f"\n{name}\n")) >= 0]
        place = min(places, default=len(before))
        before, rest = before[:place], before[place:]
    return "\n\n".join(part.strip("\n") for part in (before, section, rest) if part.strip("\n")) + "\n"


# -- sections ----------------------------------------------------------------------------------------------------------


def _opening(found: Results) -> list[str]:
    counted = [motion for motion in found.motions if not motion.left_out]
    lines = [
        "# The paper, reproduced",
        "",
        "Kamarianakis, Lydatakis and Papagiannakis, *Never 'Drop the Ball' in the Operating Room: An efficient "
        "hand-based VR HMD controller interpolation algorithm, for collaborative, networked virtual environments* "
        "(2021, [arXiv 2107.04875](https://arxiv.org/abs/2107.04875)): its figures, its table and its example again, "
        "by `python scripts/reproduce_paper.py`. Every number here was measured by that command, and is in a file "
        "that it wrote; what the paper says stands beside it.",
        "",
    ]
    for one in found.sets:
        motions = [motion for motion in counted if motion.of == one]
        seconds = sum(motion.seconds for motion in motions)
        samples = sum(motion.samples for motion in motions)
        names = listed([f"`{motion.clip}`" for motion in motions])
        lines.append(f"- {one.capitalize()}: {names}; {samples} samples, {seconds:.0f} s.")
    lines += [f"- Left out: `{motion.clip}`, {motion.left_out}." for motion in found.motions if motion.left_out]
    if found.run:
        lines += ["", ", ".join(f"{name} {value}" for name, value in found.run.items()) + "."]
    return lines


def _in_short(found: Results) -> list[str]:
    if not found.sets or not found.needed:
        return []
    rates = listed([str(row.state_of_the_art) for row in claims.TABLE])
    lines = [
        "## In short",
        "",
        f"The state of the art interpolates positions and quaternions separately (`{REFERENCE}`). At {rates} updates a "
        f"second it has a certain {next(iter(YARDSTICKS.values()))} on the {found.sets[0]}. To have no larger an "
        "error, the other ways need:",
        "",
        f"- The paper: {percents([row.saved for row in claims.TABLE])} less bandwidth.",
        f"- A screw (`{SCREW}`): {less(found.saved(SCREW))}. {verdict(found.saved(SCREW))}",
        f"- Multivectors by LERP (`{BLEND}`): {less(found.saved(BLEND))}. {_beside_the_screw(found)}",
    ]
    for mode in SPLINES:
        if mode in MODES and np.isfinite(found.saved(mode)).any():
            ahead = MODES[mode].ahead
            wait = f"which has to wait for {ahead} more update" if ahead else "which waits for no later update"
            lines.append(f"- `{mode}`, {wait}: {less(found.saved(mode))}. {verdict(found.saved(mode))}")
    for mode in (REFERENCE, SPLINES[0]):
        saved = found.saved(mode, ADAPTIVE)
        if np.isfinite(saved).any():
            lines.append(
                f"- `{mode}` with keys placed where it needs them, for which the whole recording has to be known: "
                f"{less(saved)}. "
                f"{verdict(saved)}"
            )
    lines += sending_section.in_short(found.sending, found.sets[0])
    blend = found.timing(FAST, EQUAL, BLEND)
    if blend:
        lines.append(
            "- Running time of a frame by multivectors, in this program's own form and at equal rates: "
            f"{changed(blend.relative)}{doubt(blend)}. The paper: {claims.TIME_SAVED:.1%} less."
        )
    return lines


def _triangle(found: Results) -> list[str]:
    if "paper/triangle.png" not in found.pictures or not found.steps:
        return []
    far = max(found.steps, key=lambda one: one.apart_m)
    off = max(found.steps, key=lambda one: one.apart_deg)
    return [
        "## LERP and SLERP of multivectors",
        "",
        "![A triangle between two extreme poses, by LERP in yellow and by SLERP in green](paper/triangle.png)",
        "",
        f"{len(found.steps)} in-betweens at even steps. Both run from the one pose to the other, and SLERP turns "
        f"evenly: {found.steps[0].slerp_turned_deg:.1f}° at every step, where LERP turns "
        f"{found.steps[0].lerp_turned_deg:.1f}° at the first and {_middle_step(found.steps):.1f}° half-way. They are "
        f"apart by {far.apart_m * 1e3:.0f} mm at most, on a way of metres, and by {off.apart_deg:.1f}°. On the short "
        "ways between two updates of a hand it is far less: see the table.",
    ]


def _strips(found: Results) -> list[str]:
    if "paper/strips.png" not in found.pictures or not found.instants:
        return []
    off = {mode: max(one.tip_off_m for one in found.instants if one.mode == mode) for mode in strips.ENGINES}
    told = [f"{off[mode] * 1e3:.0f} mm under `{mode}`" for mode in strips.ENGINES]
    return [
        "## Interpolation algorithms",
        "",
        "![A drill at seven moments under the state of the art, dual quaternions and multivectors](paper/strips.png)",
        "",
        "A tool that turns about its tip, from the first pose and the last alone. The tip leaves its place by "
        f"{listed(told)}. Position and rotation apart take the origin straight; a screw takes the tool about the "
        "point that it turned about.",
    ]


def _engines(found: Results) -> list[str]:
    if "paper/engines.svg" not in found.pictures:
        return []
    return [
        "## The engines",
        "",
        "![Sequence diagram: sender, receiver and display, with an alternative for each algebra](paper/engines.svg)",
        "",
        "Drawn from the program's own table of modes. What is sent is the same for all.",
    ]


def _catching(found: Results) -> list[str]:
    if not found.views:
        return []
    rates = list(dict.fromkeys(one.updates for one in found.views))
    modes = list(dict.fromkeys(one.mode for one in found.views))
    at = {(one.mode, one.updates): one for one in found.views}
    lines = ["## Catching a tool", ""]
    if "paper/catching.png" in found.pictures:
        lines += [
            "![A drill thrown and caught, as four modes show it at 5, 10, 15 and 20 updates a "
            "second](paper/catching.png)",
            "",
        ]
    if "paper/catching.mp4" in found.pictures:
        lines += ["[The same as a film](paper/catching.mp4).", ""]
    lines += [
        "A third person's view of `throw.csv`, with hands made up around it: the tool and both hands are streams of "
        f"their own, packed, sent over a link of {1e3 * LINK.latency:.0f} ms and filled in by the receiver. In a "
        "cell: the RMS shell error of the tool in mm; the most that the tool slips in the hand that holds it, in mm; "
        "the gap between tool and hand at the catch, in mm. Errors and gaps are over several senders that begin one "
        "after the other.",
        "",
        *grid(
            ["mode", *(f"{rate}/s" for rate in rates)],
            [
                [
                    f"`{mode}`",
                    *(
                        f"{at[mode, rate].rms_shell_m * 1e3:.1f}; {at[mode, rate].slip_m * 1e3:.1f}; "
                        f"{at[mode, rate].mean_gap_m * 1e3:.1f}"
                        for rate in rates
                    ),
                ]
                for mode in modes
            ],
        ),
        "",
    ]
    slips = {mode: max(at[mode, rate].slip_m for rate in rates) for mode in modes}
    steady = [f"`{mode}`" for mode in modes if slips[mode] < 1e-6]
    loose = [f"`{mode}` (by up to {slips[mode] * 1e3:.1f} mm)" for mode in modes if slips[mode] >= 1e-6]
    if steady and loose:
        lines.append(
            f"Under {listed(steady)} a tool stays in the hand that holds it, whatever point of the hand is tracked; "
            f"under {listed(loose)} it slips. That is a gain of screws which no error of a single body shows."
        )
    best = {rate: min(modes, key=lambda mode: at[mode, rate].rms_shell_m) for rate in rates}
    better = [f"{rate}/s" for rate in rates if at[SCREW, rate].rms_shell_m < at[REFERENCE, rate].rms_shell_m]
    where = (
        f"nearer than the state of the art at {listed(better)}" if better else "further off than the state of the art"
    )
    lines.append(
        f"Over the whole throw a screw is {where}: in the air a body turns about its centre of mass, and that runs on "
        f"a parabola. Nearest is {listed([f'`{best[rate]}` at {rate}/s' for rate in rates])}."
    )
    return lines


def _table(found: Results) -> list[str]:
    if not found.sets or not found.needed:
        return []
    lines = [
        "## Table 1",
        "",
        "The lowest rate at which a mode is as good as the state of the art at its rate, and the bandwidth saved. As "
        "good means no larger an error, by three yardsticks set beforehand. Geometric means over clips, of which one "
        f"counts where it has two samples to an update: {_clips_counted(found)}. The first row after the paper's is a "
        "check, which compares the state of the art with itself: it should need its own rates, and does to within "
        f"{_check(found):.0%}. Where a rate was as good on some clips only, the cell says on how many. A dash: on "
        "none.",
        "",
    ]
    for one in found.sets:
        for yardstick, name in YARDSTICKS.items():
            lines += [f"**{name[0].upper()}{name[1:]}, {one}**", "", *_needed_grid(found, one, yardstick), ""]
    return lines


def _needed_grid(found: Results, clips: str, yardstick: str) -> list[str]:
    rows = [papers_row()]
    cells: dict[tuple[str, ...], list[str]] = {}
    for decimation in (UNIFORM, ADAPTIVE):
        for mode in dict.fromkeys(one.mode for one in found.needed if one.decimation == decimation):
            texts = [
                needed_cell(found.cell(clips, row.state_of_the_art, mode, decimation, yardstick))
                for row in claims.TABLE
            ]
            keys = ", keys where needed" if decimation == ADAPTIVE else ""
            cells.setdefault((keys, *texts), []).append(f"`{mode}`")
    rows += [[" = ".join(modes) + keys, *texts] for (keys, *texts), modes in cells.items()]
    return grid(heads(""), rows)


def _clips_counted(found: Results) -> str:
    """On how many clips of each set the rows of the table are measured."""
    yardstick, told = next(iter(YARDSTICKS)), []
    for one in found.sets:
        cells = [found.cell(one, row.state_of_the_art, REFERENCE, UNIFORM, yardstick) for row in claims.TABLE]
        told.append(f"{listed([str(cell.asked if cell else 0) for cell in cells])} {one} in the four rows")
    return listed(told)


def _check(found: Results) -> float:
    """How far the state of the art is from needing what it has, at most."""
    cells = [one for one in found.needed if one.clips in found.sets and one.mode == REFERENCE]
    return max(abs(one.saved) for one in cells if one.decimation == UNIFORM)


def _clip_by_clip(found: Results) -> list[str]:
    if not found.needed:
        return []
    yardstick, name = next(iter(YARDSTICKS.items()))
    shown = [mode for mode in (SCREW, *SPLINES) if any(one.mode == mode for one in found.needed)]

    def saved(clip: str, updates: int) -> str:
        cells = [found.cell(clip, updates, mode, UNIFORM, yardstick) for mode in shown]
        if None in cells:
            return ""
        return "; ".join(percent(cell.saved) if np.isfinite(cell.saved) else "-" for cell in cells)

    rows = [
        [motion.clip, *(saved(motion.clip, row.state_of_the_art) for row in claims.TABLE)]
        for motion in found.motions
        if not motion.left_out
    ]
    return [
        "## Clip by clip",
        "",
        f"The bandwidth saved by the {name}, in a cell by {listed([f'`{mode}`' for mode in shown])}. All of it, with "
        "the other modes and yardsticks, is in `table.csv`.",
        "",
        *grid(["clip", *(f"{row.quality}, {row.state_of_the_art}/s" for row in claims.TABLE)], rows),
    ]


def _look_ahead(found: Results) -> list[str]:
    if not found.look_ahead:
        return []
    modes = list(dict.fromkeys(one.mode for one in found.look_ahead))
    at = {(one.mode, one.updates): one for one in found.look_ahead}
    rows = [
        [
            f"`{mode}`",
            str(MODES[mode].behind),
            str(MODES[mode].ahead),
            *(
                f"{at[mode, row.state_of_the_art].waits_s * 1e3:.0f}" if (mode, row.state_of_the_art) in at else "-"
                for row in claims.TABLE
            ),
        ]
        for mode in modes
    ]
    return [
        "## What it has to wait for",
        "",
        "A receiver fills in between two updates, so it shows every pose an interval late; a spline that takes the "
        "update after as well is later by one more. Milliseconds from an update to its pose on the screen, the link "
        "not counted, at the rates of the table above. Keys where they are needed take the whole recording: no "
        "stream has that.",
        "",
        *grid(["mode", "behind", "ahead", *(f"{row.quality}, {row.state_of_the_art}/s" for row in claims.TABLE)], rows),
    ]


def _bows(found: Results) -> list[str]:
    if not found.bows:
        return []
    rates = list(dict.fromkeys(one.updates for one in found.bows))
    clips = list(dict.fromkeys(one.clip for one in found.bows))
    at = {(one.clip, one.updates): one for one in found.bows}
    errors = {clip: float(np.mean([at[clip, rate].error for rate in rates if (clip, rate) in at])) for clip in clips}
    shares = {clip: float(np.mean([at[clip, rate].share for rate in rates if (clip, rate) in at])) for clip in clips}
    best, worst = min(clips, key=errors.__getitem__), max(clips, key=errors.__getitem__)
    lines = [
        "## Why a screw wins here and loses there",
        "",
        "Between two updates the origin runs straight under the state of the art, and on a bow under a screw. How "
        "much of that bow the recorded path has is a number k, and the screw has the smaller RMS position error "
        "where k is above a half, exactly. In a cell: k, and the screw's error as a multiple of the state of the "
        "art's.",
        "",
        *grid(
            ["clip", *(f"{rate}/s" for rate in rates)],
            [
                [
                    clip,
                    *(
                        f"{number(at[clip, rate].share)}; {at[clip, rate].error:.2f}" if (clip, rate) in at else ""
                        for rate in rates
                    ),
                ]
                for clip in clips
            ],
        ),
        "",
        f"A screw is best on {_said(best)}: {errors[best]:.2f} times the error on average, with a k of "
        f"{number(shares[best])}; and worst on {_said(worst)}: {errors[worst]:.2f} times, with "
        f"{number(shares[worst])}. " + _motions_in_words(shares),
    ]
    wins = {rate: [at[clip, rate].share > 0.5 for clip in clips if (clip, rate) in at] for rate in rates}
    low, high = min(rates), max(rates)
    lines.append(
        f"At {low} updates a second the screw is nearer on {sum(wins[low])} of {len(wins[low])} clips, at {high} on "
        f"{sum(wins[high])} of {len(wins[high])}"
        + (": between updates far apart a hand does more than one screw." if sum(wins[low]) < sum(wins[high]) else ".")
    )
    left = [one.error for one in found.bows if one.updates >= claims.TABLE[-1].state_of_the_art]
    if left:
        lines.append(
            "How much can be gained is bounded by what is at stake: of the state of the art's error at "
            f"{claims.TABLE[-1].state_of_the_art} updates a second and more, the screw left {min(left):.0%} where it "
            f"was best and {max(left):.0%} where it was worst."
        )
    splines = [mode for mode in SPLINES if np.isfinite(found.saved(mode)).any()]
    if splines:
        told = [f"`{mode}` {less(found.saved(mode))}" for mode in splines]
        lines.append(
            "What a straight line and a screw have in common is the corner at every update, and that costs more than "
            f"either's path between them: without it, {listed(told)}. Keys where the motion needs them, instead of "
            f"evenly in time, add to that where nobody waits for a stream: `{SPLINES[0]}` "
            f"{less(found.saved(SPLINES[0], ADAPTIVE))}."
        )
    return lines


def _motions_in_words(means: dict[str, float]) -> str:
    """What the assets, of which it is known what moves, have of the bow."""
    known = {clip: WHAT_ASSETS_ARE[clip] for clip in means if clip in WHAT_ASSETS_ARE}
    bowed = [f"{what} ({means[clip]:.2f})" for clip, what in known.items() if means[clip] > 0.5]
    straight = [f"{what} ({means[clip]:.2f})" for clip, what in known.items() if means[clip] <= 0.5]
    parts = []
    if bowed:
        parts.append(f"Of the motions that are known, a screw suits {listed(bowed)}")
    if straight:
        parts.append(f"{'it' if bowed else 'a screw'} does not suit {listed(straight)}")
    return "; ".join(parts) + "." if parts else ""


def _running_time(found: Results) -> list[str]:
    if not found.timings:
        return []
    lines = [
        "## Running time",
        "",
        f"Of a generated frame, {FRAMES_PER_S:.0f} a second for {USERS} users, as a multiple of the state of the "
        f"art's in the same round; the median of all rounds and its {CONFIDENCE:.0%} confidence interval (bootstrap "
        f"over rounds). All take turns. The paper: {1.0 - claims.TIME_SAVED:.3f}. In brackets, processor time. These "
        "numbers differ from run to run and from machine to machine; all others on this page do not.",
        "",
        "This program's own forms work out a segment once and then fill in its frames, so fewer updates make them "
        "quicker.",
        "",
    ]
    for pace, title in (
        (EQUAL, "At equal rates"),
        (AS_GOOD, "Each at the rate with which it is as good, by the table above"),
        (PAPER, "Each at the paper's rate"),
    ):
        lines += [f"**{title}**", "", *_timing_grid(found, pace), ""]
    lines += [
        "**The algebras as they are written**, every frame encoded, filled in and extracted anew, as the paper's "
        "engines do: all frames as one array, and one after the other. The products of multivectors are general ones "
        "here, of 16 or 32 coefficients, where an engine would write out those that are not zero; one frame after "
        "the other is for the most part the cost of calling NumPy. So neither is a verdict on an engine in C#",
        "",
        *_algebra_grid(found),
        "",
        _times_of_the_blend(found),
        f"The {claims.ENERGY_SAVED:.0%} of energy that the paper saved cannot be measured here: a processor's time is "
        "what there is, and it leaves out the radio, which fewer updates would spare.",
    ]
    return lines


def _timing_grid(found: Results, pace: str) -> list[str]:
    modes = dict.fromkeys(one.mode for one in found.timings if (one.reading, one.pace) == (FAST, pace))
    rows = [
        [f"`{mode}`", *(_timing_cell(found.timing(FAST, pace, mode, row)) for row in claims.TABLE)] for mode in modes
    ]
    return grid(["mode", *(f"{row.quality}, {row.state_of_the_art}/s" for row in claims.TABLE)], rows)


def _timing_cell(one: Timing | None) -> str:
    return "" if one is None else timed(one) if one.pace == EQUAL else f"{one.updates:.3g}/s: {timed(one)}"


def _times_of_the_blend(found: Results) -> str:
    """What multivectors by LERP take, in all rows."""
    told = []
    for pace, where in (
        (EQUAL, "at equal rates"),
        (AS_GOOD, "at the rates that are as good"),
        (PAPER, "at the paper's rates"),
    ):
        races = [found.timing(FAST, pace, BLEND, row) for row in claims.TABLE]
        if all(races):
            told.append(f"{listed([changed(one.relative) + doubt(one) for one in races])} {where}")
    if not told:
        return ""
    return (
        f"Multivectors by LERP take, in the four rows, {'; '.join(told)}. The paper has {claims.TIME_SAVED:.1%} less."
    )


def _algebra_grid(found: Results) -> list[str]:
    modes = dict.fromkeys(one.mode for one in found.timings if one.reading == ALGEBRA)
    rows = [[f"`{mode}`", *(timed(found.timing(how, EQUAL, mode)) for how in (ALGEBRA, SINGLE))] for mode in modes]
    return grid(["mode", "as arrays", "one after the other"], rows)


def _bandwidth(found: Results) -> list[str]:
    if not found.bandwidths:
        return []
    rates = list(dict.fromkeys(one.updates for one in found.bandwidths))
    packings = list(dict.fromkeys(one.packing for one in found.bandwidths))
    at = {(one.packing, one.updates): one for one in found.bandwidths}
    doubles = [at["double", rate].bytes_per_s for rate in rates]
    example = [f"{count} n bytes a second for n users at {rate} updates" for rate, count in claims.EXAMPLE.items()]
    same = all(round(counted, 6) == claims.EXAMPLE[rate] for counted, rate in zip(doubles, rates, strict=True))
    return [
        "## Bytes",
        "",
        f"The example of the text: {listed(example)}. Counted from packets that were packed: "
        f"{listed([f'{count:.0f} n' for count in doubles])}, {'the same' if same else 'not the same'}. With the "
        f"header of {HEADER.itemsize} bytes that a receiver needs besides (checksum, stream, number, time stamp, age):",
        "",
        *grid(
            [
                "packing",
                "bytes a pose",
                *(f"{rate}/s, poses alone" for rate in rates),
                *(f"{rate}/s, with headers" for rate in rates),
                "error",
            ],
            [
                [
                    at[name, rates[0]].label,
                    str(at[name, rates[0]].bytes_a_pose),
                    *(f"{at[name, rate].bytes_per_s:.0f} n" for rate in rates),
                    *(f"{at[name, rate].with_headers_per_s:.0f} n" for rate in rates),
                    _packing_error(at[name, rates[0]]),
                ]
                for name in packings
            ],
        ),
        "",
        _packing_remark(at, packings, rates[0]),
    ]


def _packing_error(one: Bandwidth) -> str:
    if one.position_error_m < 1e-12:
        return "none"
    return f"within {one.position_error_m * 1e6:.2g} µm and {one.rotation_error_deg:.2g}°"


def _packing_remark(at: dict[tuple[str, int], Bandwidth], packings: Sequence[str], rate: int) -> str:
    smallest = min(packings, key=lambda name: at[name, rate].bytes_a_pose)
    share = 1.0 - at[smallest, rate].bytes_per_s / at["double", rate].bytes_per_s
    return (
        f"Packing the same poses as {at[smallest, rate].label.lower()} saves {share:.0%} of their bytes, at any rate "
        "and under any mode."
    )


def _files(found: Results) -> list[str]:
    return [
        "## Files",
        "",
        "| file | what |",
        "|---|---|",
        "| `table.csv` | every cell of Table 1, for every clip and set of clips |",
        "| `errors.csv` | the curves behind it: errors of every mode at every rate that was tried |",
        "| `bows.csv`, `look_ahead.csv`, `clips.csv` | k; the waiting; the clips, and those left out |",
        "| `timing.csv` | the races |",
        "| `catching.csv`, `triangle.csv`, `strips.csv` | the figures in numbers |",
        "| `bandwidth.csv` | bytes |",
        "| `sending.csv`, `sent.csv` | streams that are sent when needed: every cell, and every stream behind it |",
    ]


# -- words of this page ------------------------------------------------------------------------------------------------


def _beside_the_screw(found: Results) -> str:
    apart = float(np.nanmax(np.abs(np.subtract(found.saved(BLEND), found.saved(SCREW)))))
    return "As much as a screw." if apart < 0.005 else f"Up to {apart:.0%} of the bandwidth apart from a screw."


def _middle_step(steps: Sequence[triangle.Step]) -> float:
    turned = np.array([one.lerp_turned_deg for one in steps])
    return float(np.diff(turned).max())


def _said(clip: str) -> str:
    return f"`{clip}`, {WHAT_ASSETS_ARE[clip]}" if clip in WHAT_ASSETS_ARE else f"`{clip}`"
