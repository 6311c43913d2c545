"""Put into these pages the figures that they quote from one another, each from the place where it was measured.

    python docs/quote_figures.py
    python docs/quote_figures.py --check

A quote is what stands between <!-- quote NAME --> and <!-- end -->; `QUOTES` says what belongs there. Figures come
from pages that a script has written (paper.md, subframes.md, benchmark_batch.md) and from docs/figures/recordings.json,
which docs/measure_recordings.py writes; those of the motions in assets/ are measured at once. Pages of figures get
their summaries as well, see research/summaries.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent / folder) for folder in ("addon", "scripts")]

from research.markdown_tables import tables, tables_of, titled
from research.paper.table import RADIUS
from research.summaries import SUMMARIES, with_summary
from research.summaries.paper import TABLE_1, percent_saved
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.metrics import measure_reconstruction
from rigid_motion_batch.analysis.modes import BEST_OF
from rigid_motion_batch.analysis.reconstructions import reconstruct
from rigid_motion_batch.files import write_text
from rigid_motion_batch.places import ASSETS
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.report.numbers import listed

QUOTE = re.compile(r"(<!-- quote ([a-z0-9-]+) -->)(.*?)(<!-- end -->)", re.DOTALL)

RATES = ("30", "20", "15", "12")
"""Updates a second of the paper's table."""

WHERE_NEEDED = ", keys where needed"
"""How the table of the paper's page calls adaptive keys."""


class Sources:
    """What figures are quoted from, read when it is asked for."""

    def __init__(self, folder: Path = DOCS) -> None:
        self._folder = folder

    def page(self, name: str) -> str:
        return (self._folder / name).read_text(encoding="utf-8")

    @property
    def recordings(self) -> dict:
        return json.loads(self.page("figures/recordings.json"))


# -- how figures are written -------------------------------------------------------------------------------------------


def spread(values: Sequence[float], decimals: int = 0) -> str:
    """The least and the largest: "4 to 7"; one number where they are the same."""
    low, high = f"{min(values):.{decimals}f}", f"{max(values):.{decimals}f}"
    return low if low == high else f"{low} to {high}"


def fewer(saved: Sequence[float]) -> str:
    """Percents saved, as words: "4 to 7 % fewer", and where it takes more, "between 3 % more and 7 % fewer"."""
    low, high = round(min(saved)), round(max(saved))
    if low < 0 < high:
        return f"between {-low} % more and {high} % fewer"
    if low < 0:
        return f"{spread([-percent for percent in saved])} % more"
    return f"{spread(saved)} % fewer"


def row_of(values: Sequence[float], decimals: int = 2) -> str:
    """Numbers in a sentence."""
    return listed([f"{value:.{decimals}f}" for value in values])


