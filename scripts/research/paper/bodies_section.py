"""The section of the page on whole bodies: Markdown, and as there every number and every word by the files."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigid_motion_batch.analysis.metrics import NOTHING
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.analysis.needed import RATES
from rigid_motion_batch.analysis.radii import JOINT
from rigid_motion_batch.command_line import printable
from rigid_motion_batch.report.numbers import listed
from rigid_motion_batch.rows import read_rows

from . import bodies, claims
from .bodies import (
    ALONE,
    BODY,
    ERROR_RATES,
    FILES,
    IN_PARENTS,
    LIMBS,
    MODES,
    Apart,
    Body,
    ErrorOfBody,
    KeysOfBody,
    Limb,
)
from .bows import SCREW
from .claims import BLEND
from .table import ADAPTIVE, RADIUS, UNIFORM
from .wording import changed, grid, less, percent

HEADING = "## The same study on bodies"

ONE_MOTION = 1e-6
"""Metres: what is nearer than that is one motion for all that can be seen."""

ALIKE = 1e-3
"""Degrees, of which the same holds."""

LITTLE = 0.01
"""A share of an error that makes no difference."""

SEVERAL = 1.5
"""Samples between two key poses."""

CHOSEN = ", chosen by the motion"


@dataclass(frozen=True, eq=False)
class BodyResults:
    """What the files of `FILES` hold, in their order."""

    bodies: Sequence[Body] = ()
    limbs: Sequence[Limb] = ()
    needed: Sequence[KeysOfBody] = ()
    errors: Sequence[ErrorOfBody] = ()
    apart: Sequence[Apart] = ()

    @classmethod
    def read(cls, reads: Callable[[str], Path], there: Iterable[str]) -> BodyResults:
        """Read those of the files that are there; `reads` takes a name to where the file is."""
        files = frozenset(there)
        return cls(*(read_rows(reads(name), kind) if name in files else [] for name, kind in FILES.items()))

    @property
    def counted(self) -> list[Body]:
        return [body for body in self.bodies if not body.left_out]

    @property
    def rates(self) -> list[int]:
        """Key poses a second at which any body counts, from the most to the fewest."""
        asked = {row.rate for row in self.needed if row.of == BODY}
        return [int(rate) for rate in RATES if int(rate) in asked]

    def counting(self, rate: int) -> list[str]:
        """The bodies that count at a rate."""
        there = {row.body for row in self.needed if (row.of, row.rate) == (BODY, rate)}
        return [body.body for body in self.counted if body.body in there]

    def saved(self, of: str, mode: str, decimation: str, rates: Iterable[int]) -> list[float]:
        """The keys that a mode saves, as a share, rate by rate; NaN where no error was reached."""
        means = [bodies.mean_share(self.needed, of, mode, decimation, rate) for rate in rates]
        return [1.0 - mean.share if mean and mean.reached else float("nan") for mean in means]

    def error(self, of: str, way: str, mode: str, rate: int, column: str = "rms_shell_m") -> float:
        return bodies.mean_error(self.errors, of, way, mode, rate, column)

    def limb_kinds(self) -> list[str]:
        """The kinds of limbs that any body has."""
        there = {row.of for row in self.errors}
        return [limb for limb in LIMBS if limb in there]


def bodies_section(found: BodyResults) -> list[str]:
    """The section; nothing where no body was asked for."""
    if not found.bodies:
        return []
    lines = [HEADING, "", *_opening(found)]
    if found.counted:
        parts = (_keys, _body_by_body, _errors, _apart, _alone, _limbs_by_body, _both_ways, _beside_the_paper)
        lines += [line for part in parts for line in part(found)]
        lines += ["", f"All numbers are in {listed([f'`{name}`' for name in FILES])}."]
    return lines


# -- parts -------------------------------------------------------------------------------------------------------------


def _opening(found: BodyResults) -> list[str]:
    lines = [
        "Every joint has its keys in its parent's space, as in a rig. Its error is measured where the chain of joints "
        "puts it, in the space of the roots, which is that of the recording. The error of a body is the RMS over all "
        f"joints and samples, of shells of {JOINT * 1e3:.0f} mm around the joints. At a key pose every joint has a "
        "key.",
        "",
    ]
    if found.counted:
        lines.append(f"- Bodies: {listed([_told(body) for body in found.counted])}.")
    names: dict[str, list[str]] = {}
    for body in found.counted:
        joints = [limb.joint for limb in found.limbs if limb.body == body.body and not limb.left_out]
        names.setdefault(listed([quoted(joint) for joint in joints]) if joints else "none", []).append(body.body)
    if found.counted:
        told = [f"{joints} ({listed([f'`{name}`' for name in of])})" for joints, of in names.items()]
        lines.append(f"- Taken for {listed([*LIMBS])} by their names: {'; '.join(told)}.")
    cut = [f"`{body.body}`" for body in found.counted if body.seconds > bodies.SEARCHED]
    if cut:
        lines.append(
            f"- Key poses needed by the whole body: of the first {bodies.SEARCHED:.0f} s of {listed(cut)}, since the "
            "search takes long. All else is of whole recordings."
        )
    jumping = [f"`{body.body}`" for body in found.counted if body.skipped]
    if jumping:
        lines.append(f"- Without its first sample, a pose from which it jumps into the motion: {listed(jumping)}.")
    lines += [f"- Left out: `{body.body}`, {quoted(body.left_out, '')}." for body in found.bodies if body.left_out]
    return lines


def _told(body: Body) -> str:
    return f"`{body.body}` ({body.joints} joints, {body.seconds:.1f} s of {body.samples_per_s:.0f} samples a second)"


def _keys(found: BodyResults) -> list[str]:
    rates = found.rates
    if not rates:
        return ["", "None of them has two samples to a key pose, and an error, at any of the rates."]
    rows: dict[tuple[str, ...], list[str]] = {}
    for decimation, how in ((UNIFORM, ""), (ADAPTIVE, CHOSEN)):
        for mode in MODES:
            cells = [_cell(found, BODY, mode, decimation, rate) for rate in rates]
            rows.setdefault((how, *cells), []).append(f"`{mode}`")
    lines = [
        "",
        f"**Key poses needed to be as good as `{REFERENCE}`**",
        "",
        "Key poses a second, and how many fewer or more they are. Geometric means over bodies; a body counts where "
        "it has two samples for each key pose. Key poses chosen by the motion are chosen to keep the largest error "
        "small, not the RMS that is compared. A dash: it takes all samples, on every body.",
        "",
        *grid(
            ["", *(f"{rate}/s, {_number_of(found.counting(rate))}" for rate in rates)],
            [[" = ".join(modes) + how, *cells] for (how, *cells), modes in rows.items()],
        ),
        "",
        *_who_counts(found),
    ]
    told = [(mode, UNIFORM) for mode in MODES[1:]] + [(mode, ADAPTIVE) for mode in (REFERENCE, MODES[-1])]
    before: dict[tuple[str, ...], str] = {}
    for mode, decimation in told:
        saved = tuple(percent(share) for share in found.saved(BODY, mode, decimation, rates))
        if saved in before:
            fewer = f"as many as {before[saved]}"
        else:
            fewer = _fewer(found, mode, decimation)
            before[saved] = f"`{mode}`{CHOSEN if decimation == ADAPTIVE else ''}"
        lines.append(f"- {_called(mode)}{CHOSEN if decimation == ADAPTIVE else ''}: {fewer}.")
    return lines


def _who_counts(found: BodyResults) -> list[str]:
    every = [body.body for body in found.counted]
    of_whom: dict[tuple[str, ...], list[str]] = {}
    for rate in found.rates:
        of_whom.setdefault(tuple(found.counting(rate)), []).append(str(rate))
    told = [
        f"at {listed(rates)} key poses a second {listed([f'`{name}`' for name in names])}"
        for names, rates in of_whom.items()
        if list(names) != every
    ]
    lines = []
    if told:
        rest = of_whom.get(tuple(every))
        ending = f"; all of them at {listed(rest)}" if rest else ""
        lines.append(f"Not all recordings are fast enough: counted are {'; '.join(told)}{ending}.")
    for rate in found.rates:
        between = {body.body: round(body.samples_per_s / rate - 1.0, 1) for body in found.counted}
        single = [f"`{name}`" for name in found.counting(rate) if between[name] < SEVERAL]
        if single:
            lines.append(
                f"At {rate} a second there is hardly more than one sample between two key poses of {listed(single)}: "
                "there it takes many keys to make up for a small error."
            )
    return [*lines, ""] if lines else []


def _fewer(found: BodyResults, mode: str, decimation: str) -> str:
    saved = found.saved(BODY, mode, decimation, found.rates)
    return f"{less(saved, 'fewer')} key poses than {listed([str(rate) for rate in found.rates])} a second"


def _called(mode: str) -> str:
    return {SCREW: f"A screw (`{SCREW}`)", BLEND: f"Multivectors by LERP (`{BLEND}`)"}.get(mode, f"`{mode}`")


def _cell(found: BodyResults, of: str, mode: str, decimation: str, rate: int) -> str:
    mean = bodies.mean_share(found.needed, of, mode, decimation, rate)
    if mean is None or not mean.reached:
        return "-"
    part = "" if mean.reached == mean.asked else f"; {mean.reached} of {mean.asked}"
    return f"{rate * mean.share:.1f} ({percent(1.0 - mean.share)}{part})"


def _body_by_body(found: BodyResults) -> list[str]:
    if not found.rates:
        return []
    at = {(row.body, row.mode, row.rate): row for row in found.needed if (row.of, row.decimation) == (BODY, UNIFORM)}

    def keys(body: str, rate: int) -> str:
        rows = [at.get((body, mode, rate)) for mode in MODES]
        return "; ".join("-" if row is None or np.isinf(row.keys) else f"{row.keys:.0f}" for row in rows) * any(rows)

    few = [
        f"`{body.body}` {at[body.body, REFERENCE, found.rates[-1]].reference_keys}"
        for body in found.counted
        if (body.body, REFERENCE, found.rates[-1]) in at
    ]
    return [
        "",
        f"Body by body, evenly spaced: key poses in a cell under {_modes(MODES)}. A dash: all samples. Short "
        f"recordings have few to save: at {found.rates[-1]} a second {listed(few)}.",
        "",
        *grid(
            ["body", *(f"{rate}/s" for rate in found.rates)],
            [[body.body, *(keys(body.body, rate) for rate in found.rates)] for body in found.counted],
        ),
    ]


def _errors(found: BodyResults) -> list[str]:
    at = {(row.body, row.mode, row.rate): row for row in found.errors if row.of == BODY}
    rates = [rate for rate in ERROR_RATES if any(row.rate == rate for row in at.values())]
    if not rates:
        return []

    def cell(error: Callable[[str], float]) -> str:
        straight = error(REFERENCE)
        return f"{straight * 1e3:.2f}; " + "; ".join(_multiple(error(mode), straight) for mode in MODES[1:])

    def of_body(body: str, rate: int) -> str:
        if (body, REFERENCE, rate) not in at:
            return ""
        return cell(lambda mode: at[body, mode, rate].rms_shell_m)

    def velocity(mode: str, rate: int) -> float:
        return found.error(BODY, IN_PARENTS, mode, rate, "rms_velocity_m_s")

    rows = [[body.body, *(of_body(body.body, rate) for rate in rates)] for body in found.counted]
    rows.append(
        ["*mean*", *(cell(lambda mode, rate=rate: found.error(BODY, IN_PARENTS, mode, rate)) for rate in rates)]
    )
    told = [
        f"`{mode}` {_at_rates([found.error(BODY, IN_PARENTS, mode, rate) for rate in rates], _straight(found, rates))}"
        for mode in MODES[1:]
    ]
    speeds = [
        f"`{mode}` {_at_rates([velocity(mode, rate) for rate in rates], [velocity(REFERENCE, rate) for rate in rates])}"
        for mode in MODES[1:]
    ]
    return [
        "",
        f"**Errors at {listed([str(rate) for rate in rates])} key poses a second**",
        "",
        f"In a cell: the RMS shell error of `{REFERENCE}` in mm, and as multiples of it those of {_modes(MODES[1:])}. "
        "The mean is geometric.",
        "",
        *grid(["body", *(f"{rate}/s" for rate in rates)], rows),
        "",
        f"Error at {listed([str(rate) for rate in rates])} a second, beside `{REFERENCE}`: {'; '.join(told)}. Of "
        f"velocities: {'; '.join(speeds)}.",
    ]


def _straight(found: BodyResults, rates: Iterable[int]) -> list[float]:
    return [found.error(BODY, IN_PARENTS, REFERENCE, rate) for rate in rates]


def _apart(found: BodyResults) -> list[str]:
    if not found.apart:
        return []
    rates = list(dict.fromkeys(row.rate for row in found.apart))
    at = {(row.body, row.rate): row for row in found.apart}
    names = [body.body for body in found.counted if any((body.body, rate) in at for rate in rates)]
    moved = {body.body: body.moved_m for body in found.counted}
    columns = ("parents_m", "carried_m", "roots_m", "all_m", "error_m")

    def cell(body: str, column: str) -> str:
        return "; ".join(_mm(getattr(at[body, rate], column)) for rate in rates if (body, rate) in at)

    lines = [
        "",
        "**Where a screw is something else, and where not**",
        "",
        f"How far `{SCREW}` gets from `{REFERENCE}` at most, in mm, at {listed([f'{rate}/s' for rate in rates])}; "
        f"{_turned(found)}. The columns: how far any joint but the roots moves in its parent's space; the difference "
        "of these joints in that space; their difference in the space of the roots, with the roots held still; the "
        f"difference of the roots; the difference of all joints; and how far `{REFERENCE}` is from the recording at "
        "most.",
        "",
        *grid(
            ["body", "joints move", "in parents' spaces", "roots held", "roots", "all", "from the recording"],
            [[name, _mm(moved[name]), *(cell(name, column) for column in columns)] for name in names],
        ),
        "",
    ]
    return [*lines, _in_their_parents(found, names), _of_the_roots(found)]


def _turned(found: BodyResults) -> str:
    turned = max(row.turned_deg for row in found.apart)
    return "both turn alike" if turned < ALIKE else f"they are turned from one another by up to {turned:.2g}°"


def _in_their_parents(found: BodyResults, names: Sequence[str]) -> str:
    """Whether screw and SLERP are one motion in the parents' spaces."""
    largest = {
        name: max((row for row in found.apart if row.body == name), key=lambda row: row.parents_m) for name in names
    }
    bodies_by_name = {body.body: body for body in found.counted}
    one = [name for name in names if largest[name].parents_m < ONE_MOTION]
    rest = [name for name in names if largest[name].parents_m >= ONE_MOTION]
    parts = []
    if one:
        parts.append(
            f"In their parents' spaces, all joints but the roots of {listed([f'`{name}`' for name in one])} move by at "
            f"most {_mm(max(bodies_by_name[name].moved_m for name in one))} mm: screw and SLERP are the same motion "
            "there."
        )
    for name in rest:
        row = largest[name]
        carried = max(other.carried_m for other in found.apart if other.body == name)
        parts.append(
            f"In `{name}` a joint moves by up to {_mm(bodies_by_name[name].moved_m)} mm, and the two differ by up to "
            f"{_mm(row.parents_m)} mm in its parent's space ({quoted(row.joint)}) and by {_mm(carried)} mm in that of "
            "the roots."
        )
    return " ".join(parts)


