"""The same study on whole bodies: key poses needed, errors, and what there is of a screw in a joint's own motion.

A body is studied three times. As a rig has it: every joint is interpolated in its parent's space. As trackers have it:
hands, feet and head alone, each a single rigid body in the space of the roots, which is that of the recording. And both
beside each other at the same keys. Errors are in metres, measured in the space of the roots.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rigid_motion.motion import Poses, decimate, interpolate, measure, rms
from rigid_motion.motion.quaternions import angle_between
from rigid_motion_batch.analysis.bodies import BodyReconstruction, moving, reconstruct_body
from rigid_motion_batch.analysis.body_metrics import measure_modes
from rigid_motion_batch.analysis.body_needed import OfBody
from rigid_motion_batch.analysis.choices import Uniform
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.analysis.modes import REFERENCE
from rigid_motion_batch.analysis.needed import DECIMATIONS, RATES, KeysNeeded, OfRigidBody, keys_needed, part_of
from rigid_motion_batch.analysis.radii import JOINT
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.clip_reading import read_clips
from rigid_motion_batch.recordings.clips import Clip
from rigid_motion_batch.recordings.options import ReadingOptions
from rigid_motion_batch.recordings.reading import FORMATS, files_of

from .bows import SCREW
from .motions import sampling_rate
from .table import RADIUS, SAMPLES_AN_UPDATE

MODES = (REFERENCE, SCREW, "pga_lerp", "motor_spline")

ERROR_RATES = (5, 10)
"""Key poses a second at which errors are measured."""

BODY = "body"
"""What rows are of that are not of a limb."""

LIMBS = {"hands": ("hand", True), "feet": ("foot", True), "heads": ("head", False)}
"""Kinds of joints that a tracker may be on: what their names say, and whether there is one on either side."""

SIDES = ("left", "right")

IN_PARENTS, ALONE = "in parents' spaces", "alone"
"""The ways to interpolate a limb: through the joints that it hangs on, or as a single body."""

NEVER_EXACT = 1e-3
"""Files round the time of a frame: so much, as a share, may be missing to two samples an update."""

SEARCHED = 10.0
"""Seconds of a whole body, from its first sample on, for which key poses are searched: every try reduces keys anew."""

JUMP = 3.0
"""A first sample is no motion from which the body gets away so many times faster than it ever moves afterwards: files
of motion capture may begin with a pose to calibrate by."""

WHOLE = ReadingOptions(start=0.0)
"""A first sample that is no motion is looked for here, in all bodies alike."""

MAY_HOLD_BODIES = ("BVH", "FBX", "glTF", "Blender file")
"""Formats that are looked at for a whole body among the recordings."""


@dataclass(frozen=True)
class Body:
    """A body that was looked at. The fields are the columns of `bodies.csv`."""

    body: str
    source: str
    """The name of its file."""

    joints: int = 0
    samples: int = 0
    seconds: float = 0.0
    samples_per_s: float = 0.0
    roots: int = 0

    moved_m: float = 0.0
    """The farthest that any joint but the roots gets about in its parent's space, corner to corner of what it fills."""

    skipped: int = 0
    """Samples at the beginning that are no motion: see `JUMP`."""

    left_out: str = ""
    """Why it does not count; empty where it does."""


@dataclass(frozen=True)
class Limb:
    """A joint that was taken for one that a tracker may be on. The fields are the columns of `bodies_limbs.csv`."""

    body: str
    limb: str
    """Of `LIMBS`."""

    joint: str
    """Its name in the file."""

    number: int

    chain: int
    """How many joints that move carry it, itself among them."""

    left_out: str = ""


@dataclass(frozen=True)
class KeysOfBody:
    """Key poses needed. The fields are the columns of `bodies_needed.csv`."""

    body: str
    of: str
    """`BODY`, or one of `LIMBS` alone."""

    joint: str
    """Empty for the whole body."""

    mode: str
    decimation: str
    rate: int
    """Key poses a second of the reference."""

    reference_keys: int

    keys: float
    """As many are as good; infinite where nothing less than every sample is."""

    @property
    def share(self) -> float:
        """Of the reference's."""
        return self.keys / self.reference_keys


