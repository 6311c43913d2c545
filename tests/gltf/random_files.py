"""Random glTF files with all kinds of animation, for Hypothesis: small, made from a few choices and a seed.

How to use it::

    @given(choices())
    def test_something(tmp_path_factory, choice):
        path = choice.made().write(tmp_path_factory.mktemp("random") / "made.glb")

    @example(Choice(seed=3, tree="alone", shows=("skin",)))   # Reproduces a failing example, as printed.

Each choice stands for a kind of file that occurs in practice. The first of each list is the plainest: examples shrink
towards it.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tests.gltf.making import Making
from tests.gltf.player import INSTANCES, composed, worlds

TREES = ("alone", "chain", "branches", "one place", "deep")

RESTS = ("plain", "turned", "zero", "thousandth", "uneven", "negative", "matrix")
"""Rest transforms of some of the nodes."""

SHOWS = ("mesh", "skin", "sword", "morph", "big morph", "instances", "whole numbers")
"""Kinds of geometry; a file may have several or none. Swords are far from their joints."""

MOTIONS = ("smooth", "still", "spin", "noise", "jumps")

INTERPOLATIONS = ("LINEAR", "STEP", "CUBICSPLINE", "wild", "any")
"""Wild: splines with tangents larger than the differences of values."""

SHARED = ("nothing", "a view with a mesh", "samplers", "accessors of clips", "accessors of pointers", "a mesh")

POINTERS = ("none", "beside", "above", "of weights", "of materials")

VENDORS = ("none", "of the file", "of a mesh", "of a primitive", "of a node")
"""Where an unknown extension names accessors."""

MOST_NODES = 16
"""No nodes are added beyond this number."""

PATHS = {"translation": 3, "rotation": 4, "scale": 3}

VENDOR = "ACME_hair"

BOX = np.array(np.meshgrid([-0.1, 0.1], [-0.1, 0.1], [-0.1, 0.1])).reshape(3, 8).T

NAMES = ("Walk", "Run", "Stand")


@dataclass(frozen=True)
class Choice:
    """The choices for a random file."""

    seed: int = 0
    tree: str = "alone"
    joints: int = 1
    exponent: int = 0
    """Power of ten of the size in metres."""

    rest: str = "plain"
    shows: tuple[str, ...] = ()
    moves: tuple[str, ...] = ("rotation",)
    motion: str = "smooth"
    interpolation: str = "LINEAR"
    keys: int = 30
    clips: int = 1
    shared: str = "nothing"
    pointers: str = "none"
    vendor: str = "none"

    def made(self) -> Making:
        return _File(self).made


def choices() -> st.SearchStrategy[Choice]:
    """Return a strategy for random files."""
    return st.builds(
        Choice,
        seed=st.integers(0, 10**6),
        tree=st.sampled_from(TREES),
        joints=st.integers(1, 5),
        exponent=st.integers(-3, 3),
        rest=st.sampled_from(RESTS),
        shows=st.sets(st.sampled_from(SHOWS), max_size=3).map(sorted).map(tuple),
        moves=st.sets(st.sampled_from(sorted(PATHS)), min_size=1).map(sorted).map(tuple),
        motion=st.sampled_from(MOTIONS),
        interpolation=st.sampled_from(INTERPOLATIONS),
        keys=st.integers(1, 60),
        clips=st.integers(1, 3),
        shared=st.sampled_from(SHARED),
        pointers=st.sampled_from(POINTERS),
        vendor=st.sampled_from(VENDORS),
    )


def bounds(numbers: np.ndarray) -> dict[str, Any]:
    return {"min": numbers.min(axis=0).tolist(), "max": numbers.max(axis=0).tolist()}


class _File:
    def __init__(self, choice: Choice) -> None:
        self.choice, self.made = choice, Making()
        self.random = np.random.default_rng(choice.seed)
        self.unit = 10.0**choice.exponent
        self.nodes: list[dict[str, Any]] = self.made.json["nodes"]
        self.meshes: list[dict[str, Any]] = []
        self.known_times: dict[bytes, int] = {}
        self._tree()
        self.joints = len(self.nodes)
        for kind in choice.shows:
            self._add_geometry(kind)
        if self.meshes:
            self.made.json["meshes"] = self.meshes
            if choice.shared == "a mesh":
                self._child(0, {"mesh": 0, "scale": [100.0] * 3})
        for clip in range(choice.clips):
            self._add_clip(clip)
        self._vendor()
        if choice.shared == "a view with a mesh" and self.meshes:
            self._one_view()

    # Nodes

    def _tree(self) -> None:
        choice, random = self.choice, self.random
        count = {"alone": 1, "deep": 12}.get(choice.tree, choice.joints)
        for node in range(count):
            apart = 0.0 if choice.tree == "one place" else 0.4 * self.unit
            self.nodes.append({"name": f"Joint {node}", "translation": (apart * random.normal(size=3)).tolist()})
            if node:
                parent = int(random.integers(0, node)) if choice.tree == "branches" else node - 1
                self.nodes[parent].setdefault("children", []).append(node)
        for node in self.nodes:
            if node is self.nodes[-1] or random.random() < 0.3:
                node |= self._rest()
        if choice.rest == "matrix":
            some = self.nodes[int(random.integers(0, count))]
            scale = self.random.uniform(0.5, 2.0, (1, 3))
            matrix = composed(np.array([some.pop("translation")]), self._turn((1,)), scale)
            some["matrix"] = matrix[0].T.ravel().tolist()

    def _rest(self) -> dict[str, Any]:
        """Return the members of a node with an unusual rest transform."""
        scales = {"zero": [0.0] * 3, "thousandth": [1e-3] * 3, "uneven": [0.5, 1.0, 2.0], "negative": [-1.0, 1.0, 1.0]}
        if self.choice.rest in scales:
            return {"scale": scales[self.choice.rest]}
        return {"rotation": self._turn().tolist()} if self.choice.rest == "turned" else {}

    def _turn(self, count: tuple[int, ...] = ()) -> np.ndarray:
        values = self.random.normal(size=(*count, 4))
        return values / np.linalg.norm(values, axis=-1, keepdims=True)

    # Meshes

    def _add_geometry(self, kind: str) -> None:
        primitive: dict[str, Any] = {"attributes": {}, "indices": self._indices()}
        mesh = {"primitives": [primitive]}
        self.meshes.append(mesh)
        places = BOX * self.unit
        if kind in ("skin", "sword"):
            self._skinned(primitive, 10.0 if kind == "sword" else 1.0)
            node = self._added({"mesh": len(self.meshes) - 1, "skin": len(self.made.json["skins"]) - 1})
            if self.random.random() < 0.5:
                self._morph(node, mesh, self.unit)
            return
        node = self._moved_node(new=kind == "whole numbers")
        if kind == "whole numbers":
            self.made.uses("KHR_mesh_quantization")
            self.made.json["extensionsRequired"] = ["KHR_mesh_quantization"]
            self.nodes[node]["scale"] = [self.unit] * 3
            kind = "i1" if self.random.random() < 0.5 else "<i2"
            padded = np.zeros((8, 4), kind)
            padded[:, :3] = np.rint(BOX / 0.1 * np.iinfo(kind).max)
            view = self.made.view(padded.tobytes(), byteStride=4 * padded.itemsize)
            bounded = self.made.described(padded[:, :3]) | bounds(padded[:, :3])
            self.made.json["accessors"].append({"bufferView": view, "normalized": True} | bounded)
            primitive["attributes"]["POSITION"] = len(self.made.json["accessors"]) - 1
        else:
            primitive["attributes"]["POSITION"] = self._places(places.astype("<f4"))
        if "mesh" in self.nodes[node]:
            node = self._child(node, {})
        self.nodes[node]["mesh"] = len(self.meshes) - 1
        if "morph" in kind:
            self._morph(node, mesh, self.unit * (80.0 if kind == "big morph" else 0.1))
        if kind == "instances":
            count = 3
            given = {
                "TRANSLATION": 5.0 * self.unit * self.random.normal(size=(count, 3)),
                "ROTATION": self._turn((count,)),
                "SCALE": self.random.uniform(0.5, 3.0, (count, 3)),
            }
            attributes = {name: self.made.accessor(values.astype("<f4")) for name, values in given.items()}
            self.nodes[node]["extensions"] = {INSTANCES: {"attributes": attributes}}
            self.made.uses(INSTANCES)

    def _moved_node(self, *, new: bool) -> int:
        """Return a joint, or a new child of one."""
        joint = int(self.random.integers(0, self.joints))
        if not new and self.random.random() < 0.5:
            return joint
        return self._child(joint, {"translation": (0.3 * self.unit * self.random.normal(size=3)).tolist()})

    def _child(self, node: int, content: dict[str, Any]) -> int:
        self.nodes.append({"name": f"Node {len(self.nodes)}", **content})
        self.nodes[node].setdefault("children", []).append(len(self.nodes) - 1)
        return len(self.nodes) - 1

    def _added(self, node: dict[str, Any]) -> int:
        self.nodes.append({"name": f"Node {len(self.nodes)}", **node})
        self.made.json["scenes"][0]["nodes"].append(len(self.nodes) - 1)
        return len(self.nodes) - 1

    def _places(self, places: np.ndarray) -> int:
        return self.made.accessor(places, **bounds(places))

    def _indices(self) -> int:
        return self.made.accessor(np.arange(6, dtype="<u2"))

    def _skinned(self, primitive: dict[str, Any], far: float) -> None:
        random, count, joints = self.random, 8, self.joints
        at_rest = worlds(self.nodes, {}, np.zeros(1))[:joints, 0]
        carriers = min(joints, 4)
        joint_numbers = np.zeros((count, 4), "u1" if random.random() < 0.5 else "<u2")
        joint_numbers[:, :carriers] = [random.permutation(joints)[:carriers] for _ in range(count)]
        shares = random.uniform(size=(count, 4)) ** 3 * (np.arange(4) < carriers)
        shares /= shares.sum(axis=1, keepdims=True)
        places = at_rest[joint_numbers[:, 0], :3, 3] + 0.3 * far * self.unit * random.normal(size=(count, 3))
        inverse = np.array(
            [
                np.linalg.inv(world) if abs(np.linalg.det(world)) > 1e-12 else composed(*[[part] for part in still])[0]
                for world in at_rest
                for still in [(-world[:3, 3], [0.0, 0.0, 0.0, 1.0], [1.0, 1.0, 1.0])]
            ]
        )
        kind = str(random.choice(["<f4", "u1", "<u2"]))
        whole = {} if kind == "<f4" else {"normalized": True}
        shares = shares.astype(kind) if kind == "<f4" else np.rint(shares * np.iinfo(kind).max).astype(kind)
        primitive["attributes"] |= {
            "POSITION": self._places(places.astype("<f4")),
            "JOINTS_0": self.made.accessor(joint_numbers),
            "WEIGHTS_0": self.made.accessor(shares, **whole),
        }
        matrices = self.made.accessor(np.swapaxes(inverse, 1, 2).reshape(joints, 16).astype("<f4"))
        skin = {"joints": list(range(joints)), "inverseBindMatrices": matrices}
        self.made.json.setdefault("skins", []).append(skin)

    def _morph(self, node: int, mesh: dict[str, Any], size: float) -> None:
        random, count = self.random, int(self.random.integers(1, 3))
        deltas = [(size * random.normal(size=(8, 3))).astype("<f4") for _ in range(count)]
        mesh["primitives"][0]["targets"] = [{"POSITION": self._places(delta)} for delta in deltas]
        mesh["weights"] = random.uniform(size=count).round(2).tolist()
        if random.random() < 0.3:
            self.nodes[node]["weights"] = random.uniform(size=count).round(2).tolist()

    # Clips

    def _add_clip(self, clip: int) -> None:
        choice, times = self.choice, self._times()
        for number, node in list(enumerate(self.nodes)):
            for path in choice.moves:
                if "matrix" not in node and self._is_moved(number, path):
                    motion = "still" if self.random.random() < 0.2 else choice.motion
                    self._channel(number, path, times, self._values(number, path, motion), clip)
            if targets := self._targets(node):
                self._channel(number, "weights", times, self._weights(targets), clip)
        if choice.pointers == "of materials" or len(self.made.json["animations"]) <= clip:
            self.made.json["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}]
            pointer = "/materials/0/pbrMetallicRoughness/baseColorFactor"
            values = np.abs(self._turn((choice.keys,)))
            self.made.pointer(pointer, self._accessor_of_times(times), values, "LINEAR", clip)
        self.made.json["animations"][clip]["name"] = NAMES[clip]
        if choice.shared == "accessors of clips" and clip:
            self._share_first_samplers(clip)

    def _is_moved(self, number: int, path: str) -> bool:
        if number >= self.joints and "skin" in self.nodes[number]:
            return self.random.random() < 0.2
        grows = path == "scale" and self.choice.rest in ("zero", "thousandth") and "scale" in self.nodes[number]
        return grows or self.random.random() < 0.7 or (number == 0 and len(self.nodes) == 1)

    def _targets(self, node: dict[str, Any]) -> int:
        return len(self.meshes[node["mesh"]]["primitives"][0].get("targets", [])) if "mesh" in node else 0

    def _times(self) -> np.ndarray:
        even = np.arange(self.choice.keys) / 30.0
        if self.random.random() < 0.6:
            return even + (0.5 if self.random.random() < 0.3 else 0.0)
        return np.cumsum(self.random.uniform(0.01, 0.2, self.choice.keys))

    def _accessor_of_times(self, times: np.ndarray) -> int:
        if times.tobytes() not in self.known_times:
            self.known_times[times.tobytes()] = self.made.times(times)
        return self.known_times[times.tobytes()]

    def _curve(self, width: int, motion: str) -> np.ndarray:
        """Return values of magnitude about 1, shape (keys, width)."""
        random, keys = self.random, self.choice.keys
        if motion == "still":
            return np.tile(random.normal(size=width) * (random.random() < 0.5), (keys, 1))
        if motion == "noise":
            return random.normal(size=(keys, width))
        if motion == "jumps":
            return np.repeat(random.normal(size=(keys // 5 + 1, width)), 5, axis=0)[:keys]
        phases = np.linspace(0.0, 1.0, keys)[:, None] * random.uniform(2.0, 9.0, width)
        return np.sin(phases + random.uniform(0.0, 6.0, width))

    def _values(self, number: int, path: str, motion: str) -> np.ndarray:
        node, curve = self.nodes[number], self._curve(3, motion)
        if path == "translation":
            return np.array(node.get("translation", [0.0] * 3)) + 0.3 * self.unit * curve
        if path == "scale":
            rest, grown = np.array(node.get("scale", [1.0] * 3)), np.abs(1.0 + 0.5 * curve)
            if motion == "still" and not curve.any():
                return np.tile(rest, (self.choice.keys, 1))
            if number < self.joints and self.choice.rest in ("zero", "thousandth") and "scale" in node:
                return rest + grown * np.linspace(0.0, 1.0, len(curve))[:, None]
            return rest * grown
        rest = Rotation.from_quat(node.get("rotation", [0.0, 0.0, 0.0, 1.0]))
        if motion == "spin":
            turns = np.linspace(0.0, 2.0 * np.pi * self.random.integers(1, 4), len(curve))
            curve = turns[:, None] * self._turn()[:3]
        return (rest * Rotation.from_rotvec(0.8 * curve)).as_quat()

    def _weights(self, targets: int) -> np.ndarray:
        small = 0.01 if self.random.random() < 0.3 else 1.0
        return small * (0.5 + 0.5 * np.clip(self._curve(targets, self.choice.motion), -1.0, 1.0))

    def _channel(self, node: int, path: str, times: np.ndarray, values: np.ndarray, clip: int) -> None:
        choice, random = self.choice, self.random
        kind = choice.interpolation
        if kind == "any":
            kind = str(random.choice(INTERPOLATIONS[:-1]))
        if random.random() < 0.1:
            times, values = times[:1], values[:1]
        if len(times) < 2 and kind in ("CUBICSPLINE", "wild"):
            kind = "LINEAR"
        if kind in ("CUBICSPLINE", "wild"):
            values = self._spline(times, values, kind == "wild")
        numbers = values.reshape(-1, 1) if path == "weights" else values
        kind = kind.replace("wild", "CUBICSPLINE")
        own = self._accessor_of_times(times)
        if path == "rotation" and kind != "CUBICSPLINE" and random.random() < 0.2:
            output = self.made.accessor(np.rint(numbers * 32767).astype("<i2"), normalized=True)
        else:
            output = self.made.accessor(numbers.astype("<f4"))
        if self._is_by_pointer(node, path):
            self.made.pointer(f"/nodes/{node}/{path}", own, output, kind, clip)
        else:
            self.made.channel(node, path, own, output, kind, clip)
        if choice.shared in ("samplers", "accessors of pointers") and path != "weights":
            self._share_sampler(node, path, clip)

    def _spline(self, times: np.ndarray, values: np.ndarray, wild: bool) -> np.ndarray:
        """Return for each key the tangent before, the value and the tangent after it, shape (3 n, width)."""
        slopes = np.gradient(values, times, axis=0)
        rows = np.stack((slopes, values, slopes), axis=1)
        if wild:
            size = 3.0 * np.abs(values).max() / np.diff(times).mean()
            rows[:, [0, 2]] = size * self.random.normal(size=(len(times), 2, values.shape[1]))
        return rows.reshape(3 * len(times), -1)

    def _is_by_pointer(self, node: int, path: str) -> bool:
        pointers = self.choice.pointers
        if pointers == "above":
            return "children" in self.nodes[node] and self.random.random() < 0.7
        return (pointers == "beside" and self.random.random() < 0.4) or (pointers == "of weights" and path == "weights")

    def _share_sampler(self, node: int, path: str, clip: int) -> None:
        """Let the last sampler move another, new node as well."""
        if len(self.nodes) > MOST_NODES:
            return
        animation = self.made.json["animations"][clip]
        other = self._child(node, {"translation": (0.1 * self.unit * self.random.normal(size=3)).tolist()})
        number = animation["channels"][-1]["sampler"]
        if self.choice.shared == "samplers":
            animation["channels"].append({"sampler": number, "target": {"node": other, "path": path}})
        else:
            same = animation["samplers"][number]
            pointer = f"/nodes/{other}/{path}"
            self.made.pointer(pointer, same["input"], same["output"], same["interpolation"], clip)

    def _share_first_samplers(self, clip: int) -> None:
        """Let a clip share the samplers of the first clip, for some of the same targets."""
        first, second = self.made.json["animations"][0], self.made.json["animations"][clip]
        for channel in second["channels"]:
            for other in first["channels"]:
                if other["target"] == channel["target"] and self.random.random() < 0.7:
                    second["samplers"][channel["sampler"]] = dict(first["samplers"][other["sampler"]])

    # Other content of files

    def _vendor(self) -> None:
        choice = self.choice
        if choice.vendor == "none":
            return
        named = {"strands": self.made.accessor(self.random.normal(size=(5, 3)).astype("<f4"))}
        animation = self.made.json["animations"][0]
        if animation["samplers"] and self.random.random() < 0.5:
            named["sways"] = {"at": animation["samplers"][0]["input"], "to": [animation["samplers"][0]["output"]]}
        where: dict[str, Any] = self.made.json
        if choice.vendor in ("of a mesh", "of a primitive") and self.meshes:
            where = self.meshes[0] if choice.vendor == "of a mesh" else self.meshes[0]["primitives"][0]
        elif choice.vendor == "of a node":
            where = self.nodes[-1]
        where.setdefault("extensions", {})[VENDOR] = named
        self.made.uses(VENDOR)

    def _one_view(self) -> None:
        """Put animation data and the first mesh into one view that is the whole buffer."""
        json = self.made.json
        whole = {"buffer": 0, "byteLength": len(self.made.buffers[0])}
        json["bufferViews"].append(whole)
        animated = {
            sampler[name]
            for animation in json["animations"]
            for sampler in animation["samplers"]
            for name in ("input", "output")
        }
        for number in animated | {self.meshes[0]["primitives"][0]["attributes"]["POSITION"]}:
            accessor = json["accessors"][number]
            view = json["bufferViews"][accessor["bufferView"]]
            accessor |= {"bufferView": len(json["bufferViews"]) - 1, "byteOffset": view["byteOffset"]}
