"""Of `benchmark_live.py`, `reduction.py` and `subframes.py`: what was measured in Blender."""

from __future__ import annotations

from research.markdown_tables import Table, first_numbers, numbers, tables, tables_of

from .on_top import facts, span
from .speed import OURS


def of_live(page: str) -> list[str]:
    """Of the page of `benchmark_live.py`."""
    return facts(page, (_live_edits, _live_beside_baking, _files_grow, _goals))


def _live_edits(page: str) -> str:
    everyday = [one for one in tables(page) if one.head[0] == "what" and len(one.head) == 4]
    if not everyday:
        raise LookupError("no everyday work")
    edits = [one.row("one key edited, and the view updated")[3] for one in everyday]
    played = [numbers(one.row("all frames played")[3])[0] for one in everyday]
    scene = everyday[0].section.rpartition(", turned by")[0]
    return (
        f"Measured: edits, playback and files with modes, beside Blender without. With {scene}, an edit of one key "
        f"takes {' and '.join(dict.fromkeys(edits))} (quaternions and Euler angles), and playback {span(played, 2)} "
        "times as long."
    )


def _live_beside_baking(page: str) -> str:
    rows = [row for one in tables(page) for row in one.rows if "bake_action_objects" in row[2]]
    ratios = [numbers(row[3])[0] for row in rows if row[3].endswith("times faster")]
    slower = sum(row[3].endswith("times as long") for row in rows)
    if not ratios:
        raise LookupError("no baking")
    text = (
        f"Computing in-betweens, choosing a mode and baking are {span(ratios)} times faster than Blender's own baking"
    )
    return f"{text}, and slower in {slower} case{'s' * (slower > 1)}." if slower else f"{text}, and nowhere slower."


def _files_grow(page: str) -> str:
    rows = [row for one in tables(page) for row in one.rows if row[0].startswith("the file") and "without" in row[2]]
    ratios = first_numbers([row[3] for row in rows])
    edits = [
        numbers(row[3])[0]
        for one in tables(page)
        for row in one.rows
        if row[0].startswith("the view updated after an edit of each")
    ]
    if not ratios:
        raise LookupError("no files")
    return (
        f"Where it hurts: files of shots are {span(ratios)} times as large as without modes, and the view takes "
        f"{span(edits)} times as long to be updated after an edit of every object."
    )


def _goals(page: str) -> str:
    told = [(one.section, row) for one in tables(page) if one.head[-1] == "goal" for row in one.rows if row[-1]]
    if not told:
        raise LookupError("no goals")
    missed = [row for _, row in told if row[-1].endswith("missed")]
    counts: dict[str, int] = {}
    for row in missed:
        what = f"{row[0]} ({row[-1].removesuffix(': missed')})"
        counts[what] = counts.get(what, 0) + 1
    names = "; ".join(what if count == 1 else f"{what}, {count} times" for what, count in counts.items())
    text = f"Goals met: {len(told) - len(missed)} of {len(told)}."
    return f"{text} Missed: {names}." if missed else text


def of_reduction(page: str) -> list[str]:
    """Of the page of `reduction.py`."""
    return facts(
        page,
        (_decimate_as_good, _bodies_beside_decimate, _bodies_beside_greedy, _beside_ozz, _feet, _time_of_reduction),
    )


def _decimate_as_good(page: str) -> str:
    told, recordings = [], ""
    for one in tables(page):
        if one.head[0] == "Decimate, in multiples of the reduced poses":
            _, recordings, keys, frames, count, *_ = one.row("as good")
            told.append(
                f"{one.section[0].lower()}{one.section[1:]}, keys on {frames} times the frames, {count} times the "
                f"numbers, {keys} times the keys in a channel"
            )
    if not told:
        raise LookupError("no recordings")
    return (
        f"Measured: *Reduce Keys to Poses* beside Blender's Decimate on {recordings} recordings. To be as good, "
        f"Decimate needs, {'; '.join(told)}."
    )


def _bodies_beside_decimate(page: str) -> str:
    (_, found) = tables_of(page, "Keys beside Blender's Decimate")
    own, poses = found.row("each joint its own"), found.row("key poses")
    return (
        f"Of whole bodies Decimate needs {own[2]} times the numbers of keys of each joint's own, and {poses[2]} times "
        "those of key poses."
    )


