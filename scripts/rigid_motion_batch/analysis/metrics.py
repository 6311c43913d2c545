"""What a comparison found, in numbers: the rows of `metrics.csv`, and the poses behind them as tables.

Errors are in metres; the poses in the tables keep the unit of their recording. The numbers are written so that `float`
reads back exactly what was computed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.motion import Errors, Poses
from rigid_motion.motion.measures import rms
from rigid_motion_batch.files import replacing
from rigid_motion_batch.recordings.clips import Clip

from .choices import Choice
from .errors import MotionErrors
from .modes import BEST_OF, single_modes
from .reconstructions import Reconstruction

BYTES_PER_KEY = 7 * 8
"""A position and a quaternion, as doubles: what the paper sends for an update."""

NOTHING = 1e-9
"""An error below this, in metres, is rounding: every sample was a key, or nothing moved."""

BLOCK = 10_000
"""Rows of a table that are made at a time."""

FORMS = ("csv", "tum")
"""Formats of the tables of poses."""

BYTES_PER_MODE = 1
"""What a key has in addition where every segment has a mode of its own."""


@dataclass(frozen=True)
class Metrics:
    """One clip with one choice of keys under one mode. The fields are the columns of `metrics.csv`, in their order."""

    clip: str
    mode: str

    rate_hz: str
    """As the user wrote it; empty where a tolerance decides."""

    keys: int | None
    """Empty of somebody else's motion, as all that is counted by keys."""

    samples: int
    """How many samples of the recording were compared: those between the first and the last key, both included."""

    duration_s: float
    """From the first key to the last."""

    bytes_per_s: float | None
    """Of the keys that were really kept, not of the rate that was asked for: see `measure_modes`."""

    rms_shell_m: float
    p95_shell_m: float
    max_shell_m: float
    rms_position_m: float
    rms_rotation_deg: float
    rms_velocity_m_s: float

    decimation: str
    """How the keys were chosen: "uniform" or "adaptive"."""

    tolerance_m: float | None
    """The largest shell error that was allowed; empty in the table where a rate decides."""

    keys_per_s: float | None
    """On average, the first key not counted; of a whole body, for each joint."""

    joints: int | None = None
    """How many a whole body has; this and the following are empty for a single rigid body."""

    key_frames: int | None = None
    """Samples that are a key of any joint: key poses, where joints share them."""

    worst_joint: str | None = None
    """The one that `max_shell_m` is of."""

    foot_slide_m: float | None = None
    """The farthest that a joint which stands on the ground in the recording gets from where it began to stand."""

    recorded_slide_m: float | None = None
    """The same in the recording itself."""


def of_errors(clip: Clip, choice: Choice, errors: Errors | MotionErrors) -> dict[str, Any]:
    """Return the fields of a row that any motion has, of errors in metres and radians."""
    return {
        "clip": clip.name,
        "rate_hz": choice.rate,
        "samples": errors.shell.shape[-1],
        "rms_shell_m": rms(errors.shell),
        "p95_shell_m": float(np.percentile(errors.shell, 95.0)),
        "max_shell_m": float(errors.shell.max()),
        "rms_position_m": rms(errors.position),
        "rms_rotation_deg": float(np.degrees(rms(errors.rotation))),
        "rms_velocity_m_s": rms(errors.velocity),
        "decimation": choice.decimation,
        "tolerance_m": choice.tolerance(clip),
    }


