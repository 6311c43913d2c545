"""A small body as a BVH file, for tests of programs that read it."""

from pathlib import Path

import numpy as np

PLACES = {"Hips": (0.0, 0.9, 0.0), "LeftHand": (0.6, 0.4, 0.0), "Head": (0.0, 1.2, 0.1)}

JOINTS = tuple(PLACES)

TIMES = np.arange(61) / 30.0


def angles_at(times: np.ndarray) -> dict[str, np.ndarray]:
    """Return the Euler angles ZXY of each joint, in degrees, shape (n, 3)."""
    return {
        name: 30.0 * np.sin(np.outer(times, (3.0, 2.0 + joint, 4.0)) + np.arange(3.0) + joint)
        for joint, name in enumerate(PLACES)
    }


def hips_at(times: np.ndarray) -> np.ndarray:
    return np.sin(np.outer(times, (3.0, 2.0, 4.0))) * (0.3, 0.1, 0.4)


def bvh_text(
    times: np.ndarray = TIMES, order: tuple[str, ...] = JOINTS[1:], *, unit: float = 1.0, moves: bool = True
) -> str:
    """Return a root with two joints in this order, with the motion at these times. `unit` is the units per metre."""

    def offset(name: str) -> str:
        return "OFFSET " + " ".join(f"{unit * value:.9f}" for value in PLACES[name])

    turns = "Zrotation Xrotation Yrotation"
    lines = ["HIERARCHY", "ROOT Hips", "{", offset("Hips"), f"CHANNELS 6 Xposition Yposition Zposition {turns}"]
    for name in order:
        end = ["End Site", "{", f"OFFSET 0 {0.1 * unit} 0", "}"]
        lines += [f"JOINT {name}", "{", offset(name), f"CHANNELS 3 {turns}", *end, "}"]
    lines += ["}", "MOTION", f"Frames: {len(times)}", f"Frame Time: {times[1] - times[0]:.12f}"]
    angles = angles_at(times)
    rows = moves * np.concatenate([unit * hips_at(times), *(angles[name] for name in ("Hips", *order))], axis=1)
    return "\n".join([*lines, *(" ".join(f"{value:.12f}" for value in row) for row in rows), ""])


def write_body(path: Path, times: np.ndarray = TIMES, *arguments: object, **settings: object) -> Path:
    path.write_text(bvh_text(times, *arguments, **settings))
    return path