def _bodies_beside_greedy(page: str) -> str:
    (found,) = tables_of(page, "Key poses beside greedy insertion")
    ratios = [float(cell) for cell in found.column("ratio")]
    missed = sum("missed" in cell for cell in found.column("goal"))
    known = [
        (int(keys), int(best)) for keys, best in zip(found.column(OURS), found.column("optimum"), strict=True) if best
    ]
    optimal = sum(keys == best for keys, best in known)
    return (
        f"Key poses of whole bodies are {span(ratios, 2)} times as many as by greedy insertion; the goal was missed in "
        f"{missed} of {len(ratios)} cases. In {optimal} of the {len(known)} cases whose optimum is known, they are the "
        "optimum."
    )


def _beside_ozz(page: str) -> str:
    (found,) = tables_of(page, "Beside ozz-animation")
    rows = [row for row in found.rows if row[4]]
    missed = sum("missed" in row[4] for row in rows)
    return (
        f"For the same error it takes {span([float(row[3]) for row in rows], 2)} times the keys of ozz-animation; the "
        f"goal was missed by {missed} of {len(rows)} modes."
    )


def _feet(page: str) -> str:
    (found,) = tables_of(page, "Feet that stand")
    slides: dict[str, list[float]] = {}
    for row in found.rows:
        if row[5]:
            slides.setdefault(row[1], []).append(numbers(row[3])[0])
    own, heavy = (max(slides[f"each joint its own{how}"]) for how in ("", ", feet weigh 4"))
    recorded = max(numbers(row[3])[0] for row in found.rows if row[1] == "recording")
    return (
        f"Where it hurts: feet that stand slide by up to {own:.1f} mm with keys of each joint's own, {heavy:.1f} mm "
        f"where feet weigh more, and {recorded:.1f} mm in the recordings."
    )


def _time_of_reduction(page: str) -> str:
    every = tables_of(page, "Time")
    of_bodies, single = every[0], every[-1]
    goals = [cell for one in every for row in one.rows for cell in row if cell in ("met", "**missed**")]
    ratios = [float(cell) for cell in single.column("time in multiples of it")]
    (slow,) = [row for row in single.rows if float(row[-1]) == max(ratios)]
    told = span([float(cell) for cell in of_bodies.column("of greedy insertion's")], 2)
    return (
        f"Time beside greedy insertion: {told} times for whole bodies; {span(ratios, 2)} times for single recordings, "
        f"the most for `{slow[0]}`, which takes {slow[2]} s. Goals of time missed: {goals.count('**missed**')} of "
        f"{len(goals)}."
    )


def of_sub_frames(page: str) -> list[str]:
    """Of the page of `subframes.py`."""
    return facts(page, (_live_between, _exact_between, _baked_between))


def _motions(page: str) -> list[Table]:
    found = [one for one in tables(page) if "live, mm" in one.head]
    if not found:
        raise LookupError("no motions")
    return found


def _largest(one: Table, column: str, rotation: str = "") -> float:
    place = one.head.index(column)
    return max(float(row[place]) for row in one.rows if rotation in row[1])


def _live_between(page: str) -> str:
    motions = _motions(page)
    told = [
        f"{_largest(one, 'live, mm', 'QUATERNION'):.2g} mm by quaternions and {_largest(one, 'live, mm', 'XYZ'):.2g} "
        f"mm by Euler angles where it is {one.section.partition(':')[0].lower()} ({one.section.partition(': ')[2]})"
        for one in motions
    ]
    return (
        "Measured: what Blender shows at quarter frames, beside what a mode gives there. The largest displacement of "
        f"all modes: {'; '.join(told)}."
    )


def _exact_between(page: str) -> str:
    told = [f"{_largest(one, 'exact, mm'):.2g} mm" for one in _motions(page)]
    return (
        "With *Exact Between Frames*, as bones always are, the largest displacement at any 32nd part of a frame is "
        f"{', '.join(told[:-1])} and {told[-1]}."
    )


def _baked_between(page: str) -> str:
    motions = _motions(page)
    finely, whole = (
        [_largest(one, column) / _largest(one, "live, mm") for one in motions]
        for column in ("baked every 0.25, mm", "baked every frame, mm")
    )
    return (
        f"Baking every quarter of a frame leaves {span(finely, 2)} times that error. Where it hurts: baking on whole "
        f"frames leaves {span(whole, 2)} times, so it does not help."
    )