def geometric_mean(values: np.ndarray) -> np.ndarray:
    """Return the geometric mean over the first axis of what is not NaN; NaN where nothing is left."""
    known = np.isfinite(values) & (values > 0.0)
    count = known.sum(axis=0)
    total = np.log(np.where(known, values, 1.0)).sum(axis=0)
    return np.exp(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


def write_poses(path: Path, times: np.ndarray, poses: Poses, modes: Sequence[str] = ()) -> None:
    """Write a table of poses: `t,x,y,z,qw,qx,qy,qz`, and `s` where the poses have scales.

    Under a name that ends in `.tum` the table is as evo and others read it, `t x y z qx qy qz qw`, without scales and
    modes.

    Parameters
    ----------
    path : Path
    times : array, shape (n,)
    poses : Poses, shape (n,)
    modes : sequence of str, n - 1 of them, optional
        Of the segments that the poses begin, for a last column, `mode`. The last pose begins none.
    """
    if path.suffix == ".tum":
        _write_tum(path, times, poses)
        return
    columns = [times, *poses.positions.T, *poses.quaternions.T]
    header = "t,x,y,z,qw,qx,qy,qz"
    if poses.scales is not None:
        columns.append(poses.scales)
        header += ",s"
    with replacing(path) as stream:
        stream.write(f"{header},mode\n" if modes else f"{header}\n")
        for first, lines in lines_of_poses(columns):
            if modes:
                lines = [
                    f"{line},{mode}" for line, mode in zip(lines, (*modes, "")[first : first + BLOCK], strict=True)
                ]
            stream.write("\n".join([*lines, ""]))


def _write_tum(path: Path, times: np.ndarray, poses: Poses) -> None:
    columns = [times, *poses.positions.T, *poses.quaternions.T[[1, 2, 3, 0]]]
    with replacing(path) as stream:
        stream.write("# timestamp tx ty tz qx qy qz qw\n")
        for _, lines in lines_of_poses(columns):
            stream.writelines(line.replace(",", " ") + "\n" for line in lines)


def lines_of_poses(columns: Sequence[np.ndarray]) -> Iterator[tuple[int, list[str]]]:
    """Yield the rows of a table of numbers, columns of shape (n,), some at a time with the number of the first.

    Numbers take many times their memory as text, and a recording may have hours of them.
    """
    for first in range(0, len(columns[0]), BLOCK):
        rows = np.stack([column[first : first + BLOCK] for column in columns], axis=-1).tolist()
        yield first, [",".join(map(repr, row)) for row in rows]


def table_names(choice: Choice, modes: Iterable[str], form: str = "csv", other: str = "") -> list[str]:
    """Return the files that `write_reconstruction` writes for a choice; `other` is a motion whose keys are unknown."""
    modes = tuple(modes)
    single = [] if choice.decimation == "uniform" else [f"{mode}.keys.{form}" for mode in single_modes(modes)]
    best = [f"{BEST_OF}.keys.csv"] if BEST_OF in modes else []
    return [*(f"{mode}.{form}" for mode in (*modes, other) if mode), *(single or [f"keys.{form}"]), *best]


def body_table_names(choice: Choice, modes: Iterable[str]) -> list[str]:
    """Return the files of the keys of a whole body: one for all modes where they have the same."""
    return ["keys.csv"] if choice.decimation == "uniform" else [f"{mode}.keys.csv" for mode in modes]


def write_reconstruction(folder: Path, reconstruction: Reconstruction, form: str = "csv") -> None:
    """Write a `MODE.csv`, or another of `FORMS`, for every mode into `folder`, and the keys.

    Keys that were chosen evenly are those of all modes, in `keys.csv`; others are in a `MODE.keys.csv` for each. Those
    of `best_of` are in a table of their own in any case, with the mode of each segment.
    """
    clip, times = reconstruction.clip, reconstruction.times
    for mode in reconstruction.keys:
        write_poses(folder / f"{mode}.{form}", times, reconstruction.filled_in(mode, times))
    known = {mode: keys for mode, (keys,) in reconstruction.keys.items() if len(keys)}
    tables = {f"{mode}.keys.{form}": keys for mode, keys in known.items() if mode != BEST_OF}
    if reconstruction.choice.decimation == "uniform":
        tables = {f"keys.{form}": next(iter(tables.values()))}
    for name, keys in tables.items():
        write_poses(folder / name, clip.times[keys], clip.poses[keys])
    if BEST_OF in reconstruction.keys:
        (keys,), modes = reconstruction.keys[BEST_OF], reconstruction.segment_modes
        write_poses(folder / f"{BEST_OF}.keys.csv", clip.times[keys], clip.poses[keys], modes)