def _of_the_roots(found: BodyResults) -> str:
    """What of the difference is that of the roots, and what it is beside the error."""
    widest = max(found.apart, key=lambda row: row.all_m)
    if widest.all_m < ONE_MOTION:
        return "So it is at the roots: on these bodies a screw is nothing else."
    share = [row.roots_m >= row.carried_m for row in found.apart]
    whose = (
        "the roots' on every body"
        if all(share)
        else "that of the joints below the roots on every body"
        if not any(share)
        else f"the roots' in {sum(share)} of {len(share)} cells, and that of the joints below them in the others"
    )
    beside = max(row.all_m / row.error_m if row.error_m > NOTHING else 0.0 for row in found.apart)
    return (
        f"The larger part of the difference is {whose}. It is up to {_mm(widest.all_m)} mm on `{widest.body}` at "
        f"{widest.rate}/s, where `{REFERENCE}` is off by up to {_mm(widest.error_m)} mm; nowhere more than "
        f"{percent(beside)} of that."
    )


def _alone(found: BodyResults) -> list[str]:
    kinds = [kind for kind in found.limb_kinds() if any(row.of == kind for row in found.needed)]
    if not kinds:
        return []
    rates = [int(rate) for rate in RATES if any(row.of in kinds and row.rate == int(rate) for row in found.needed)]
    rows = []
    for kind in kinds:
        own: dict[tuple[str, ...], list[str]] = {}
        for mode in MODES:
            cells = tuple(
                "; ".join(_saved_cell(found, kind, mode, decimation, rate) for decimation in (UNIFORM, ADAPTIVE))
                for rate in rates
            )
            own.setdefault(cells, []).append(f"`{mode}`")
        rows += [[kind, " = ".join(modes), *cells] for cells, modes in own.items()]
    table = grid(["", "mode", *(f"{rate}/s" for rate in rates)], rows)
    table[1] = "| --- | --- |" + " ---: |" * len(rates)
    lines = [
        "",
        f"**{listed(kinds).capitalize()} alone**",
        "",
        "As a tracker on them would see it: each limb is a single rigid body in the space of the roots, with a key at "
        f"every update and a shell of {RADIUS * 1e3:.0f} mm, and nothing is known of the joints between. Each cell has "
        f"the keys saved, compared with evenly spaced keys of `{REFERENCE}`: first by evenly spaced keys, then by keys "
        "chosen by the motion. Geometric means over limbs.",
        "",
        *table,
        "",
    ]
    for kind in kinds:
        told = [f"`{mode}` {less(found.saved(kind, mode, UNIFORM, rates), 'fewer')}" for mode in (SCREW, MODES[-1])]
        lines.append(
            f"- {kind.capitalize()}, evenly spaced, keys beside {listed([str(rate) for rate in rates])} a second: "
            f"{'; '.join(told)}."
        )
    return lines