@dataclass(frozen=True)
class ErrorOfBody:
    """The errors of a mode with evenly spaced key poses. The fields are the columns of `bodies_errors.csv`."""

    body: str
    of: str
    joint: str

    way: str
    """`IN_PARENTS` or `ALONE`."""

    mode: str
    rate: int
    keys: int
    rms_shell_m: float
    rms_position_m: float
    rms_rotation_deg: float
    rms_velocity_m_s: float


@dataclass(frozen=True)
class Apart:
    """How far `dq_sclerp` gets from `lerp_slerp`, at most. The fields are the columns of `bodies_apart.csv`."""

    body: str
    rate: int
    """Key poses a second."""

    parents_m: float
    """Joints but roots, in their parents' spaces."""

    joint: str
    """The one that is."""

    carried_m: float
    """The same joints in the space of the roots, where these are the same under both: what adds up along a chain."""

    roots_m: float
    """The roots."""

    all_m: float
    """All joints in the space of the roots, whose own difference carries them along."""

    turned_deg: float
    """How far the two are turned from one another, at most, in the parents' spaces of all joints."""

    error_m: float
    """How far `lerp_slerp` is from the recording there, at most."""


FILES = {
    "bodies.csv": Body,
    "bodies_limbs.csv": Limb,
    "bodies_needed.csv": KeysOfBody,
    "bodies_errors.csv": ErrorOfBody,
    "bodies_apart.csv": Apart,
}
"""Tables, and what their rows are."""


# -- what there is to study --------------------------------------------------------------------------------------------


def body_files(paths: Iterable[Path]) -> list[Path]:
    """The files that are given, and in folders those that may hold a body, each once.

    Raises
    ------
    TrajectoryError
        Where there is no such file, or no such recording in a folder.
    """
    found: dict[Path, None] = {}
    for path in paths:
        if not path.exists():
            raise TrajectoryError(str(path), "no such file or folder", "check the path")
        files = [path]
        if path.is_dir():
            files = [file for file in map(Path, files_of(str(path))) if may_hold_a_body(file)]
        if not files:
            raise TrajectoryError(
                str(path), "no recording in this folder that may hold a body", f"known are {', '.join(_extensions())}"
            )
        found |= dict.fromkeys(files)
    return list(found)


def may_hold_a_body(path: Path) -> bool:
    """Whether a file is of a format that whole bodies come in."""
    return path.is_file() and path.suffix.lower() in _extensions()


def _extensions() -> list[str]:
    return [extension for known in FORMATS if known.label in MAY_HOLD_BODIES for extension in known.extensions]


def read_body(source: str, name: str) -> tuple[Body, Clip | None]:
    """Read and repair the first whole body of a file; no clip where there is none, or nothing of it moves."""
    file = Path(source).name
    try:
        clips, _ = read_clips([source], None, WHOLE)
    except TrajectoryError as error:
        return Body(name, file, left_out=str(error).replace(source, file)), None
    whole = [clip for clip in clips if clip.figure is not None]
    if not whole:
        return Body(name, file, left_out=NO_BODY), None
    clip, skipped = _from_where_it_moves(replace(whole[0], name=name))
    roots = clip.figure.parents < 0
    widths = np.ptp(clip.poses.positions, axis=1) * clip.metres_per_unit
    body = Body(
        body=name,
        source=file,
        joints=len(roots),
        samples=len(clip.times),
        seconds=float(clip.times[-1] - clip.times[0]),
        samples_per_s=sampling_rate(clip),
        roots=int(roots.sum()),
        moved_m=float(np.linalg.norm(widths[~roots], axis=-1).max(initial=0.0)),
        skipped=skipped,
        left_out="" if moving(clip).any() else "at rest: none of its joints moves",
    )
    return body, None if body.left_out else clip


NO_BODY = "it is no whole body"


def _from_where_it_moves(clip: Clip) -> tuple[Clip, int]:
    """A clip without a first sample that is no motion, and how many that were."""
    places = clip.figure.skeleton.in_root_space(clip.poses).positions
    speeds = np.linalg.norm(np.diff(places, axis=1), axis=-1).max(axis=0) / np.diff(clip.times)
    if len(speeds) < 2 or speeds[0] <= JUMP * speeds[1:].max():
        return clip, 0
    return part_of(clip, 1, len(clip.times) - 1), 1


