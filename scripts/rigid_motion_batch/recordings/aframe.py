"""Recordings of A-Frame's motion-capture components: JSON with the poses of a headset and its controllers.

`avatar-recorder` writes a device's recording under its name (`camera` and the ids of the controllers),
`motion-capture-recorder` writes one device's recording alone, and the very first versions its list of poses. A pose
has a timestamp in milliseconds, a position {x, y, z} and a rotation {x, y, z} in degrees, which A-Frame applies in
the order Y X Z; recordings of January 2017 have lists instead, the rotation being a quaternion x, y, z, w. Axes are
right-handed, y up, -z forward. Source: https://github.com/dmarcos/aframe-motion-capture-components.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rigid_motion.motion import Poses

from .euler import quaternions_from_intrinsic_eulers
from .recordings import Selection, Trajectory, TrajectoryError, shown
from .tables import read_text

LARGEST_FILE = 1 << 28
"""Bytes: two hours of a headset and two controllers at 90 Hz. All of a file is in memory, at ten times its size."""


def read(path: Path, selection: Selection) -> list[Trajectory]:
    """Read the devices that were on. A recording of one device has the file's name."""
    text = read_text(path, LARGEST_FILE)
    try:
        content = json.loads(text)
    except json.JSONDecodeError as error:
        problem = f"this is not JSON ({error.msg})"
        raise TrajectoryError(path, problem, "save the recording again", error.lineno) from None
    except (RecursionError, ValueError):
        raise TrajectoryError(path, "this JSON cannot be a recording", "save the recording again") from None
    devices = _devices(path, content)
    return [_trajectory(path, name, devices[name]) for name in selection.of(list(devices))]


def _devices(path: Path, content: Any) -> dict[str, list]:
    """Return the poses of each device that has any."""
    if isinstance(content, list):
        content = {"poses": content}
    if isinstance(content, dict):
        if isinstance(content.get("poses"), list):
            return {path.stem: content["poses"]}
        recordings = {name: device.get("poses") for name, device in content.items() if isinstance(device, dict)}
        devices = {name: poses for name, poses in recordings.items() if isinstance(poses, list)}
        if devices:
            return {name: poses for name, poses in devices.items() if poses}
    raise TrajectoryError(
        path, "this JSON holds no poses", "name a recording of A-Frame's avatar-recorder or motion-capture-recorder"
    )


def _trajectory(path: Path, name: str, samples: list) -> Trajectory:
    # A list of numbers is a quaternion, an object holds angles: see the module's docstring.
    lists = bool(samples) and isinstance(samples[0], dict) and isinstance(samples[0].get("rotation"), list)
    axes: Sequence[Any] = range(3) if lists else "xyz"
    times = _numbers(path, name, samples, [("timestamp",)])[:, 0] * 1e-3
    positions = _numbers(path, name, samples, [("position", axis) for axis in axes])
    if lists:
        quaternions = _numbers(path, name, samples, [("rotation", index) for index in (3, 0, 1, 2)])
    else:
        degrees = _numbers(path, name, samples, [("rotation", axis) for axis in "yxz"])
        quaternions = quaternions_from_intrinsic_eulers(np.radians(degrees), "YXZ")
    return Trajectory(name, times, Poses(positions, quaternions))


def _numbers(path: Path, device: str, samples: list, fields: list[tuple]) -> np.ndarray:
    """Return the numbers in these fields of all samples, shape (samples, fields). null is JavaScript's NaN."""
    numbers = np.empty((len(samples), len(fields)))
    for index, sample in enumerate(samples):
        for column, (key, *rest) in enumerate(fields):
            try:
                value = sample[key][rest[0]] if rest else sample[key]
                numbers[index, column] = np.nan if value is None else value
            except (KeyError, IndexError, TypeError, ValueError, OverflowError):
                problem = f"pose {index} of {shown(device)} has no number {'.'.join(map(str, (key, *rest)))}"
                raise TrajectoryError(path, problem, "delete that pose") from None
    return numbers