def _limbs_by_body(found: BodyResults) -> list[str]:
    """What a screw does for limbs alone, on each body."""
    alone = [row for row in found.errors if row.way == ALONE]
    kinds = found.limb_kinds()
    names = [body.body for body in found.counted if any(row.body == body.body for row in alone)]
    rates = [rate for rate in ERROR_RATES if any(row.rate == rate for row in alone)]
    if not names or not rates:
        return []

    def screws(body: str, kind: str) -> list[float]:
        own = [row for row in alone if row.body == body]
        errors = [
            [bodies.mean_error(own, kind, ALONE, mode, rate) for mode in (SCREW, REFERENCE)]
            for rate in rates
            if any((row.of, row.rate) == (kind, rate) for row in own)
        ]
        return [screw / straight if straight > NOTHING else float("nan") for screw, straight in errors]

    at = {(body, kind): screws(body, kind) for body in names for kind in kinds}
    better = [f"{kind} of `{body}`" for (body, kind), ratios in at.items() if ratios and max(ratios) < 1.0 - LITTLE]
    worse = [f"{kind} of `{body}`" for (body, kind), ratios in at.items() if ratios and min(ratios) > 1.0 + LITTLE]
    count = sum(map(bool, at.values()))
    told = (
        f"It is smaller by more than {LITTLE:.0%} at every rate for {listed(better) if better else 'none'}, and larger "
    )
    told += f"for {listed(worse) if len(worse) < count else 'all'}." if worse else "for none."
    return [
        "",
        f"Body by body, at {listed([f'{rate}/s' for rate in rates])}: the RMS shell error of `{SCREW}` alone as a "
        f"multiple of that of `{REFERENCE}` alone. {told}",
        "",
        *grid(
            ["body", *kinds],
            [
                [
                    body,
                    *("; ".join(f"{ratio:.3f}" if ratio > 0.0 else "-" for ratio in at[body, kind]) for kind in kinds),
                ]
                for body in names
            ],
        ),
    ]


