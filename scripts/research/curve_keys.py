"""Recovery of keys: baked hand-keyed animations, and motion capture, reduced to curves and to lines.

    python scripts/research curve_keys pab_walk.fbx freebvh.bvh

The hand-made figure of 20 bones is that of the tests, with handles of a third of the segments and with Blender's
automatic handles. Blender exports everything with a key on every frame. Playback of files is computed with matrices,
independent of the program.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from research.glb_bodies import RADIUS_M, export
from research.glb_playing import animation_bytes, errors_of, opened
from research.studies import publish, report, study_parser
from rigid_motion.gltf import Options, reduce_file
from tests.animation.bones.hand_made import AUTOMATIC, THIRD, hand_made, keys_of
from tests.gltf.player import File

TOLERANCE_M = 1e-3  # metres
FRAMES_PER_S = 24
NOISE_SEEDS = range(3)
MOVED = ("translation", "rotation")


def keys_in(file: File, clip: str) -> dict[tuple[str, str], np.ndarray]:
    """Return the key times of each channel that moves, by node name and path."""
    nodes = file.json["nodes"]
    tracks = ((nodes[node].get("name"), path, times) for (node, path), (_, times, _) in file.tracks(clip).items())
    return {(name, path): times for name, path, times in tracks if path in MOVED and len(times) > 1}


def measure(original: Path, folder: Path, own: dict[str, np.ndarray] | None = None) -> dict[str, Any]:
    """Return the results of curves and lines for the clips of a file; `own` are the known key frames by node name."""
    output, files, sizes = folder / "smaller.glb", {}, [animation_bytes(original)]
    for curves in (False, True):
        reduce_file(original, output, Options(TOLERANCE_M, RADIUS_M, curves=curves))
        files[curves] = opened(output, None)
        sizes.append(animation_bytes(output))
    truth = opened(original, None)
    errors = errors_of(truth, files[True], RADIUS_M)
    clip = max((item["name"] for item in truth.json["animations"]), key=lambda name: len(keys_in(truth, name)))
    keys = keys_in(files[True], clip)
    result = {
        "samples": sum(map(len, keys_in(truth, clip).values())),
        "lines": sum(map(len, keys_in(files[False], clip).values())),
        "curves": sum(map(len, keys.values())),
        "animation_bytes": sizes,
        "error_mm": 1e3 * errors["at_frames"],
        "between_mm": 1e3 * errors["joints"],
    }
    if own is None:
        return result
    frames = {channel: np.round(times * FRAMES_PER_S) for channel, times in keys.items()}
    result["own"] = sum(len(own[name]) for name, _ in keys)
    result["on_own_frames"] = sum(int(np.isin(rows, own[name]).sum()) for (name, _), rows in frames.items())
    return result


def by_hand(handles: str, seed: int, folder: Path) -> dict[str, Any]:
    """Return the results for a hand-made animation."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    own, exported = keys_of(hand_made(handles, seed=seed)), folder / "hand.glb"
    bpy.ops.export_scene.gltf(filepath=str(exported), export_format="GLB")
    return {"handles": handles, "seed": seed, **measure(exported, folder, own)}


def recorded(path: Path, folder: Path) -> dict[str, Any]:
    """Return the results for a recording."""
    exported = folder / "recorded.glb"
    export(path, exported, as_avatar=False)
    return {"name": path.stem, **measure(exported, folder)}


def main(arguments: list[str] | None = None) -> int:
    """Measure all animations, and write the figures."""
    parser = study_parser("curve_keys", __doc__)
    parser.add_argument("bodies", type=Path, nargs="+", metavar="PATH", help="FBX and BVH files")
    options = parser.parse_args(arguments)
    hands, bodies = [], []
    with tempfile.TemporaryDirectory() as folder:
        for handles in (THIRD, AUTOMATIC):
            for seed in NOISE_SEEDS:
                report(f"handles: {handles}, {seed}")
                hands.append(by_hand(handles, seed, Path(folder)))
        for path in options.bodies:
            report(path.name)
            bodies.append(recorded(path, Path(folder)))
    figures = {"hands": hands, "bodies": bodies}
    return publish("curve_keys", figures, options, "...", Blender=bpy.app.version_string)
