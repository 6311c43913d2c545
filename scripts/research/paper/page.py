"""The page: what came out, in plain words, beside what the paper says. Markdown.

Every number on it is read from the files of the other steps, and every word that depends on a number is chosen by it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from research.summaries import of_paper, with_summary
from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.report.numbers import listed

from . import bodies_section, bows_section, claims, costs_section, sending_section, shell, strips, triangle
from .bows import SCREW
from .bows_section import SPLINES
from .catching import LINK
from .claims import BLEND
from .results import Results
from .table import ADAPTIVE, RADIUS, UNIFORM, YARDSTICKS
from .timing import EQUAL, FAST
from .wording import changed, doubt, grid, heads, less, needed_cell, papers_row, percent, percents, verdict

LAST = ("## Running time", "## Bytes", "## Files")
"""Headings of the sections that come last."""

AFTER = {
    sending_section.HEADING: ("## Why a screw wins here and loses there", bodies_section.HEADING, *LAST),
    bodies_section.HEADING: LAST,
}
"""Of sections that may be written alone, the headings that may come after them."""


def write_page(found: Results) -> str:
    """The whole page."""
    sections = [
        _opening(found),
        _shell_error(found),
        _in_short(found),
        _triangle(found),
        _strips(found),
        _engines(found),
        _catching(found),
        _table(found),
        _clip_by_clip(found),
        _look_ahead(found),
        sending_section.sending_section(found.sending, found.sets),
        bows_section.bows_section(found),
        bodies_section.bodies_section(found.of_bodies),
        costs_section.running_time(found),
        costs_section.bandwidth(found),
        _files(found),
    ]
    page = "\n".join(line for section in sections if section for line in [*section, ""]).rstrip() + "\n"
    return with_summary(page, of_paper(page))


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
    whole = "\n\n".join(part.strip("\n") for part in (before, section, rest) if part.strip("\n")) + "\n"
    return with_summary(whole, of_paper(whole))


# -- sections ----------------------------------------------------------------------------------------------------------


def _opening(found: Results) -> list[str]:
    counted = [motion for motion in found.motions if not motion.left_out]
    lines = [
        "# The paper, reproduced",
        "",
        "Kamarianakis, Lydatakis and Papagiannakis, *Never 'Drop the Ball' in the Operating Room: An efficient "
        "hand-based VR HMD controller interpolation algorithm, for collaborative, networked virtual environments* "
        "(2021, [arXiv 2107.04875](https://arxiv.org/abs/2107.04875)). This page is for its readers: it has the "
        "figures, the table and the example of the paper, measured again by `python scripts/research paper`, with "
        "the paper's own numbers beside them. Every number is also in a file that the command wrote. The "
        "[glossary](glossary.md) explains the words.",
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


def _shell_error(found: Results) -> list[str]:
    if not found.needed:
        return []
    picture = ["", f"![{shell.TITLE}](paper/shell_error.svg)"] if "paper/shell_error.svg" in found.pictures else []
    return [
        "## The shell error",
        "",
        f"The largest distance of any point within {1e3 * RADIUS:.0f} mm of a body's origin from where it was recorded "
        "at that moment. It is one length for position and rotation together, and does not depend on the body's axes. "
        "The error of a whole clip is the root mean square (RMS) over all samples.",
        *picture,
    ]


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
    lines.append(
        "- Whole bodies live, within 5 mm, beside packed poses at even rates and beside game engines: "
        "[what bodies cost live](live_costs.md)."
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
        f"{len(found.steps)} in-betweens at even steps. Both go from the one pose to the other. SLERP turns evenly, by "
        f"{found.steps[0].slerp_turned_deg:.1f}° at every step; LERP turns by {found.steps[0].lerp_turned_deg:.1f}° at "
        f"the first step and by {_middle_step(found.steps):.1f}° half-way. They differ by at most "
        f"{far.apart_m * 1e3:.0f} mm, on a path of metres, and by {off.apart_deg:.1f}°. On the short paths between two "
        "updates of a hand they differ far less: see the table.",
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
        "A tool that turns about its tip, computed from its first and its last pose only. The tip leaves its place by "
        f"{listed(told)}. If position and rotation are interpolated separately, the origin moves straight; a screw "
        "turns the tool about the point that it turned about.",
    ]


def _engines(found: Results) -> list[str]:
    if "paper/engines.svg" not in found.pictures:
        return []
    return [
        "## The engines",
        "",
        "![Sequence diagram: sender, receiver and display, with an alternative for each algebra](paper/engines.svg)",
        "",
        "Drawn from the program's own table of modes. The sender sends the same for all of them.",
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
        f"their own, packed, sent over a link of {1e3 * LINK.latency:.0f} ms and interpolated by the receiver. Each "
        "cell has three numbers in mm: the RMS shell error of the tool; how far the tool slips at most in the hand "
        "that holds it; and the gap between tool and hand at the catch. Errors and gaps are over several senders that "
        "begin one after the other.",
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
            f"under {listed(loose)} it slips. No error of a single body shows this advantage of screws."
        )
    best = {rate: min(modes, key=lambda mode: at[mode, rate].rms_shell_m) for rate in rates}
    better = [f"{rate}/s" for rate in rates if at[SCREW, rate].rms_shell_m < at[REFERENCE, rate].rms_shell_m]
    where = (
        f"closer than the state of the art at {listed(better)}" if better else "further off than the state of the art"
    )
    lines.append(
        f"Over the whole throw a screw is {where}: in the air a body turns about its centre of mass, which moves on a "
        f"parabola. Closest is {listed([f'`{best[rate]}` at {rate}/s' for rate in rates])}."
    )
    return lines


def _table(found: Results) -> list[str]:
    if not found.sets or not found.needed:
        return []
    lines = [
        "## Table 1",
        "",
        "The lowest rate at which a mode is as good as the state of the art at its rate, and the bandwidth saved, or "
        "how much more it takes. As good means no larger an error, by three yardsticks set beforehand. Geometric "
        "means over clips, of which one counts where it has two samples to an update: "
        f"{_clips_counted(found)}. The first row after the paper's is a check, which compares the state of the art "
        f"with itself: it should need its own rates, and does to within {_check(found):.0%}. Where a rate was as good "
        "on some clips only, the cell says on how many. A dash: on none.",
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
        f"The bandwidth saved for the same {name}; each cell has that of {listed([f'`{mode}`' for mode in shown])}. "
        "`table.csv` has all of it, with the other modes and yardsticks.",
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
        "A receiver interpolates between two updates, so it shows every pose one interval late. A spline that also "
        "needs the update after these two is late by one more interval. The table has the milliseconds from an update "
        "to its pose on the screen, without the time on the link, at the rates of the table above. Modes with keys "
        "where needed are left out: choosing these keys takes the whole recording, which no stream has.",
        "",
        *grid(["mode", "behind", "ahead", *(f"{row.quality}, {row.state_of_the_art}/s" for row in claims.TABLE)], rows),
    ]


def _files(found: Results) -> list[str]:
    return [
        "## Files",
        "",
        "| file | what |",
        "|---|---|",
        "| `table.csv` | every cell of Table 1, for every clip and set of clips |",
        "| `errors.csv` | the curves behind the table: errors of every mode at every rate that was tried |",
        "| `bows.csv` | the number k |",
        "| `look_ahead.csv` | what each mode has to wait for |",
        "| `clips.csv` | the clips, and those left out |",
        "| `timing.csv` | running times |",
        "| `catching.csv`, `triangle.csv`, `strips.csv` | the numbers of the figures |",
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