def _saved_cell(found: BodyResults, of: str, mode: str, decimation: str, rate: int) -> str:
    mean = bodies.mean_share(found.needed, of, mode, decimation, rate)
    if mean is None or not mean.reached:
        return "-"
    part = "" if mean.reached == mean.asked else f" ({mean.reached} of {mean.asked})"
    return percent(1.0 - mean.share) + part


def _both_ways(found: BodyResults) -> list[str]:
    kinds = found.limb_kinds()
    rates = [rate for rate in ERROR_RATES if any(row.of in kinds and row.rate == rate for row in found.errors)]
    if not kinds or not rates:
        return []
    rows = [
        [
            kind,
            f"`{mode}`",
            *(f"{_mm(found.error(kind, way, mode, rate))}" for rate in rates for way in (IN_PARENTS, ALONE)),
        ]
        for kind in kinds
        for mode in MODES
    ]
    table = grid(["", "mode", *(f"{rate}/s, {way}" for rate in rates for way in (IN_PARENTS, ALONE))], rows)
    table[1] = "| --- | --- |" + " ---: |" * 2 * len(rates)
    lines = [
        "",
        "**Through its joints, or alone**",
        "",
        "The same limbs with the same key times in two ways: through their joints, each of which has its key, and "
        f"alone, with a single key. RMS shell error ({RADIUS * 1e3:.0f} mm) in mm, geometric means over limbs.",
        "",
        *table,
        "",
    ]
    for kind in kinds:
        carried = [limb.chain for limb in found.limbs if limb.limb == kind and not limb.left_out]
        told = []
        for mode in (REFERENCE, SCREW, MODES[-1]):
            ways = ([found.error(kind, way, mode, rate) for rate in rates] for way in (ALONE, IN_PARENTS))
            told.append(f"{_at_rates(*ways)} under `{mode}`")
        keys = f"{min(carried)} to {max(carried)}" if min(carried) < max(carried) else f"{max(carried)}"
        lines.append(
            f"- {kind.capitalize()} are closer to the recording {_nearer(found, kind, rates)}. Alone, the error at "
            f"{listed([str(rate) for rate in rates])} a second is {'; '.join(told)}. Through joints, {keys} keys take "
            "the place of one."
        )
    lines += ["", _screws_alone(found, kinds, rates)]
    return lines


