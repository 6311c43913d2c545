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
    return facts(page, (_beside_decimate, _bodies_beside_others, _where_reduction_hurts))


def _beside_decimate(page: str) -> str:
    told = [(one, one.rows[-1]) for one in tables(page) if "frames with keys" in one.head and "recording" in one.head]
    if not told:
        raise LookupError("no recordings")

    def both(place: int) -> str:
        return " and ".join(row[place] for _, row in told)

    turned = " and ".join(one.section.removeprefix("Turned by ") for one, _ in told)
    return (
        f"Measured: *Reduce Keys to Poses* beside Blender's Decimate on {len(told[0][0].rows) - 1} recordings. To be "
        f"as good, Decimate needs keys on {both(2)} times as many frames (with {turned}), and {both(4)} times the "
        f"numbers; in each channel it has {both(3)} times the keys. With keys on as few frames it is off by {both(6)} "
        "times as much."
    )


def _bodies_beside_others(page: str) -> str:
    (_, decimate) = tables_of(page, "Keys beside Blender's Decimate")
    (greedy,) = tables_of(page, "Key poses beside greedy insertion")
    (ozz,) = tables_of(page, "Beside ozz-animation")
    known = [keys == best for keys, best in zip(greedy.column(OURS), greedy.column("optimum"), strict=True) if best]
    own, poses = decimate.row("each joint its own"), decimate.row("key poses")
    ratios = [float(row[3]) for row in ozz.rows if row[4]]
    return (
        f"Of whole bodies Decimate needs {own[2]} times the numbers of keys of each joint's own, and {poses[2]} times "
        f"those of key poses, which are as few as can be in {sum(known)} of the {len(known)} cases where that is "
        f"known; ozz-animation needs {span([1.0 / ratio for ratio in ratios[::-1]], 2)} times the keys."
    )


def _where_reduction_hurts(page: str) -> str:
    (feet,) = tables_of(page, "Feet that stand")
    slides: dict[str, list[float]] = {}
    for row in feet.rows:
        if row[5] or row[1] == "recording":
            slides.setdefault(row[1], []).append(numbers(row[3])[0])
    own, heavy, recorded = (
        f"{max(slides[how]):.1f} mm" for how in ("each joint its own", "each joint its own, feet weigh 4", "recording")
    )
    goals = [cell for one in tables(page) for row in one.rows for cell in row if cell in ("met", "**missed**")]
    return (
        f"Where it hurts: feet that stand slide by up to {own}, by {heavy} where they weigh more, and by {recorded} in "
        f"the recordings; and {goals.count('**missed**')} of {len(goals)} goals were missed, each marked below."
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
