"""Metrics of a comparison: the rows of `metrics.csv` and `metrics_joints.csv`, and the tables of poses.

Errors are in metres; errors of whole bodies are in the root's space. Poses in tables keep the unit of the recording.
Numbers are written so that `float` reads back exactly the computed value.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.motion import Errors, Poses
from rigid_motion.motion.measures import rms
from rigid_motion_batch.files import line_of, replacing
from rigid_motion_batch.recordings.clips import Clip

from .choices import Choice, Keys
from .reconstructions import Ground, MotionErrors, Reconstruction

BYTES_PER_KEY = 7 * 8
"""A position and a quaternion as doubles: the size of one update in the paper."""

MAX_ROUNDING_M = 1e-9
"""Errors below this, in metres, are rounding: every sample was a key, or nothing moved."""

BLOCK_ROWS = 10_000
"""Rows of a table that are written at a time."""


@dataclass(frozen=True)
class Metrics:
    """One clip with one choice of keys under one mode. The fields are the columns of `metrics.csv`, in order."""

    clip: str
    mode: str

    rate_hz: str
    """As the user wrote it; empty if the choice is a tolerance."""

    keys: int | None
    """None for a motion from --against, as for all values that are counted by keys."""

    samples: int
    """The number of compared samples: from the first key to the last, both included."""

    duration_s: float
    """Time from the first key to the last."""

    bytes_per_s: float | None
    """Counts the keys that were kept, not the requested rate: see `row_of`."""

    rms_shell_m: float
    p95_shell_m: float
    max_shell_m: float
    rms_position_m: float
    rms_rotation_deg: float
    rms_velocity_m_s: float

    decimation: str
    """How the keys were chosen: "uniform" or "adaptive"."""

    tolerance_m: float | None
    """The largest allowed shell error; empty in the table if the choice is a rate."""

    keys_per_s: float | None
    """On average, not counting the first key; for a whole body, per joint."""

    joints: int | None = None
    """The number of joints of a whole body; this and the following fields are empty for a single rigid body."""

    key_frames: int | None = None
    """The number of samples that are a key of any joint: the key poses, if joints share them."""

    worst_joint: str | None = None
    """The joint that `max_shell_m` belongs to."""

    foot_slide_m: float | None = None
    """The farthest that a joint gets from where it began to stand, while it stands on the ground in the recording."""

    recorded_slide_m: float | None = None
    """The same in the recording itself."""

    still_point_m: float | None = None
    """The farthest that a point which stays put in the recording, such as a pivot, gets from its place.

    Empty for whole bodies, and if no point stays put.
    """


@dataclass(frozen=True)
class JointMetrics:
    """One joint of a clip with one choice of keys under one mode: the columns of `metrics_joints.csv`, in order."""

    clip: str
    joint: str
    mode: str

    rate_hz: str
    """As the user wrote it; empty if the choice is a tolerance."""

    keys: int | None
    """1 for a joint that never changes in its parent's space."""

    samples: int
    rms_shell_m: float
    p95_shell_m: float
    max_shell_m: float

    worst_s: float
    """The time of the largest shell error, in seconds from the first key."""

    rms_position_m: float
    rms_rotation_deg: float
    rms_velocity_m_s: float
    decimation: str
    tolerance_m: float | None


def of_errors(clip: Clip, choice: Choice, errors: Errors | MotionErrors) -> dict[str, Any]:
    """Return the fields that rows of clips and of joints share, from errors in metres and radians."""
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


def row_of(made: Reconstruction, mode: str, errors: MotionErrors, ground: Ground) -> Metrics:
    """Return the row of a mode.

    Notes
    -----
    `bytes_per_s` is (keys - 1) / duration times 56 bytes. A recording that is thinned to 10 keys per second keeps fewer
    keys where it has gaps or a lower rate itself; only keys that would be sent count. The first key is not counted,
    since each segment of the motion costs the key at its end: keys exactly a tenth of a second apart are 560 bytes per
    second for any length of the clip.
    """
    clip, keys = made.clip, made.keys[mode]
    duration = float(made.times[-1] - made.times[0])
    # A joint that never changes has one key, and sends nothing.
    count = sum(map(len, keys))
    sent = count - len(keys)
    moving_joints = sum(len(own) > 1 for own in keys)
    whole = bool(clip.rest_body)
    return Metrics(
        mode=mode,
        keys=count or None,
        duration_s=duration,
        bytes_per_s=sent / duration * BYTES_PER_KEY if count else None,
        keys_per_s=sent / max(moving_joints, 1) / duration if count else None,
        joints=len(keys) if whole else None,
        key_frames=len(key_samples(keys)) or None if whole else None,
        worst_joint=clip.whole_body.joints[errors.worst[0]] if whole else None,
        foot_slide_m=errors.slide if len(ground.joints) else None,
        recorded_slide_m=ground.slide if len(ground.joints) else None,
        still_point_m=errors.still_point if ground.still_point is not None else None,
        **of_errors(clip, made.choice, errors),
    )