def _nearer(found: BodyResults, kind: str, rates: Sequence[int]) -> str:
    """Which way puts a limb nearer to the recording, mode by mode."""
    told = []
    for mode in MODES:
        won = [f"{r}/s" for r in rates if found.error(kind, ALONE, mode, r) < found.error(kind, IN_PARENTS, mode, r)]
        if won:
            told.append(f"`{mode}`" if len(won) == len(rates) else f"`{mode}` at {listed(won)}")
    if not told:
        return "through their joints, under every mode"
    if told == [f"`{mode}`" for mode in MODES]:
        return "alone, under every mode"
    return f"alone under {listed(told)}, and through their joints otherwise"


def _screws_alone(found: BodyResults, kinds: Sequence[str], rates: Sequence[int]) -> str:
    """What a screw does for a limb alone, beside what it does through joints."""
    told = []
    for kind in kinds:
        ways = [
            _at_rates(*([found.error(kind, way, mode, rate) for rate in rates] for mode in (SCREW, REFERENCE)))
            for way in (ALONE, IN_PARENTS)
        ]
        told.append(f"{kind} {ways[0]} alone, and {ways[1]} through joints")
    return f"What a screw changes of the error of `{REFERENCE}`: {'; '.join(told)}."


def _beside_the_paper(found: BodyResults) -> list[str]:
    """How near screws come to the paper's savings, anywhere in these tables."""
    best = []
    for row in claims.TABLE:
        saved = {of: found.saved(of, SCREW, UNIFORM, [row.state_of_the_art])[0] for of in (BODY, *LIMBS)}
        there = {of: share for of, share in saved.items() if np.isfinite(share)}
        if there:
            of = max(there, key=there.__getitem__)
            best.append((row, there[of], "whole bodies" if of == BODY else f"{of} alone"))
    if not best:
        return []
    told = [
        f"{percent(saved)} at {row.state_of_the_art} a second ({of})"
        if round(saved, 2) >= 0.0
        else f"nothing at {row.state_of_the_art} a second, where it takes {percent(saved)} ({of})"
        for row, saved, of in best
    ]
    reached = [str(row.state_of_the_art) for row, saved, _ in best if saved >= row.saved - 0.005]
    ending = f"It is there at {listed(reached)} a second." if reached else "Nowhere here is it the paper's."
    return [
        "",
        f"The most that a screw saves of evenly spaced keys: {listed(told)}. The paper has "
        f"{listed([f'{row.saved:.0%}' for row, *_ in best])}. {ending}",
    ]


