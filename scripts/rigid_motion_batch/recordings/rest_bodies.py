"""Rest bodies of figures: the joints at rest and the skin of a whole body, and its size and likely unit.

Arrays have the joints first, parents before their children. Lengths are in the unit of the file, and axes are its own,
like those of a figure's poses: each joint in its parent's space, roots in the world.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rigid_motion.motion import Poses, Skeleton
from rigid_motion.motion.poses import inverse, placed
from rigid_motion.motion.quaternions import conjugate, rotate
from rigid_motion.motion.repair import MAX_MEASURE

UNITS = (
    ("metres", 1.0),
    ("centimetres", 0.01),
    ("inches", 0.0254),
    ("units of CMU's motion capture, 1/0.45 inch", 0.0254 / 0.45),
    ("millimetres", 0.001),
    ("feet", 0.3048),
    ("decimetres", 0.1),
)
"""Units of files that do not state theirs, the most likely first, and their lengths in metres."""

IN_METRES = 0.2, 5.0
"""Smallest and largest size of a body that is assumed to be in metres."""

GROWN_UP = 0.9, 2.3
"""Smallest and largest usual size of bodies, in metres: a unit that gives such a size is taken as the file's."""

HIGHEST_HIPS = 1.3
"""Metres above the floor: the lowest joint of a body that stands on the floor is never higher."""

TYPICAL_HEIGHT_M = 1.7
"""Metres. If no unit gives a size in `GROWN_UP`, the unit that comes nearest to this height is taken."""

PLAUSIBLE_HEIGHTS_M = 0.5, 2.5
"""Metres: from children to giants. For a body of any other size, the guessed unit is hardly right."""

MOST_NAMED = 5
"""Joints listed for each kind of fault."""

MOST_VERTICES = 200_000
"""Vertices of a skin; a body with more is shown without its skin."""

MAX_JOINTS_PER_VERTEX = 4
"""Joints that carry a vertex; weaker ones beyond these are dropped."""

MAX_ROOT_DISTANCE_RATIO = 0.3
"""Distance of a root from its body, as a fraction of the body's size, up to which it is part of the body."""

MIN_LOOSE_MOVE_RATIO = 0.05
"""Children of a still root are loose if all of them move by more than this fraction of the body's size."""

ZERO_SIZE = 1e-9
"""Size, in any unit, below which a body has no size."""

LOOKED_AT = 64
"""Moments of a motion that determine which joints move."""

MAX_SAME_NUMBER_RATIO = 1e-6
"""Ratio by which equal numbers may differ: single precision."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The surface of a body, with its joints at rest."""

    vertices: np.ndarray
    """Shape (v, 3), in the world."""

    triangles: np.ndarray
    """Shape (t, 3), vertex indices."""

    joints: np.ndarray
    """Shape (v, 4): the joints that carry each vertex."""

    weights: np.ndarray
    """Shape (v, 4): the weights of these joints. They sum to 1; unused ones are 0."""


@dataclass(frozen=True, eq=False)
class RestBody:
    """A body at rest."""

    joints: tuple[str, ...]
    """Unique names of the joints."""

    parents: np.ndarray
    """Shape (joints,): the index of each joint's parent, lower than its own, -1 for roots."""

    rest: Poses
    """Poses of the joints at rest, shape (joints,), in the world and not in the space of the parents."""

    tails: np.ndarray
    """Bone tails of all joints, each in the joint's own space, shape (joints, 3)."""

    skin: Skin | None = None

    ends: np.ndarray | None = None
    """Lengths, shape (joints,), of bones that end where no child begins, and 0 for the other bones; None if the file
    has no such ends, or an importer made them up."""

    @property
    def skeleton(self) -> Skeleton:
        return Skeleton(self.parents)


def in_parents(world: Poses, parents: np.ndarray) -> Poses:
    """Return poses (joints, n) in the world, converted to the space of each joint's parent, if it has one."""
    local = Poses(world.positions.copy(), world.quaternions.copy(), world.scales)
    for joint in np.flatnonzero(parents >= 0).tolist():  # One by one: a long recording takes much memory at once.
        local[joint] = placed(inverse(world[parents[joint]]), world[joint])
    return local