def rows_of_joints(made: Reconstruction, mode: str, errors: MotionErrors) -> Iterator[JointMetrics]:
    """Yield the rows of a mode, one for each joint of a whole body."""
    clip, times = made.clip, made.times
    of_joints = map(Errors, errors.shell, errors.position, errors.rotation, errors.velocity)
    for name, keys, own in zip(clip.whole_body.joints, made.keys[mode], of_joints, strict=True):
        yield JointMetrics(
            joint=name,
            mode=mode,
            keys=len(keys) or None,
            worst_s=float(times[np.argmax(own.shell)] - times[0]),
            **of_errors(clip, made.choice, own),
        )


def key_samples(keys: Keys) -> np.ndarray:
    """Return the samples that are a key of any moving joint."""
    moving_ones = [own for own in keys if len(own) > 1]
    return np.unique(np.concatenate(moving_ones)) if moving_ones else keys[0]


def geometric_mean(values: np.ndarray) -> np.ndarray:
    """Return the geometric mean over the first axis, ignoring NaN; NaN if no value is left."""
    known = np.isfinite(values) & (values > 0.0)
    count = known.sum(axis=0)
    total = np.log(np.where(known, values, 1.0)).sum(axis=0)
    return np.exp(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


def write_poses(path: Path, times: np.ndarray, poses: Poses) -> None:
    """Write a table of poses (n,) at times (n,): `t,x,y,z,qw,qx,qy,qz`, and `s` if the poses have scales."""
    columns = [times, *poses.positions.T, *poses.quaternions.T]
    header = "t,x,y,z,qw,qx,qy,qz"
    if poses.scales is not None:
        columns.append(poses.scales)
        header += ",s"
    with replacing(path) as stream:
        stream.write(f"{header}\n")
        for lines in lines_of_poses(columns):
            stream.writelines(f"{line}\n" for line in lines)


def lines_of_poses(columns: Sequence[np.ndarray]) -> Iterator[list[str]]:
    """Yield the lines of a table of numbers in blocks, given columns of shape (n,).

    As text, numbers take many times their memory, and a recording may be hours long.
    """
    for first in range(0, len(columns[0]), BLOCK_ROWS):
        rows = np.stack([column[first : first + BLOCK_ROWS] for column in columns], axis=-1).tolist()
        yield [",".join(map(repr, row)) for row in rows]


def table_names(choice: Choice, modes: Iterable[str], other: str = "", *, body: bool = False) -> list[str]:
    """Return the names of the files that `write_tables` writes for a choice; `other` is a motion with unknown keys.

    For a whole body, these are its keys only: one file for all modes if the modes share keys.
    """
    modes = tuple(modes)
    keys = ["keys.csv"] if choice.decimation == "uniform" else [f"{mode}.keys.csv" for mode in modes]
    return keys if body else [*(f"{mode}.csv" for mode in (*modes, other) if mode), *keys]


def write_tables(folder: Path, made: Reconstruction) -> None:
    """Write the keys into `folder`, and for a rigid body a `MODE.csv` for every mode.

    Evenly spaced keys are the same for all modes: they are in `keys.csv`. Other keys are in a `MODE.keys.csv` for each
    mode. A row of a whole body is a joint's pose in its parent's space, in the unit of the recording:
    `joint,t,x,y,z,qw,qx,qy,qz`.
    """
    clip, times, body = made.clip, made.times, made.clip.rest_body is not None
    for mode in () if body else made.keys:
        write_poses(folder / f"{mode}.csv", times, made.filled_in(mode, times))
    tables = {f"{mode}.keys.csv": made.keys[mode] for mode in made.keys if len(made.keys[mode][0])}
    if made.choice.decimation == "uniform":
        tables = {"keys.csv": next(iter(tables.values()))}
    for name, keys in tables.items():
        if body:
            _write_key_poses(folder / name, clip, keys)
        else:
            write_poses(folder / name, clip.times[keys[0]], clip.poses[keys[0]])


def _write_key_poses(path: Path, clip: Clip, keys: Keys) -> None:
    with replacing(path) as stream:
        stream.write("joint,t,x,y,z,qw,qx,qy,qz\n")
        for joint, own in enumerate(keys):
            name = line_of([clip.whole_body.joints[joint]])[:-1]
            poses = clip.poses[joint][own]
            for lines in lines_of_poses([clip.times[own], *poses.positions.T, *poses.quaternions.T]):
                stream.writelines(f"{name},{line}\n" for line in lines)


def join_tables(path: Path, parts: Iterable[Path]) -> None:
    """Concatenate tables with the same header, at least one, under a single header."""
    with replacing(path) as stream:
        for number, part in enumerate(parts):
            with part.open(encoding="utf-8", newline="") as source:
                header = source.readline()
                if number == 0:
                    stream.write(header)
                shutil.copyfileobj(source, stream)