# -- words -------------------------------------------------------------------------------------------------------------


def quoted(name: str, mark: str = "`") -> str:
    """What somebody else called something, so that it is one line of text and nothing of Markdown."""
    plain = printable(name).replace("`", "'").replace("|", "/").strip() or "?"
    return f"{mark}{plain}{mark}" if mark else plain.replace("<", "(").replace(">", ")").replace("[", "(")


def _modes(modes: Iterable[str]) -> str:
    return listed([f"`{mode}`" for mode in modes])


def _number_of(names: Sequence[str]) -> str:
    return "1 body" if len(names) == 1 else f"{len(names)} bodies"


def _multiple(error: float, straight: float) -> str:
    return f"{error / straight:.3f}" if straight > NOTHING else "-"


def _at_rates(errors: Sequence[float], others: Sequence[float]) -> str:
    """What errors are beside others, rate by rate: "3.1% less and 0.4% more"."""
    return listed([_changed(error, other) for error, other in zip(errors, others, strict=True)])


def _changed(error: float, other: float) -> str:
    if not (np.isfinite(error) and other > NOTHING):
        return "-"
    return "the same" if abs(error / other - 1.0) < 0.0005 else changed(error / other)


def _mm(metres: float) -> str:
    """Millimetres, and nothing where there is but rounding."""
    if np.isnan(metres):
        return "-"
    return "0" if metres < NOTHING else f"{metres * 1e3:.2g}" if metres < 1e-3 else f"{metres * 1e3:.1f}"
