"""The same work by turns, and what is told of the seconds that it takes."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Sequence

Seconds = dict[str, list[float]]

TABLE = (
    "| what | Rigid Motion: median (fastest) | beside: median (fastest) | ratio | goal |",
    "|---|---:|---:|---:|---:|",
)

MILLISECONDS = (
    "| what | Rigid Motion, ms: median (fastest) | beside, ms: median (fastest) | ratio | goal |",
    "|---|---:|---:|---:|---:|",
)


def in_turns(rounds: int, **contestants: Callable[[], object]) -> Seconds:
    """Seconds of every round of each."""
    seconds: Seconds = {name: [] for name in contestants}
    for _ in range(rounds):
        for name, run in contestants.items():
            start = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - start)
    return seconds


def told(seconds: Sequence[float]) -> str:
    """The median, and the fastest where there are several."""
    fastest = f" ({min(seconds):.3f})" if len(seconds) > 1 else ""
    return f"{statistics.median(seconds):.3f} s{fastest}"


def told_in_ms(seconds: Sequence[float]) -> str:
    """The median and the fastest, in milliseconds."""
    return f"{statistics.median(seconds) * 1e3:.2f} ({min(seconds) * 1e3:.2f})"


def judged(value: float, goal: float, unit: str = "", *, at_least: bool = False) -> str:
    """Whether a figure is within its goal."""
    is_met = value >= goal if at_least else value <= goal
    return f"at {'least' if at_least else 'most'} {goal:g}{unit}: {'met' if is_met else 'missed'}"


def beyond(ours: Sequence[float], theirs: Sequence[float], unit: str = "ms", decimals: int = 2) -> str:
    """How much longer ours takes, or less long."""
    more = (statistics.median(ours) - statistics.median(theirs)) * {"ms": 1e3, "µs": 1e6}[unit]
    return f"{abs(more):.{decimals}f} {unit} {'more' if more >= 0.0 else 'less'}"


def against(ours: Sequence[float], theirs: Sequence[float]) -> str:
    """How many times faster ours is, or slower."""
    ratio = statistics.median(theirs) / statistics.median(ours)
    return f"{ratio:.1f} times faster" if ratio >= 1.0 else f"{1.0 / ratio:.1f} times as long"