def limbs_of(clip: Clip) -> list[Limb]:
    """The joints that are hands, feet and head by their names; of several the plainest name, and of such the first."""
    words = [_words(joint) for joint in clip.figure.joints]
    moves = moving(clip)
    found = []
    for limb, (part, sided) in LIMBS.items():
        for side in SIDES if sided else ("",):
            named = [number for number, own in enumerate(words) if _is(own, part, side)]
            if not named:
                continue
            number = min(named, key=lambda number: len(words[number]))
            chain = sum(moves[joint] for joint in _chain(clip.figure.parents, number))
            reason = "" if chain else "it does not move"
            found.append(Limb(clip.name, limb, clip.figure.joints[number], number, int(chain), reason))
    return found


def _words(name: str) -> list[str]:
    """What a name is made of: "mixamorig:LeftHand" of mixamorig, left and hand."""
    parts = re.findall(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+", re.sub(r"[^0-9A-Za-z]+", " ", name))
    return [part.lower() for part in parts]


def _is(words: Sequence[str], part: str, side: str) -> bool:
    """Whether these words end in a limb: "left hand", "lefthand", "hand l" and, without sides, "head"."""
    wanted = {f"{a}{b}" for one in ((side, side[0]) if side else ("",)) for a, b in ((one, part), (part, one))}
    return "".join(words[-1:]) in wanted or (len(words) > 1 and bool(side) and "".join(words[-2:]) in wanted)


def _chain(parents: np.ndarray, joint: int) -> list[int]:
    chain = []
    while joint >= 0:
        chain.append(joint)
        joint = int(parents[joint])
    return chain


def alone(clip: Clip, joint: int) -> Clip:
    """A joint as a single rigid body in the space of the roots, as a tracker on it would have it."""
    return replace(clip, poses=clip.figure.skeleton.in_root_space(clip.poses)[joint], figure=None)


# -- what comes of it --------------------------------------------------------------------------------------------------


def rates_of(clip: Clip) -> list[str]:
    """Those of `needed.RATES` that leave a body two samples to a key pose."""
    most = sampling_rate(clip) * (1.0 + NEVER_EXACT) / SAMPLES_AN_UPDATE
    return [rate for rate in RATES if float(rate) <= most]


def needed_of(clip: Clip, limbs: Iterable[Limb], advance: Callable[[], object] = lambda: None) -> list[KeysOfBody]:
    """The key poses that every mode needs, of the whole body and of each limb alone.

    `advance` is called once for each of `needed.RATES`, for the body and for every limb.
    """
    radii = np.full(len(clip.figure.joints), JOINT)
    searched = part_of(clip, 0, int(np.searchsorted(clip.times, clip.times[0] + SEARCHED, side="right")) - 1)
    rows = _rows(clip, BODY, "", keys_needed(OfBody(searched, radii), MODES, advance=advance))
    for limb in limbs:
        found = keys_needed(OfRigidBody(alone(clip, limb.number), RADIUS), MODES, advance=advance)
        rows += _rows(clip, limb.limb, limb.joint, found)
    return rows


def _rows(clip: Clip, of: str, joint: str, found: KeysNeeded) -> list[KeysOfBody]:
    counted = rates_of(clip)
    return [
        KeysOfBody(clip.name, of, joint, mode, DECIMATIONS[way], int(rate), int(found.reference_keys[place]), keys)
        for row, group in enumerate(found.groups)
        for mode in group
        for way in range(found.keys.shape[1])
        for place, rate in enumerate(found.rates)
        if rate in counted and not np.isnan(keys := float(found.keys[row, way, place]))
    ]


def errors_of(clip: Clip, limbs: Iterable[Limb]) -> list[ErrorOfBody]:
    """The errors of all modes at `ERROR_RATES`: of the body, and of each limb in both ways at the same keys."""
    limbs, rows = list(limbs), []
    for rate in ERROR_RATES:
        made = _with_key_poses(clip, rate)
        if made is None:
            continue
        for row in measure_modes(made, JOINT).rows:
            numbers = row.rms_shell_m, row.rms_position_m, row.rms_rotation_deg, row.rms_velocity_m_s
            rows.append(ErrorOfBody(clip.name, BODY, "", IN_PARENTS, row.mode, rate, row.key_frames, *numbers))
        for mode in MODES:
            shown = made.shown(mode, made.times) if limbs else None
            for limb in limbs:
                rows += _both_ways(clip, limb, mode, rate, shown[limb.number])
    return rows


def _both_ways(clip: Clip, limb: Limb, mode: str, rate: int, through_joints: Poses) -> list[ErrorOfBody]:
    single = alone(clip, limb.number)
    keys = decimate(clip.times, rate)
    samples = slice(int(keys[0]), int(keys[-1]) + 1)
    times, truth = clip.times[samples], clip.in_metres(single.poses[samples])
    filled = clip.in_metres(interpolate(clip.times[keys], single.poses[keys], times, mode))
    rows = []
    for way, shown in ((IN_PARENTS, through_joints), (ALONE, filled)):
        errors = measure(times, shown, truth, RADIUS)
        numbers = rms(errors.shell), rms(errors.position), float(np.degrees(rms(errors.rotation))), rms(errors.velocity)
        rows.append(ErrorOfBody(clip.name, limb.limb, limb.joint, way, mode, rate, len(keys), *numbers))
    return rows


def apart_of(clip: Clip) -> list[Apart]:
    """How far a screw gets from positions and rotations apart, at `ERROR_RATES`."""
    rows, roots, skeleton = [], clip.figure.parents < 0, clip.figure.skeleton
    for rate in ERROR_RATES:
        made = _with_key_poses(clip, rate)
        if made is None:
            continue
        straight, screw = (made.filled_in(mode, made.times) for mode in (REFERENCE, SCREW))
        held = screw.copy()
        held[np.flatnonzero(roots)] = straight[roots]
        shown, carried, whole = (skeleton.in_root_space(poses) for poses in (straight, held, screw))
        own = _distances(clip, straight, screw)
        joint = int(np.where(roots, -1.0, own).argmax())
        truth = made.truth(made.samples).positions
        errors = np.linalg.norm(clip.in_metres(shown).positions - truth, axis=-1)
        rows.append(
            Apart(
                body=clip.name,
                rate=rate,
                parents_m=0.0 if roots.all() else float(own[joint]),
                joint="" if roots.all() else clip.figure.joints[joint],
                carried_m=float(_distances(clip, shown, carried)[~roots].max(initial=0.0)),
                roots_m=float(own[roots].max()),
                all_m=float(_distances(clip, shown, whole).max()),
                turned_deg=float(np.degrees(angle_between(screw.quaternions, straight.quaternions).max())),
                error_m=float(errors.max()),
            )
        )
    return rows


def _with_key_poses(clip: Clip, rate: int) -> BodyReconstruction | None:
    """Evenly spaced; none where the clip is too short for two, or has no two samples to each."""
    if rate > sampling_rate(clip) * (1.0 + NEVER_EXACT) / SAMPLES_AN_UPDATE:
        return None
    return reconstruct_body(clip, Uniform(str(rate)), MODES, JOINT)


def _distances(clip: Clip, first: Poses, second: Poses) -> np.ndarray:
    """How far the origins of joints get from one another, at most, in metres: shape (joints,)."""
    apart = np.linalg.norm(first.positions - second.positions, axis=-1)
    return apart.max(axis=-1) * clip.metres_per_unit


# -- over all bodies ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class MeanShare:
    """Keys needed, as a share of the reference's: the geometric mean over those on which the error was reached."""

    share: float
    """Infinite where it was on none."""

    reached: int
    asked: int


def mean_share(rows: Iterable[KeysOfBody], of: str, mode: str, decimation: str, rate: int) -> MeanShare | None:
    """Over all bodies, or all limbs of a kind; None where none was asked."""
    wanted = (of, mode, decimation, rate)
    shares = np.array([row.share for row in rows if (row.of, row.mode, row.decimation, row.rate) == wanted])
    if not len(shares):
        return None
    reached = int(np.isfinite(shares).sum())
    return MeanShare(float(geometric_mean(shares)) if reached else float("inf"), reached, len(shares))


def mean_error(
    rows: Iterable[ErrorOfBody], of: str, way: str, mode: str, rate: int, column: str = "rms_shell_m"
) -> float:
    """The geometric mean over all bodies, or all limbs of a kind; NaN where there are none."""
    wanted = (of, way, mode, rate)
    errors = [getattr(row, column) for row in rows if (row.of, row.way, row.mode, row.rate) == wanted]
    return float(geometric_mean(np.array(errors))) if errors else float("nan")
