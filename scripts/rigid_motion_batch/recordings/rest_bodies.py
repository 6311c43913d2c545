"""Figures: what a whole body is made of, its joints at rest and its skin; and how large it is.

Arrays have the joints first, parents before their children. Lengths are in the unit of the file and axes are its own,
as those of the poses that go with a figure: each joint's in its parent's space, those of roots in the world.
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
"""Units of files that do not say theirs, the likelier first, and their lengths in metres."""

IN_METRES = 0.2, 5.0
"""Smallest and largest size, in metres, of a body that is assumed to be in metres."""

GROWN_UP = 0.9, 2.3
"""Metres that most bodies measure: a unit that makes a body as large is taken to be the file's."""

HIGHEST_HIPS = 1.3
"""Metres above the floor, beyond which the lowest joint of a body that stands on it is not."""

TYPICAL_HEIGHT_M = 1.7
"""Metres; where no unit makes a body that large, that is taken which comes nearest."""

PLAUSIBLE_HEIGHTS_M = 0.5, 2.5
"""Metres: children and giants. A body of another size is hardly in the unit that was guessed."""

MOST_NAMED = 5
"""Joints that are named of one kind of fault."""

MOST_VERTICES = 200_000
"""A body with more is shown without its skin."""

MAX_JOINTS_PER_VERTEX = 4
"""Joints that carry a vertex; more are left out, the weaker ones."""

MAX_ROOT_DISTANCE_RATIO = 0.3
"""How far a root is from its body, of the size of that, up to which it is a part of it."""

MIN_LOOSE_MOVE_RATIO = 0.05
"""How far all moves that hangs on a root which stands, of the size of the body, where nothing is joined to it."""

ZERO_SIZE = 1e-9
"""The size of what has none, in any unit."""

LOOKED_AT = 64
"""Moments of a motion that tell what moves in it."""

MAX_SAME_NUMBER_RATIO = 1e-6
"""Share by which numbers differ that are the same: single precision."""


@dataclass(frozen=True, eq=False)
class Skin:
    """The surface of a body where its joints are at rest."""

    vertices: np.ndarray
    """Shape (v, 3), in the world."""

    triangles: np.ndarray
    """Shape (t, 3), numbers of vertices."""

    joints: np.ndarray
    """Shape (v, 4): the joints that carry each vertex."""

    weights: np.ndarray
    """Shape (v, 4): how much of it each carries. They sum to 1; what is not needed is 0."""


@dataclass(frozen=True, eq=False)
class RestBody:
    """A body at rest."""

    joints: tuple[str, ...]
    """Their names, each once."""

    parents: np.ndarray
    """Shape (joints,): the number of each joint's parent, lower than its own, -1 for roots."""

    rest: Poses
    """Poses of the joints at rest, shape (joints,), in the world and not in their parents' space."""

    tails: np.ndarray
    """Ends of the bones of all joints, each in the joint's own space, shape (joints, 3)."""

    skin: Skin | None = None

    ends: np.ndarray | None = None
    """How far from each joint its bone ends where no child begins, shape (joints,), and 0 where an importer made that
    up; None where the file has no such ends.
    """

    @property
    def skeleton(self) -> Skeleton:
        return Skeleton(self.parents)


def in_parents(world: Poses, parents: np.ndarray) -> Poses:
    """Return poses in the world (joints, n), each in the space of its parent, if it has one of parents (joints,)."""
    local = Poses(world.positions.copy(), world.quaternions.copy(), world.scales)
    for joint in np.flatnonzero(parents >= 0).tolist():  # One by one: all of a long recording is large.
        local[joint] = placed(inverse(world[parents[joint]]), world[joint])
    return local


