"""The study of whole bodies, as tasks."""

from __future__ import annotations

from research.study import Files
from rigid_motion_batch.analysis.needed import RATES
from rigid_motion_batch.rows import write_rows

from .bodies import FILES, KeysOfBody, apart_of, errors_of, limbs_of, needed_of, read_body


def measure_body(job: Files, *, name: str, source: str) -> None:
    """Read a body, find its limbs, and measure what is quickly measured. One that cannot be read is noted."""
    body, clip = read_body(source, name)
    limbs, errors, apart = [], [], []
    if clip is not None:
        limbs = limbs_of(clip)
        errors = errors_of(clip, [limb for limb in limbs if not limb.left_out])
        apart = apart_of(clip)
    for part, rows in (("", [body]), ("_limbs", limbs), ("_errors", errors), ("_apart", apart)):
        table_of = f"bodies{part}.csv"
        write_rows(job.writes(f"bodies/{name}/{table_of}"), FILES[table_of], rows)


def count_key_poses(job: Files, *, name: str, source: str) -> None:
    """Find the key poses that every mode needs on a body, and the keys on its limbs alone."""
    _, clip = read_body(source, name)
    rows = []
    if clip is not None:
        limbs = [limb for limb in limbs_of(clip) if not limb.left_out]
        total = len(RATES) * (1 + len(limbs))
        done = iter(range(1, total + 1))
        rows = needed_of(clip, limbs, lambda: job.progress(next(done), total))
    write_rows(job.writes(f"bodies/{name}/bodies_needed.csv"), KeysOfBody, rows)