def repaired(rest_body: RestBody) -> tuple[RestBody, tuple[str, ...]]:
    """Return a figure with only finite numbers, and a sentence on each repair, as in `repair`.

    The rest positions and the tails of joints affect only how bones are drawn.
    """
    places, tails, skin, done = rest_body.rest.positions, rest_body.tails, rest_body.skin, []
    wrong = ~(np.abs(np.concatenate((places, tails), axis=1)) < MAX_MEASURE).all(axis=1)
    if wrong.any():
        names = ", ".join(np.array(rest_body.joints)[wrong][:MOST_NAMED].tolist())
        more = ", ..." if np.count_nonzero(wrong) > MOST_NAMED else ""
        done.append(f"drew no bones for joints that are nowhere at rest ({np.count_nonzero(wrong)}: {names}{more})")
        places, tails = (np.where(wrong[:, None], 0.0, some) for some in (places, tails))
        ends = None if rest_body.ends is None else np.where(wrong, 0.0, rest_body.ends)
        rest_body = replace(rest_body, rest=Poses(places, rest_body.rest.quaternions), tails=tails, ends=ends)
    if skin is not None and not (np.abs(skin.vertices) < MAX_MEASURE).all():
        done.append("left out a skin with numbers that are missing, not finite or too large")
        rest_body = replace(rest_body, skin=None)
    return rest_body, tuple(done)


def tails_of(rest: Poses, parents: np.ndarray) -> np.ndarray:
    """Return tails, as in `RestBody`, for bones of joints at rest in the world (joints,) where the file has none.

    The tail is amid the joint's children. Without children, it is along y, at the distance of the parent; if that is 0,
    at the largest such distance, or at 1 if all joints are in one place.
    """
    hanging = np.flatnonzero(parents >= 0)
    arms, lengths = np.zeros((len(parents), 3)), np.zeros(len(parents))
    steps = rest.positions[hanging] - rest.positions[parents[hanging]]
    np.add.at(arms, parents[hanging], steps)
    lengths[hanging] = np.linalg.norm(steps, axis=1)
    lengths = np.where(lengths > 0.0, lengths, np.max(lengths) or 1.0)
    children = np.bincount(parents[hanging], minlength=len(parents))
    tails = rotate(conjugate(rest.quaternions), arms / np.maximum(children, 1)[:, None])
    return np.where((children > 0)[:, None], tails, lengths[:, None] * (0.0, 1.0, 0.0))


