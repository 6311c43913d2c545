"""Helpers for tests of compare.py: quick recordings, and comparison of output folders."""

import csv
from pathlib import Path
from subprocess import CompletedProcess

import numpy as np
from scipy.spatial.transform import Rotation

from rigid_motion.motion import Poses
from rigid_motion_batch.cli import compare
from rigid_motion_batch.pipeline.steps import OWN_FOLDER
from tests.balls import largest_displacements
from tests.scripts.processes import ROOT, run_python

COLUMNS = (
    "clip,mode,rate_hz,keys,samples,duration_s,bytes_per_s,rms_shell_m,p95_shell_m,max_shell_m,"
    "rms_position_m,rms_rotation_deg,rms_velocity_m_s,decimation,tolerance_m,keys_per_s,"
    "joints,key_frames,worst_joint,foot_slide_m,recorded_slide_m,"
    "still_point_m"
)
SMALL = ["--resolution", "160x90", "--fps", "6"]


def run(*arguments: object) -> int:
    """Run the program in this process, which is faster for little work."""
    return compare.main(["--jobs", "0", *map(str, arguments)])


WITHOUT_BLENDER = """
import importlib, sys
sys.modules["bpy"] = sys.modules["mathutils"] = None
sys.exit(importlib.import_module("rigid_motion_batch.cli." + sys.argv[1]).main(sys.argv[2:]))
"""


def run_without_blender(command: str, *arguments: object) -> CompletedProcess[str]:
    """Run any program of ours in a Python that has no Blender."""
    return run_python("-c", WITHOUT_BLENDER, command, *arguments)


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


def table(path: Path) -> dict[str, np.ndarray]:
    rows = rows_of(path)
    return {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}


def poses_of(columns: dict[str, np.ndarray]) -> Poses:
    return Poses(
        np.stack([columns[name] for name in ("x", "y", "z")], axis=-1),
        np.stack([columns[name] for name in ("qw", "qx", "qy", "qz")], axis=-1),
    )


def shell_errors(shown: Poses, truth: Poses, radius: float) -> np.ndarray:
    """Return how far the farthest points of balls at poses (n,) are from their true places, shape (n,), by SciPy."""
    turns = [Rotation.from_quat(poses.quaternions, scalar_first=True).as_matrix() for poses in (shown, truth)]
    return largest_displacements(shown.positions - truth.positions, radius * (turns[0] - turns[1]))


def write_toss(path: Path, samples: int = 60) -> Path:
    """Write a piece of a generated motion, 90 samples per second."""
    lines = (ROOT / "assets" / "throw.csv").read_text().splitlines()
    path.parent.mkdir(exist_ok=True)
    path.write_text("\n".join(lines[:1] + lines[90 : 91 + samples]))
    return path


def outputs(folder: Path) -> dict[str, bytes]:
    """Return all files by path, with contents if those never vary: reports have dates, .blend files addresses."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.suffix in (".csv", ".mp4") else b""
        for path in folder.rglob("*")
        if path.is_file() and OWN_FOLDER not in path.relative_to(folder).parts
    }
