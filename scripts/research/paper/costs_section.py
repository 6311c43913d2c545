"""The sections of the page on what modes cost: running time and bytes. Markdown."""

from __future__ import annotations

from collections.abc import Sequence

from rigid_motion_batch.report.numbers import listed

from . import claims
from .bandwidths import Bandwidth
from .claims import BLEND
from .results import Results
from .streaming.packets import HEADER
from .timing import ALGEBRA, AS_GOOD, CONFIDENCE, EQUAL, FAST, FRAMES_PER_S, PAPER, SINGLE, USERS, Timing
from .wording import changed, doubt, grid, timed


def running_time(found: Results) -> list[str]:
    if not found.timings:
        return []
    lines = [
        "## Running time",
        "",
        f"The time to compute a frame, at {FRAMES_PER_S:.0f} frames a second for {USERS} users, as a multiple of the "
        "state of the art's time in the same round: the median of all rounds, and its "
        f"{CONFIDENCE:.0%} confidence interval (bootstrap over rounds). All modes take turns. The paper has "
        f"{1.0 - claims.TIME_SAVED:.3f}. Processor time is in brackets. These numbers differ from run to run and from "
        "machine to machine; all others on this page do not.",
        "",
        "This program computes a segment once, and then the frames in it, so fewer updates make it faster.",
        "",
    ]
    for pace, title in (
        (EQUAL, "At equal rates"),
        (AS_GOOD, "Each at the rate with which it is as good, by the table above"),
        (PAPER, "Each at the paper's rate"),
    ):
        lines += [f"**{title}**", "", *_timing_grid(found, pace), ""]
    lines += [
        "**The algebras as they are written**: every frame is encoded, interpolated and extracted anew, as the paper's "
        "engines do, with all frames as one array, and one after the other. Two things keep this from being a verdict "
        "on an engine in C#. The products of multivectors are general ones here, of 16 or 32 coefficients, where an "
        "engine would compute only those that are not zero. And one frame after the other costs mostly the calls of "
        "NumPy.",
        "",
        *_algebra_grid(found),
        "",
        _times_of_the_blend(found),
        f"The {claims.ENERGY_SAVED:.0%} of energy that the paper saved cannot be measured here: only the processor's "
        "time can, which leaves out the radio, and fewer updates would spare that.",
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


def bandwidth(found: Results) -> list[str]:
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
        f"The example in the paper's text: {listed(example)}. Counted on real packets: "
        f"{listed([f'{count:.0f} n' for count in doubles])}, {'the same' if same else 'not the same'}. A receiver also "
        f"needs a header of {HEADER.itemsize} bytes (checksum, stream, number, time stamp, age). With and without it:",
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
