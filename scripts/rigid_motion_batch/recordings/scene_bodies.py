"""Bodies of a scene file: whole bodies of joints, single moving objects, and the choice of the requested ones.

A whole body is the bones of a skeleton or, without a skeleton, at least `MIN_MOVING_NODES` moving nodes in one
hierarchy. Any other moving node, such as a prop or a camera, is a single rigid body.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Protocol

import numpy as np

from rigid_motion_batch.command_line import listed

from .recordings import ALL, NoMotion, Selection, Trajectory, TrajectoryError, unique
from .tables import LARGEST_FILE

MIN_MOVING_NODES, MIN_GENERATIONS = 5, 3
"""Moving nodes, and generations of them in the hierarchy, that make a body: a car and its wheels do not."""

MAX_LISTED_NAMES = 5
"""Number of names listed in a remark."""


def refuse_too_large(path: Path, *others: Path) -> None:
    """Raise TrajectoryError if a file, together with the files that belong to it, exceeds the size limit."""
    size = sum(item.stat().st_size for item in (path, *others))
    if size > LARGEST_FILE:
        problem = f"{size} bytes are more than the {LARGEST_FILE} that are read"
        raise TrajectoryError(path, problem, "export the skeleton without its meshes, or split the recording")


class Scene(Protocol):
    """Nodes whose motion can be read."""

    def whole(self, name: str, own: Sequence[int], remark: str) -> Trajectory:
        """Return the nodes `own` as a whole body with a name."""

    def joints(self, chosen: Sequence[int], own: Sequence[int]) -> list[Trajectory]:
        """Return the chosen nodes of a whole body as single bodies in the world."""

    def alone(self, node: int) -> Trajectory:
        """Return a node that belongs to no whole body, in the world."""


@dataclass(frozen=True, eq=False)
class SceneBodies:
    """Bodies of a scene. Its nodes are objects, bones and other members of a hierarchy."""

    path: Path
    names: Sequence[str]
    """Names of the nodes."""

    wholes: Mapping[str, Sequence[int]]
    """The joints of whole bodies, parents first."""

    moving: Sequence[str]
    """Moving whole bodies, the largest first."""

    alone: Sequence[int]
    """Other moving nodes."""

    others: Sequence[int]
    """Other nodes, selected only by name."""

    @classmethod
    def of(
        cls,
        path: Path,
        names: Sequence[str],
        parents: np.ndarray,
        moves: np.ndarray,
        keyed: np.ndarray,
        skeletons: Mapping[str, Sequence[int]],
        aside: Iterable[int] = (),
    ) -> SceneBodies:
        """Find the bodies of a scene.

        Parameters
        ----------
        path : Path
        names : sequence of str
            Names of the nodes.
        parents : array of int, shape (nodes,)
            The index of each node's parent, -1 for none; in any order.
        moves, keyed : array of bool, shape (nodes,)
            Whether a node moves by itself, and whether it has keys, which may all be equal.
        skeletons : mapping of str to sequence of int
            The joints of the bodies that have a skeleton.
        aside : iterable of int
            Nodes to ignore.
        """
        free = np.ones(len(names), dtype=bool)
        free[[*chain.from_iterable(skeletons.values()), *aside]] = False
        swings = moves & free
        loose = jointed(parents, swings, swings | (keyed & free & (nearest_above(parents, swings) >= 0)))
        called = [names[parents[own[0]]] if parents[own[0]] >= 0 else "Body" for own in loose]
        wholes = dict(zip(unique([*skeletons, *called]), [*skeletons.values(), *loose], strict=True))
        lines = {name: with_above(parents, own) for name, own in wholes.items()}
        free[[*chain.from_iterable(lines.values())]] = False
        alone = np.flatnonzero(moves & free).tolist()
        moving = [name for name, line in lines.items() if moves[line].any()]
        if not (moving or alone):
            moving = [name for name, line in lines.items() if keyed[line].any()]
        taken = {*alone, *chain.from_iterable(wholes.values())}
        others = [node for node in range(len(names)) if node not in taken]
        return cls(path, names, wholes, sorted(moving, key=lambda name: -len(wholes[name])), alone, others)

    def read(self, selection: Selection, scene: Scene) -> list[Trajectory]:
        """Return the requested bodies or, if none is named, the largest whole body, or else the first moving node.

        Raises
        ------
        TrajectoryError
            If the body is not in the file, or nothing moves.
        """
        if not (self.moving or self.alone):
            problem = "nothing moves in this file"
            raise NoMotion(self.path, problem, "export what moves, a skeleton or objects, together with its animation")
        largest, alone = next(iter(self.moving), None), self._names_of(self.alone)
        if selection.requested is None and largest is not None:
            others = listed([*self.moving[1:], *alone], MAX_LISTED_NAMES)
            remark = f"took {largest} of {len(self.moving) + len(alone)} bodies; others: {others}" if others else ""
            return [scene.whole(self.path.stem, self.wholes[largest], remark)]
        joints = self.wholes[largest] if largest is not None else ()
        nodes = self._by_name(largest)
        selection.match([*self.wholes, *nodes])
        name = selection.requested or ALL
        if name in self.wholes and (name not in nodes or nodes[name][0] is None):
            return [scene.whole(name, self.wholes[name], "")]
        if name in nodes:
            whole, node = nodes[name]
            selection.of(alone if whole is None else self._names_of(self.wholes[whole]), [name])
            single = scene.alone(node) if whole is None else scene.joints([node], self.wholes[whole])[0]
            return [replace(single, name=name)]
        taken = selection.of([*self._names_of(joints), *alone], self._names_of(self.others))
        singles = [scene.alone(node) for node in self.alone[: len(taken)]]
        return [*(scene.joints(joints, joints) if joints else ()), *singles]

    def _names_of(self, nodes: Iterable[int]) -> list[str]:
        return [self.names[node] for node in nodes]

    def _by_name(self, largest: str | None) -> dict[str, tuple[str | None, int]]:
        """Return each node's whole body (if any) and index by its possible names, which include WHOLE/JOINT."""
        wholes = sorted(self.wholes.items(), key=lambda item: item[0] != largest)
        joints = [(self.names[node], (whole, node)) for whole, own in wholes for node in own]
        others = [(self.names[node], (None, node)) for node in (*self.alone, *self.others)]
        paths = [(f"{whole}/{name}", (whole, node)) for name, (whole, node) in joints]
        return dict(reversed([*joints, *others, *paths]))