def carrying(parents: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return which joints only carry a body around, or stand where it moves, given their positions (joints, n, 3).

    Such joints may be anywhere. A joint near its only child is part of the body, like hips without legs.
    """
    places = few_of(places)
    result = ~part_of_body(parents, places)
    size = float(np.median(np.ptp(places[~result], axis=0).max(axis=-1)))
    for joint in np.flatnonzero(result)[::-1].tolist():
        hanging = np.flatnonzero(parents == joint)
        if len(hanging) == 1 and not result[hanging[0]]:
            result[joint] = (
                np.median(np.linalg.norm(places[hanging[0]] - places[joint], axis=-1)) > MAX_ROOT_DISTANCE_RATIO * size
            )
    return result


def part_of_body(parents: np.ndarray, places: np.ndarray | None = None) -> np.ndarray:
    """Return which joints are part of a body, shape (joints,), using their positions (joints, n, 3) if known.

    Joints that only carry the body around, such as from the ground, are not part of it: a body begins at the first
    joint with several children. If that joint is still while one of its children moves away, the body begins with the
    children, without those that are still and far from everything that moves.
    """
    children = np.bincount(parents[parents >= 0], minlength=len(parents))
    body = np.ones(len(parents), dtype=bool)
    moves = None if places is None else _is_moving(places)
    for root in np.flatnonzero(parents < 0).tolist():
        chain = [root]
        while children[chain[-1]] == 1:
            chain.append(int(np.flatnonzero(parents == chain[-1])[0]))
        if children[chain[-1]] > 1:
            body[chain[:-1]] = False
            if places is not None and moves is not None and moves.any() and not moves[chain[-1]]:
                body[_still_joints(parents, places, moves, chain[-1])] = False
    return body


def few_of(places: np.ndarray) -> np.ndarray:
    """Return positions (joints, n, 3) at a few of the moments."""
    return places[:, :: -(-places.shape[1] // LOOKED_AT)]


def _is_moving(places: np.ndarray) -> np.ndarray:
    """Return which joints change their position, shape (joints,)."""
    return np.ptp(places, axis=1).max(axis=-1) > MAX_SAME_NUMBER_RATIO * np.abs(places).max(axis=(1, 2), initial=1.0)


def _still_joints(parents: np.ndarray, places: np.ndarray, moves: np.ndarray, root: int) -> list[int]:
    """Return the still joints that are not part of the body moving below a still root with several children.

    Returns none if all children stay about where they are attached, as on hips.
    """
    hanging = np.flatnonzero(parents == root)
    gone = np.linalg.norm(places[hanging] - places[hanging, :1], axis=-1).max(axis=1)
    size = float(np.median(np.ptp(places[moves], axis=0).max(axis=-1)))
    apart = float(np.median(np.linalg.norm(places[moves] - places[root], axis=-1).min(axis=0)))
    loose = gone.min() > MIN_LOOSE_MOVE_RATIO * size or gone.max() > MAX_ROOT_DISTANCE_RATIO * size
    if not loose and not (gone.max() > 0.0 and apart > size):
        return []
    middle, result = places[moves].mean(axis=0), [root]
    for child in hanging.tolist():
        below = np.zeros(len(parents), dtype=bool)
        below[child] = True
        for joint in range(child + 1, len(parents)):
            below[joint] = parents[joint] >= 0 and below[parents[joint]]
        away = np.median(np.linalg.norm(places[child] - middle, axis=-1))
        if not moves[below].any() and away > size:
            result += np.flatnonzero(below).tolist()
    return result


def size_of(parents: np.ndarray, places: np.ndarray) -> float:
    """Return the largest extent along any axis of a body with joints at these positions (joints, 3)."""
    return float(np.ptp(places[part_of_body(parents)], axis=0).max())


def unit_of(size: float) -> tuple[str, float]:
    """Return the name of the likely unit of a body of this size, and its length in metres."""
    if size < ZERO_SIZE or IN_METRES[0] <= size <= IN_METRES[1]:
        return UNITS[0]
    for name, length in UNITS:
        if GROWN_UP[0] <= size * length <= GROWN_UP[1]:
            return name, length
    return min(UNITS, key=lambda unit: abs(np.log(size * unit[1] / TYPICAL_HEIGHT_M)))


def unit_above_floor(size: float, lowest: float, highest: float) -> tuple[str, float, str]:
    """Return the name of a body's likely unit, its length in metres, and evidence for it other than the size.

    `lowest` and `highest` are the heights of its joints above the floor. If its size alone would put the whole body
    above the hips of giants, it is part of a body, such as the upper half: then its height is that of an adult.
    """
    usual, length = unit_of(size)
    if length == 1.0 or lowest * length <= HIGHEST_HIPS:
        return usual, length, ""
    for name, metres in UNITS:
        if GROWN_UP[0] <= highest * metres <= GROWN_UP[1] and lowest * metres <= HIGHEST_HIPS:
            why = (
                f"guessed from its height of {highest * metres:.3g} m above the floor: in {usual}, all of it would be "
            )
            return name, metres, f"{why}more than {lowest * length:.3g} m up"
    return usual, length, ""


def likely_metres(parents: np.ndarray, places: np.ndarray, metres_per_unit: float = 1.0) -> float:
    """Return the likely length in metres of the unit of a body with joints at these positions (joints, 3)."""
    with np.errstate(invalid="ignore", over="ignore"):
        size = size_of(parents, places) * metres_per_unit
    return metres_per_unit * (unit_of(size)[1] if np.isfinite(size) else 1.0)


def certainty(size: float, length: float) -> str:
    """Return how certain a unit of this length in metres is, judged by the size of the body alone."""
    fitting = [(name, size * metres) for name, metres in UNITS if GROWN_UP[0] <= size * metres <= GROWN_UP[1]]
    others = [f"{name} ({metres:.3g} m)" for name, metres in fitting if metres != size * length]
    if others:
        return f"guessed from the size alone, and may as well be {' or '.join(others)}"
    if fitting:
        return "guessed from the size alone, the only usual unit that makes a grown-up of it"
    return "guessed from the size alone, and no usual unit makes a grown-up of it"


def short_names(joints: Sequence[str]) -> list[str]:
    """Return joint names without a namespace that all share: "mixamorig:Hips" becomes "Hips"."""
    spaces = {name.rpartition(":")[0] for name in joints}
    return [name.rpartition(":")[2] for name in joints] if len(spaces) == 1 else list(joints)
