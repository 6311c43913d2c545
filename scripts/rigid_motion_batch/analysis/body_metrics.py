"""What a comparison found of a clip, in numbers: over all joints, and of a whole body joint by joint.

Errors are in metres, in the root's space. `metrics.csv` has the whole, `metrics_joints.csv` the joints. What is as long
as the recording is kept for one mode of those that are one motion.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rigid_motion.motion import Errors
from rigid_motion_batch.files import replacing
from rigid_motion_batch.rows import line_of

from .choices import Keys
from .errors import Ground, MotionErrors, errors_of
from .metrics import BYTES_PER_KEY, BYTES_PER_MODE, Metrics, lines_of_poses, of_errors
from .modes import BEST_OF
from .reconstructions import Groups, Reconstruction, identical_modes


@dataclass(frozen=True)
class JointMetrics:
    """One joint of a clip with one choice of keys under one mode: the columns of `metrics_joints.csv`."""

    clip: str
    joint: str
    mode: str

    rate_hz: str
    """As the user wrote it; empty where a tolerance decides."""

    keys: int | None
    """1 of a joint that stays as it is in its parent's space."""

    samples: int
    rms_shell_m: float
    p95_shell_m: float
    max_shell_m: float

    worst_s: float
    """When that is, in seconds from the first key on."""

    rms_position_m: float
    rms_rotation_deg: float
    rms_velocity_m_s: float
    decimation: str
    tolerance_m: float | None


@dataclass(frozen=True, eq=False)
class Measured:
    """A clip under one choice of keys, measured."""

    made: Reconstruction

    rows: tuple[Metrics, ...]
    """One for each mode."""

    joints: tuple[JointMetrics, ...]
    """One for each mode and joint of a whole body."""

    groups: Groups
    """The modes, those together that are one motion."""

    errors: Mapping[str, MotionErrors]
    """Of the first of each group."""


def measure_modes(made: Reconstruction) -> Measured:
    """Return the metrics of all modes; of those that are one motion the errors of the first are kept.

    Notes
    -----
    `bytes_per_s` is (keys - 1) / duration times 56 bytes, or 57 under `best_of`, whose keys say the mode. A recording
    that is thinned to 10 keys a second keeps fewer where it has gaps or is slow itself, and it is what would be sent
    that counts. The first key is not counted, since a stretch of the motion costs the key at its end: keys exactly a
    tenth of a second apart are 560 bytes a second for any length of the clip.
    """
    ground, groups = Ground.of(made), identical_modes(made)
    rows: list[Metrics] = []
    joints: list[JointMetrics] = []
    kept: dict[str, MotionErrors] = {}
    for mode in made.keys:
        errors = errors_of(made, mode, ground)
        rows.append(_row_of(made, mode, errors, ground))
        joints += _rows_of_joints(made, mode, errors) if made.clip.rest_body else ()
        if mode in (group[0] for group in groups):
            kept[mode] = errors
    return Measured(made, tuple(rows), tuple(joints), groups, kept)


def _row_of(made: Reconstruction, mode: str, errors: MotionErrors, ground: Ground) -> Metrics:
    clip, keys = made.clip, made.keys[mode]
    duration = float(made.times[-1] - made.times[0])
    # A joint that stays as it is has its key once, and sends nothing.
    count = sum(map(len, keys))
    sent = count - len(keys)
    moving_joints = sum(len(own) > 1 for own in keys)
    whole = bool(clip.rest_body)
    return Metrics(
        mode=mode,
        keys=count or None,
        duration_s=duration,
        bytes_per_s=sent / duration * (BYTES_PER_KEY + BYTES_PER_MODE * (mode == BEST_OF)) if count else None,
        keys_per_s=sent / max(moving_joints, 1) / duration if count else None,
        joints=len(keys) if whole else None,
        key_frames=len(key_samples(keys)) or None if whole else None,
        worst_joint=clip.whole_body.joints[errors.worst[0]] if whole else None,
        foot_slide_m=errors.slide if len(ground.joints) else None,
        recorded_slide_m=ground.slide if len(ground.joints) else None,
        **of_errors(clip, made.choice, errors),
    )


def _rows_of_joints(made: Reconstruction, mode: str, errors: MotionErrors) -> Iterator[JointMetrics]:
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
    """Return the samples that are a key of any joint that moves."""
    moving_ones = [own for own in keys if len(own) > 1]
    return np.unique(np.concatenate(moving_ones)) if moving_ones else keys[0]


def join_tables(path: Path, parts: Iterable[Path]) -> None:
    """Write the rows of tables that have the same header, at least one, under a single one."""
    with replacing(path) as stream:
        for number, part in enumerate(parts):
            with part.open(encoding="utf-8", newline="") as source:
                header = source.readline()
                if number == 0:
                    stream.write(header)
                shutil.copyfileobj(source, stream)


def write_key_tables(folder: Path, made: Reconstruction) -> None:
    """Write the keys: of evenly spaced ones those of all modes, of others a `MODE.keys.csv` for each.

    A row is a joint's pose in its parent's space, in the unit of the recording: `joint,t,x,y,z,qw,qx,qy,qz`.
    """
    uniform = made.choice.decimation == "uniform"
    known = [(mode, keys) for mode, keys in made.keys.items() if len(keys[0])]
    for mode, keys in known[: 1 if uniform else None]:
        with replacing(folder / ("keys.csv" if uniform else f"{mode}.keys.csv")) as stream:
            stream.write("joint,t,x,y,z,qw,qx,qy,qz\n")
            for joint, own in enumerate(keys):
                name = line_of([made.clip.whole_body.joints[joint]])[:-1]
                poses = made.clip.poses[joint][own]
                for _, lines in lines_of_poses([made.clip.times[own], *poses.positions.T, *poses.quaternions.T]):
                    stream.writelines(f"{name},{line}\n" for line in lines)