def jointed(parents: np.ndarray, moves: np.ndarray, belongs: np.ndarray) -> list[list[int]]:
    """Return the nodes of each body without a skeleton, parents first.

    Parameters
    ----------
    parents : array of int, shape (nodes,)
        The index of each node's parent, -1 for none; in any order.
    moves, belongs : array of bool, shape (nodes,)
        Whether a node moves by itself, and whether it may be a joint.
    """
    groups: dict[int, list[int]] = {}
    above = nearest_above(parents, belongs)
    top, depth = np.arange(len(parents)), np.ones(len(parents), dtype=np.int64)
    for node in parents_first(above):
        if belongs[node]:
            if above[node] >= 0:
                top[node], depth[node] = top[above[node]], depth[above[node]] + int(moves[node])
            groups.setdefault(int(top[node]), []).append(node)
    return [
        own
        for own in groups.values()
        if np.count_nonzero(moves[own]) >= MIN_MOVING_NODES and np.max(depth[own]) >= MIN_GENERATIONS
    ]


def with_above(parents: np.ndarray, chosen: Iterable[int]) -> list[int]:
    """Return the chosen nodes and all their ancestors, parents first."""
    result: dict[int, None] = {}
    for node in chosen:
        line = [node]
        while (above := int(parents[line[-1]])) >= 0 and above not in result:
            line.append(above)
        result |= dict.fromkeys(reversed(line))
    return list(result)


def nearest_above(parents: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the nearest chosen ancestor of each node, shape (nodes,), -1 for none."""
    result = np.full(len(parents), -1, dtype=np.int64)
    for node in parents_first(parents):
        if (parent := parents[node]) >= 0:
            result[node] = parent if chosen[parent] else result[parent]
    return result


def parents_among(parents: np.ndarray, own: Sequence[int]) -> np.ndarray:
    """Return the nearest ancestor of each node within `own`, as an index into `own`, shape (own,), -1 for none."""
    places = np.full(len(parents) + 1, -1, dtype=np.int64)
    places[[*own]] = np.arange(len(own))
    return places[nearest_above(parents, places[:-1] >= 0)[[*own]]]


def parents_first(parents: np.ndarray) -> list[int]:
    """Return the indices of nodes, each followed by all its descendants."""
    children: list[list[int]] = [[] for _ in range(len(parents) + 1)]
    for node, parent in enumerate(parents.tolist()):
        children[parent].append(node)
    result, waiting = [], children[-1][::-1]
    while waiting:
        result.append(node := waiting.pop())
        waiting += children[node][::-1]
    return result