def repaired(rest_body: RestBody) -> tuple[RestBody, tuple[str, ...]]:
    """Return a figure with finite numbers alone, and what was done for that, a sentence each, as in `repair`.

    Where a joint is at rest, and where its bone ends, decides about nothing but how it is drawn.
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
    """Return ends of bones that nothing tells, as `RestBody` has them, of joints at rest in the world (joints,).

    They are in the middle of a joint's children; at one without any, along y as far as its parent is, or as the
    farthest of all, or 1 where all are in one place.
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
    """Return which joints only carry a body about, or stand where it moves, by their places (joints, n, 3).

    They may be anywhere. One that is near to the only joint that hangs on it is a part of the body, as hips without
    legs are.
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
    """Return which joints are part of a body, shape (joints,), by their places (joints, n, 3) where these are known.

    Joints that only carry the rest of it about, from the ground or from wherever they were left, are none: a body
    begins where a joint first has several children. Where that joint stands while one of these goes away from it, it
    begins with its children, without those that stand far from all that moves.
    """
    children = np.bincount(parents[parents >= 0], minlength=len(parents))
    body = np.ones(len(parents), dtype=bool)
    moves = None if places is None else _travels(places)
    for root in np.flatnonzero(parents < 0).tolist():
        chain = [root]
        while children[chain[-1]] == 1:
            chain.append(int(np.flatnonzero(parents == chain[-1])[0]))
        if children[chain[-1]] > 1:
            body[chain[:-1]] = False
            if places is not None and moves is not None and moves.any() and not moves[chain[-1]]:
                body[_beside(parents, places, moves, chain[-1])] = False
    return body


def few_of(places: np.ndarray) -> np.ndarray:
    """Return places (joints, n, 3) at a few moments of all."""
    return places[:, :: -(-places.shape[1] // LOOKED_AT)]


def _travels(places: np.ndarray) -> np.ndarray:
    """Return which joints are not always at the same place, shape (joints,)."""
    return np.ptp(places, axis=1).max(axis=-1) > MAX_SAME_NUMBER_RATIO * np.abs(places).max(axis=(1, 2), initial=1.0)


def _beside(parents: np.ndarray, places: np.ndarray, moves: np.ndarray, root: int) -> list[int]:
    """Return the joints that are no part of what moves below one that stands and has several children; none where all
    stay about where they hang, as on hips.
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
    """Return the largest extent along any axis of the joints of a body at these places (joints, 3)."""
    return float(np.ptp(places[part_of_body(parents)], axis=0).max())


def unit_of(size: float) -> tuple[str, float]:
    """Return the unit that a body of this size is likely to be in: what it is called, and its length in metres."""
    if size < ZERO_SIZE or IN_METRES[0] <= size <= IN_METRES[1]:
        return UNITS[0]
    for name, length in UNITS:
        if GROWN_UP[0] <= size * length <= GROWN_UP[1]:
            return name, length
    return min(UNITS, key=lambda unit: abs(np.log(size * unit[1] / TYPICAL_HEIGHT_M)))


def unit_above_floor(size: float, lowest: float, highest: float) -> tuple[str, float, str]:
    """Return the unit that a body is likely to be in, its length in metres, and what else than its size speaks for it.

    The body is so large, and its joints are so high above the floor. Where by its size all of it would be higher than
    the hips of giants, it is a part of a body, such as the upper half: then its height is that of a grown-up.
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
    """Return the length of the unit that a body with joints at these places (joints, 3) is likely to be in."""
    with np.errstate(invalid="ignore", over="ignore"):
        size = size_of(parents, places) * metres_per_unit
    return metres_per_unit * (unit_of(size)[1] if np.isfinite(size) else 1.0)


def sureness(size: float, length: float) -> str:
    """Return how sure it is that the unit of a body of this size is so many metres long, which the size alone says."""
    fitting = [(name, size * metres) for name, metres in UNITS if GROWN_UP[0] <= size * metres <= GROWN_UP[1]]
    others = [f"{name} ({metres:.3g} m)" for name, metres in fitting if metres != size * length]
    if others:
        return f"guessed from the size alone, and may as well be {' or '.join(others)}"
    if fitting:
        return "guessed from the size alone, the only usual unit that makes a grown-up of it"
    return "guessed from the size alone, and no usual unit makes a grown-up of it"


def short_names(joints: Sequence[str]) -> list[str]:
    """Return the names of joints without a namespace that they all have: "mixamorig:Hips" becomes "Hips"."""
    spaces = {name.rpartition(":")[0] for name in joints}
    return [name.rpartition(":")[2] for name in joints] if len(spaces) == 1 else list(joints)
