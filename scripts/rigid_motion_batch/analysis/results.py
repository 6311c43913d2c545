"""Temporary: the contract between analysis and report, until the lead's own is merged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion_batch.comparison.study.body_decimated import KeysOfBody
from rigid_motion_batch.comparison.study.choices import Choice
from rigid_motion_batch.comparison.study.metrics import Metrics
from rigid_motion_batch.comparison.study.needed import KeysNeeded
from rigid_motion_batch.comparison.study.results import ClipFacts, SegmentModes


@dataclass(frozen=True, eq=False)
class Motion:
    modes: tuple[str, ...]
    metrics: tuple[Metrics, ...]
    keys: np.ndarray
    poses: Poses
    errors: np.ndarray
    joint_errors: np.ndarray | None = None


@dataclass(frozen=True, eq=False)
class ChoiceResult:
    choice: Choice
    first: int
    motions: tuple[Motion, ...]
    segment_modes: SegmentModes | None = None
    decimated: tuple[KeysOfBody, ...] = ()


@dataclass(frozen=True)
class ClipWarning:
    text: str
    way_out: str
    start_s: float | None = None
    end_s: float | None = None


@dataclass(frozen=True, eq=False)
class ClipResult:
    facts: ClipFacts
    times: np.ndarray
    truth: Poses
    joint_names: tuple[str, ...]
    parents: np.ndarray | None
    choices: tuple[ChoiceResult, ...]
    needed: KeysNeeded | None = None
    warnings: tuple[ClipWarning, ...] = ()
