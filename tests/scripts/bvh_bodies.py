"""A small body as a file, BVH, for tests of programs that read it."""

from pathlib import Path

import numpy as np

JOINTS = ("Hips", "LeftHand", "Head")


def write_body(path: Path, *, seconds: float = 2.0, moves: bool = True) -> None:
    """A root with two joints, as BVH of 30 samples a second."""
    lines = ["HIERARCHY", "ROOT Hips", "{", "OFFSET 0 0.9 0"]
    lines.append("CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation")
    for name, offset in zip(JOINTS[1:], ("0.4 0.4 0", "0 0.7 0"), strict=True):
        lines += [f"JOINT {name}", "{", f"OFFSET {offset}", "CHANNELS 3 Zrotation Xrotation Yrotation"]
        lines += ["End Site", "{", "OFFSET 0 0.1 0", "}", "}"]
    times = np.arange(round(30 * seconds) + 1) / 30.0
    lines += ["}", "MOTION", f"Frames: {len(times)}", f"Frame Time: {1 / 30:.8f}"]
    waves = moves * np.sin(
        np.outer(times, (3.0, 2.0, 4.0, 2.0, 5.0, 3.0, 4.0, 2.0, 6.0, 3.0, 2.0, 1.0)) + np.arange(12.0)
    )
    amplitudes = np.array((0.3, 0.1, 0.4, *(30.0,) * 9))
    lines += [" ".join(f"{value:.6f}" for value in row) for row in waves * amplitudes]
    path.write_text("\n".join([*lines, ""]), encoding="utf-8")
