"""Of `benchmark.py` and `benchmark_batch.py`: poses a second, and clips a minute."""

from __future__ import annotations

from research.markdown_tables import Table, numbers, tables, tables_of

from .on_top import facts, percent_more, span

OURS = "Rigid Motion"
"""Who is meant by that in tables."""


def of_speed(page: str) -> list[str]:
    """Of the page of `benchmark.py`."""
    return facts(page, (_rates, _beside_libraries, _slower, _blend_beside_lerp, _reduction_beside_greedy))


def _races(page: str) -> dict[str, dict[tuple[str, str], float]]:
    """By section: million poses a second by mode and who computed them."""
    found = {
        one.section: {(row[0].strip("`"), row[1]): float(row[2]) for row in one.rows}
        for one in tables(page)
        if "million poses/s" in one.head
    }
    if not found:
        raise LookupError("no races")
    return found


def _rates(page: str) -> str:
    races = _races(page)
    told = [
        f"{span([rate for (_, who), rate in race.items() if who == OURS])} ({section[0].lower()}{section[1:]})"
        for section, race in races.items()
    ]
    return f"Measured: in-betweens of every mode in one process. Million poses a second, by mode: {'; '.join(told)}."


def _faster_by(page: str, who: str, mode: str = "") -> dict[str, float]:
    """By section, the least that this program is faster by than somebody else, in this mode or in any."""
    found = {}
    for one in tables(page):
        if "million poses/s" in one.head:
            ratios = [numbers(row[3])[0] for row in one.rows if row[1] == who and mode in row[0]]
            if ratios:
                found[one.section] = min(ratios)
    return found


def _beside_libraries(page: str) -> str:
    told = []
    for who in ("pytransform3d", "SciPy"):
        ratios = _faster_by(page, who, "dq_sclerp")
        if ratios:
            told.append(f"{span(list(ratios.values()))} times as fast as {who}")
    if not told:
        raise LookupError("no libraries")
    return f"A screw (`dq_sclerp`) is {' and '.join(told)}."


def _slower(page: str) -> str:
    behind = _faster_by(page, "NumPy, closed form")
    if not behind:
        raise LookupError("no closed forms")
    worst = min(behind, key=behind.__getitem__)
    beside = f"{behind[worst]:.1f} times as fast as plain NumPy where it gains least"
    spline = [race["lerp_slerp", OURS] / race["motor_spline", OURS] for race in _races(page).values()]
    return (
        f"Where it hurts: {OURS} is {beside} ({worst[0].lower()}{worst[1:]}), and `motor_spline` takes {span(spline)} "
        "times as long as `lerp_slerp`."
    )


def _blend_beside_lerp(page: str) -> str:
    ratios = [race["lerp_slerp", OURS] / race["pga_lerp", OURS] for race in _races(page).values()]
    low, high = percent_more(min(ratios)), percent_more(max(ratios))
    time = low if low == high else f"between {low} and {high}"
    quicker = sum(ratio < 1.0 for ratio in ratios)
    return (
        f"Multivectors by LERP (`pga_lerp`) take {time} time than `lerp_slerp`: less in {quicker} of {len(ratios)} "
        f"case{'s' * (len(ratios) > 1)}."
    )


def _reduction_beside_greedy(page: str) -> str:
    (found,) = tables_of(page, "Key reduction")
    samples, ours, _, keys, theirs, their_keys = (float(cell) for cell in found.rows[-1])
    return (
        f"Key reduction of {samples:.0f} samples takes {ours:.0f} s, {ours / theirs:.0f} times as long as greedy "
        f"insertion, and leaves {percent_more(keys / their_keys, 'fewer')} keys."
    )


def of_batch(page: str) -> list[str]:
    """Of the page of `benchmark_batch.py`."""
    return facts(page, (_clips_a_minute, _second_worker, _memory_of_program, _memory_of_worker))


def _by_workers(page: str) -> list[Table]:
    found = [one for one in tables(page) if "clips a minute" in one.head]
    if not found:
        raise LookupError("no workers")
    return found


def _clips_a_minute(page: str) -> str:
    told = [f"{one.row('2')[2]} clips a minute ({one.section})" for one in _by_workers(page)]
    return f"Measured: `compare.py` on many clips, with one worker and with two. Two do {' and '.join(told)}."


def _second_worker(page: str) -> str:
    told = [f"{one.row('2')[3].split()[0]} times as fast as one ({one.section})" for one in _by_workers(page)]
    text = f"Two workers are {' and '.join(told)}."
    *_, films = _by_workers(page)
    outside = films.row("2")[films.head.index("outside the renderer")]
    if outside:
        text += f" Where it hurts: with video all but {outside} of the work is Blender's rendering."
    return text


def _memory_of_program(page: str) -> str:
    found = next((one for one in tables(page) if one.head[:1] == ("clips",)), None)
    if found is None:
        raise LookupError("no memory")
    (few, least, _), (many, most, more) = found.rows[0], found.rows[-1]
    return f"The program itself takes {least} MB with {few} clips and {most} MB with {many}: {more}."


def _memory_of_worker(page: str) -> str:
    found = next((one for one in tables(page) if one.head[:1] == ("one clip of",)), None)
    if found is None:
        raise LookupError("no memory")
    length, samples, most, of_sample, seconds = found.rows[-1]
    return f"A clip of {length} ({samples} samples) takes {most} MB and {seconds} s: a sample {of_sample}."
