"""The study of streams that are sent when needed, as tasks."""

from __future__ import annotations

from research.study import Files
from rigid_motion_batch.rows import read_all_rows, write_rows

from . import sending, table
from .motions import ASSETS, RECORDINGS, Motion, read_motion


def measure_sending(job: Files, *, name: str, source: str, of: str) -> None:
    """Send a clip in every way. One that cannot be read, or is at rest, is noted and does not count."""
    motion, clip = read_motion(source, name, of)
    even, sent = [], []
    if clip is None:
        job.note(f"{name} does not count: {motion.left_out}")
    else:
        total = max(sending.steps_of(clip), 1)
        done = iter(range(1, total + 1))
        even, sent = sending.measure_sending(clip, lambda: job.progress(next(done), total))
    write_rows(job.writes(f"sending/{name}/clip.csv"), Motion, [motion])
    write_rows(job.writes(f"sending/{name}/even.csv"), table.Point, even)
    write_rows(job.writes(f"sending/{name}/sent.csv"), sending.Sent, sent)


def gather_sending(job: Files, *, names: list[str]) -> None:
    """Bring the clips together, and find what each needs."""

    def gathered(part: str, kind: type) -> list:
        return read_all_rows((job.reads(f"sending/{name}/{part}") for name in names), kind)

    motions, even = gathered("clip.csv", Motion), gathered("even.csv", table.Point)
    sent = gathered("sent.csv", sending.Sent)
    cells = sending.sending_needed(even, sent)
    means = [
        mean
        for of in (RECORDINGS, ASSETS)
        for mean in sending.mean_sending(cells, of, [one.clip for one in motions if one.of == of and not one.left_out])
    ]
    write_rows(job.writes("sent.csv"), sending.Sent, sent)
    write_rows(job.writes("sending.csv"), sending.SentNeeded, [*means, *cells])
