"""GLB files of jointed bodies, with the joint positions according to the glTF specification."""

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tests.gltf.making import Making
from tests.gltf.player import File
from tests.scripts.clips.bodies import BONES, PARENTS


@dataclass(frozen=True, eq=False)
class Track:
    """An animation channel of a joint: `values` (n, 3) or (n, 4), quaternions x, y, z, w; cubic splines (3 n, ...)."""

    joint: int
    path: str
    times: np.ndarray
    values: np.ndarray
    interpolation: str = "LINEAR"


@dataclass(frozen=True, eq=False)
class Body:
    """A hierarchy of joints below a scaled node."""

    parents: Sequence[int]
    offsets: np.ndarray
    tracks: Sequence[Track]
    size: float = 1.0

    @property
    def moments(self) -> np.ndarray:
        """The keys of all tracks, and eighths of the gaps between them."""
        keys = np.unique(np.concatenate([track.times for track in self.tracks]))
        return np.append((keys[:-1, None] + np.diff(keys)[:, None] * np.arange(8) / 8).ravel(), keys[-1])

    def places(self, times: np.ndarray) -> np.ndarray:
        """Return the joint positions, shape (joints, times, 3), in Blender's axes."""
        with tempfile.TemporaryDirectory() as folder:
            worlds = File(self.write(Path(folder) / "body.glb")).worlds(0, times)
        x, y, z = np.moveaxis(worlds[: len(self.parents), :, :3, 3], -1, 0)
        return np.stack((x, -z, y), axis=-1)

    def write(self, path: Path) -> Path:
        """Write the body as a GLB."""
        made, count = Making(), len(self.parents)
        nodes = [{"name": f"Joint{joint}", "translation": list(self.offsets[joint])} for joint in range(count)]
        nodes.append({"name": "Armature", "scale": [self.size] * 3})
        for joint, parent in enumerate(self.parents):
            nodes[parent if parent >= 0 else count].setdefault("children", []).append(joint)
        made.json |= {"nodes": nodes, "scenes": [{"nodes": [count]}], "skins": [{"joints": list(range(count))}]}
        for track in self.tracks:
            made.channel(track.joint, track.path, made.times(track.times), track.values, track.interpolation)
        return made.write(path)


def turning(times: np.ndarray, angles: np.ndarray, axis: Sequence[float] = (0.0, 0.0, 1.0)) -> np.ndarray:
    """Return quaternions x, y, z, w of turns about an axis."""
    return np.column_stack((np.sin(angles / 2)[:, None] * np.asarray(axis), np.cos(angles / 2)))


def chain(count: int = 20, length: float = 0.09) -> tuple[list[int], np.ndarray]:
    """Return the parents and offsets of a chain of joints."""
    offsets = np.tile((0.0, length, 0.0), (count, 1))
    offsets[0] = (0.0, 0.1, 0.0)
    return list(range(-1, count - 1)), offsets


def mixed_rates(seconds: float = 2.0) -> Body:
    """Return a body with one fast joint keyed 30 times per second, and 19 others keyed 5 times per second."""
    parents, offsets = chain()
    slow, fast = np.arange(round(5 * seconds) + 1) / 5, np.arange(round(30 * seconds) + 1) / 30
    tracks = [
        Track(joint, "rotation", slow, turning(slow, 0.1 * np.sin(2 * slow + joint), (1, 0, 0)))
        for joint in range(20)
        if joint != 3
    ]
    tracks.append(Track(3, "rotation", fast, turning(fast, 0.25 * np.sin(2 * np.pi * 5 * fast + 0.3))))
    return Body(parents, offsets, tracks)


def soldier(size: float = 0.01) -> Body:
    """Return a body of 1.5 m in its own unit below a node that scales it, as in exports of Mixamo."""
    parents, offsets = PARENTS.tolist(), np.array([offset for _, offset in BONES.values()])
    times = np.arange(31) / 30
    tracks = [
        Track(joint, "rotation", times, turning(times, 0.3 * np.sin(3 * times + joint), (1, 0, 0)))
        for joint in range(len(parents))
    ]
    return Body(parents, offsets * 0.01 / size, tracks, size)


def curved(size: float = 1.0) -> Body:
    """Return a body with two keys per second and arbitrary tangents that cannot be guessed from the keys."""
    parents, offsets = chain(4, 0.4 / size)
    random, times = np.random.default_rng(4), np.array([0.0, 0.5, 1.1, 1.5, 2.0])
    tracks = []
    for joint in range(4):
        rows = np.zeros((5, 3, 4))
        rows[:, 1] = turning(times, 0.8 * np.sin(3 * times + joint), random.permutation(np.eye(3))[0])
        rows[:, [0, 2]] = random.normal(0.0, 0.8, (5, 2, 4))
        tracks.append(Track(joint, "rotation", times, rows.reshape(-1, 4), "CUBICSPLINE"))
    places = random.normal(0.0, 0.3 / size, (15, 3))
    return Body(parents, offsets, [*tracks, Track(0, "translation", times, places, "CUBICSPLINE")], size)