def grid(head: Sequence[str], align: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table, with an empty line above and below: between comments it would not be one otherwise."""
    lines = ["| " + " | ".join(cells) + " |" for cells in (head, *rows)]
    lines.insert(1, f"|{'|'.join(align)}|")
    return "\n\n" + "\n".join(lines) + "\n\n"


# -- keys needed -------------------------------------------------------------------------------------------------------


def _table_1(sources: Sources) -> dict[str, list[float]]:
    """By mode and way to have keys, what is saved of the updates of the state of the art, in percent."""
    found = {}
    for first, *cells in titled(sources.page("paper.md"), TABLE_1).rows:
        kind = WHERE_NEEDED if first.endswith(WHERE_NEEDED) else ""
        for mode in first.removesuffix(kind).split(" = "):
            found.setdefault(mode.strip("`*") + kind, [percent_saved(cell) for cell in cells])
    return found


def keys_needed(sources: Sources) -> str:
    table = _table_1(sources)
    rows = [("`lerp_slerp`", "evenly spaced", ["1.00"] * len(RATES))]
    for mode in ("lerp_slerp", "dq_sclerp", "pga_lerp", "motor_spline"):
        for kind, how in (("", "evenly spaced"), (WHERE_NEEDED, "adaptive")):
            if mode + kind in table and (mode, kind) != ("lerp_slerp", ""):
                rows.append((f"`{mode}`", how, _shares(table[mode + kind])))
    rows.append(("*the paper's claim*", "evenly spaced", _shares(table["the paper"])))
    head = ("mode", "keys", *(f"{rate}/s" for rate in RATES))
    return grid(head, ("---", "---", *["---:"] * 4), [(mode, how, *shares) for mode, how, shares in rows])


def _shares(saved: Sequence[float]) -> list[str]:
    return [f"{1.0 - percent / 100.0:.2f}" for percent in saved]


def screw_needs(sources: Sources) -> str:
    return fewer(_saved(sources, "dq_sclerp"))


def adaptive_saves(sources: Sources) -> str:
    """What the smooth mode saves with adaptive keys, beside the paper's figures, and in which rows it reaches them."""
    ours, paper = _saved(sources, "motor_spline" + WHERE_NEEDED), _saved(sources, "the paper")
    reached = [rate for rate, saved, claimed in zip(RATES, ours, paper, strict=True) if round(saved) >= round(claimed)]
    missed = [rate for rate in RATES if rate not in reached]
    where = f"at {listed(reached)} keys a second" if reached else "nowhere"
    told = f"reach the paper's figures {where}"
    if missed:
        told += f", and miss them at {listed(missed)}"
    return f"{told} ({row_of(ours, 0)} % saved; the paper has {row_of(paper, 0)} %)"


def _saved(sources: Sources, mode: str) -> list[float]:
    """Percents."""
    return _table_1(sources)[mode]


def own_count(sources: Sources) -> str:
    """The same as compare.py itself counts it."""
    counted = sources.recordings["keys_needed"]

    def saved(mode: str, decimation: str) -> str:
        return f"{row_of([100.0 * (1.0 - counted[mode][decimation][rate]) for rate in RATES], 0)} %"

    chosen = counted["motor_spline"]["adaptive"]
    paper = _saved(sources, "the paper")
    missed = [
        rate for rate, claimed in zip(RATES, paper, strict=True) if round(100.0 * (1.0 - chosen[rate])) < round(claimed)
    ]
    verdict = f"missed at {listed(missed)}" if missed else "reached at all four rates"
    return (
        f"`dq_sclerp` saves {saved('dq_sclerp', 'uniform')}, `motor_spline` {saved('motor_spline', 'uniform')}, and "
        f"`motor_spline` with adaptive keys {saved('motor_spline', 'adaptive')}: by that count the paper's figures are "
        f"{verdict}"
    )


def fitted_saves(sources: Sources) -> str:
    """How many fewer keys than adaptive ones, where they are fitted."""
    counted, told = sources.recordings["keys_needed"], []
    for mode in ("lerp_slerp", "motor_spline"):
        by = counted[mode]
        saved = [100.0 * (1.0 - by["fitted"][rate] / by["adaptive"][rate]) for rate in RATES]
        told.append(f"{fewer(saved)} under `{mode}`")
    return listed(told)


def fitted_reach(sources: Sources) -> str:
    by = sources.recordings["keys_needed"]["motor_spline"]["fitted"]
    return f"{row_of([100.0 * (1.0 - by[rate]) for rate in RATES], 0)} %"


# -- errors, rules and the best of several -----------------------------------------------------------------------------


def recordings(sources: Sources) -> str:
    samples = sources.recordings["recordings"]
    return f"{len(samples)} recordings, {sum(samples.values())} samples"


def errors_of_modes(sources: Sources) -> str:
    errors = sources.recordings["errors"]
    rates = list(next(iter(errors.values())))
    rows = [(rate, *(f"{errors[mode][rate]:.2f}" for mode in errors)) for rate in rates]
    return grid(("keys a second", *(f"`{mode}`" for mode in errors)), ["---:"] * (1 + len(errors)), rows)


def causal_errors(sources: Sources, part: str) -> str:
    return row_of(list(sources.recordings["causal_errors"][part].values()))


RULES = {
    "parabola": "parabola, no bound",
    "2": "share at most 2 short / long",
    "1.5": "at most 1.5 short / long",
    "1": "at most short / long",
    "1, none up to 1/16": "at most short / long, and none up to 1/16",
    "0.75": "at most 0.75 short / long",
    "squared": "at most (short / long)^2",
    "between_neighbours": "slope between the neighbours, h0 / (h0 + h1)",
}

OWN_RULE = "1, none up to 1/16"


def rules(sources: Sources) -> str:
    found, rows = sources.recordings["rules"], []
    for name, words in RULES.items():
        cells = (words, *(f"{found[name]['adaptive'][rate]:.3f}" for rate in RATES))
        rows.append([f"**{cell}**" for cell in cells] if name == OWN_RULE else cells)
    head = ("the twist at a key", *(f"{rate}/s" for rate in RATES))
    return grid(head, ("---", *["---:"] * 4), rows)


def rules_even(sources: Sources) -> str:
    """The largest difference between evenly spaced keys needed, from the program's rule to another."""
    found = sources.recordings["rules"]
    own = found[OWN_RULE]["uniform"]
    return f"{max(abs(rule['uniform'][rate] - own[rate]) for rule in found.values() for rate in RATES):.3f}"


def rules_fitted(sources: Sources, name: str) -> str:
    return row_of([sources.recordings["rules"][name]["fitted"][rate] for rate in RATES], 3)


def best_of(sources: Sources) -> str:
    everything, without = (sources.recordings["best_of"][name] for name in ("all", "without_spline"))
    rates = list(everything)

    def plain(found: dict, figure: str) -> list[str]:
        return [f"{found[rate][figure]:.2f}" for rate in rates]

    def percents(found: dict, figure: str) -> list[str]:
        return [f"{100.0 * found[rate][figure]:.0f} %" for rate in rates]

    reach = [f"{everything[rate]['rms_shell_least']:.2f} to {everything[rate]['rms_shell_most']:.2f}" for rate in rates]
    rows = [
        ("**RMS shell error, all modes to choose from**", *plain(everything, "rms_shell")),
        ("from clip to clip", *reach),
        ("RMS velocity error", *plain(everything, "rms_velocity")),
        ("largest shell error", *plain(everything, "largest_shell")),
        ("segments with `motor_spline`", *percents(everything, "with_spline")),
        ("keys at which the mode changes", *percents(everything, "changes")),
        ("**RMS shell error, without `motor_spline`**", *plain(without, "rms_shell")),
        ("keys at which the mode changes", *percents(without, "changes")),
    ]
    return grid(("keys a second", *rates), ("---", *["---:"] * len(rates)), rows)


def best_of_adaptive(sources: Sources) -> str:
    found = sources.recordings["best_of_adaptive"]
    gains = spread([100.0 * (1.0 - error) for error in found.values()], 1)
    return f"{gains} % with {listed(list(found))} keys a second (`--decimate adaptive --budget {','.join(found)}`)"


def best_of_gains(sources: Sources, which: str) -> str:
    found = sources.recordings["best_of"][which].values()
    return f"{spread([100.0 * (1.0 - one['rms_shell']) for one in found], 1)} %"


# -- the motions in assets/ --------------------------------------------------------------------------------------------


@cache
def _asset_errors(asset: str, rate: str, modes: Sequence[str]) -> dict[str, float]:
    """By mode, the RMS shell error of an asset that is kept at so many keys a second, in metres: measured now."""
    (clip,), _ = read_clips([str(ASSETS / f"{asset}.csv")], "blender")
    return {
        row.mode: row.rms_shell_m for row in measure_reconstruction(reconstruct(clip, Uniform(rate), modes, RADIUS))
    }


def smooth_errors(sources: Sources) -> str:
    """Of the clip and the modes of smooth.png."""
    errors = _asset_errors("reach", "8", ("lerp_slerp", "dq_sclerp", "motor_spline"))
    return listed([f"{1e3 * error:.1f} mm" for error in errors.values()])


def throw_gains(sources: Sources, rate: str) -> str:
    """How much closer `best_of` is than the best single mode."""
    errors = dict(_asset_errors("throw", rate, (*KEYFRAME_MODES, BEST_OF)))
    best = errors.pop(BEST_OF)
    return f"{100.0 * (1.0 - best / min(errors.values())):.0f} %"


# -- sub-frames and memory ------------------------------------------------------------------------------------


def sub_frames(sources: Sources, motion: str, rotation: str, figure: str) -> str:
    """The largest of all modes."""
    (found,) = tables_of(sources.page("subframes.md"), motion)
    place = found.head.index(figure)
    cells = [row[place] for row in found.rows if row[1] == rotation]
    return max(cells, key=float)


def memory(sources: Sources, length: str, figure: str) -> str:
    found = next(one for one in tables(sources.page("benchmark_batch.md")) if one.head[0] == "one clip of")
    return found.row(length)[found.head.index(figure)]


QUOTES: dict[str, Callable[[Sources], str]] = {
    "keys-needed": keys_needed,
    "screw-needs": screw_needs,
    "adaptive-saves": adaptive_saves,
    "own-count": own_count,
    "fitted-saves": fitted_saves,
    "fitted-reach": fitted_reach,
    "recordings": recordings,
    "errors-of-modes": errors_of_modes,
    "causal-whole": lambda sources: causal_errors(sources, "whole"),
    "causal-none": lambda sources: causal_errors(sources, "none"),
    "rules": rules,
    "rules-even": rules_even,
    "rules-fitted": lambda sources: rules_fitted(sources, OWN_RULE),
    "rules-fitted-parabola": lambda sources: rules_fitted(sources, "parabola"),
    "best-of": best_of,
    "best-of-adaptive": best_of_adaptive,
    "best-of-gains": lambda sources: best_of_gains(sources, "all"),
    "best-of-gains-without-spline": lambda sources: best_of_gains(sources, "without_spline"),
    "smooth-errors": smooth_errors,
    "throw-gain-5": lambda sources: throw_gains(sources, "5"),
    "throw-gain-10": lambda sources: throw_gains(sources, "10"),
    "sub-frames-brisk": lambda sources: sub_frames(sources, "Brisk", "QUATERNION", "live, mm"),
    "sub-frames-violent": lambda sources: sub_frames(sources, "Violent", "QUATERNION", "live, mm"),
    "sub-frames-exact": lambda sources: sub_frames(sources, "Violent", "QUATERNION", "exact, mm"),
    "memory-short": lambda sources: memory(sources, "6 min", "a worker at most, MB"),
    "memory-long": lambda sources: memory(sources, "60 min", "a worker at most, MB"),
    "memory-long-samples": lambda sources: memory(sources, "60 min", "samples"),
    "memory-long-seconds": lambda sources: memory(sources, "60 min", "seconds"),
    "memory-sample": lambda sources: memory(sources, "60 min", "more than for a clip of no length, a sample"),
}
"""What is quoted, by its name."""


def filled(page: str, sources: Sources, name: str = "") -> str:
    """A page with its quotes, and its summary if it has one, as the sources have them.

    Raises
    ------
    LookupError
        Where a quote has a name that is not in `QUOTES`, or a source lacks what it names.
    """
    if name in SUMMARIES:
        page = with_summary(page, SUMMARIES[name](page))

    def quoted(found: re.Match[str]) -> str:
        if found[2] not in QUOTES:
            raise LookupError(f"{name}: nothing is known to quote as {found[2]!r}")
        return found[1] + QUOTES[found[2]](sources) + found[4]

    return QUOTE.sub(quoted, page)


def main(arguments: list[str] | None = None) -> int:
    """Fill in all pages; with --check, say which are not as they would be, and return 1 if any."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="change nothing, and say which pages would change")
    check = parser.parse_args(arguments).check
    changed, sources = [], Sources()
    for path in sorted(DOCS.glob("*.md")):
        page = path.read_text(encoding="utf-8")
        new = filled(page, sources, path.name)
        if new != page:
            changed.append(path.name)
            if not check:
                write_text(path, new)
    print("\n".join(changed) if changed else "All pages are as their sources have them.")
    return int(check and bool(changed))


if __name__ == "__main__":
    sys.exit(main())
