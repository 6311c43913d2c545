"""Animations of GLB files made smaller: reduce, gltf-transform and gltfpack side by side.

    python scripts/research glb_sizes walk.fbx run.bvh --tools FOLDER

`--tools` is the folder with the programs `gltfpack` and `gltf-transform`, as `npm install gltfpack
@gltf-transform/cli` puts them into `node_modules/.bin`; each that is missing is left out. What the files show is worked
out by matrices, with nothing of the program.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from research.studies import publish, report, study_parser
from rigid_motion.gltf import Options, reduce_file
from rigid_motion.gltf.accessors import stored_size
from rigid_motion.gltf.documents import read_document
from rigid_motion_batch.analysis.metrics import geometric_mean
from tests.gltf.player import File, eighths

HEIGHT, RADIUS = 1.7, 0.03  # metres
TOLERANCES = (1e-4, 1e-3, 5e-3)  # metres

TOOLS = {
    "gltf-transform `resample`": ("gltf-transform", "resample", "{0}", "{1}"),
    "gltfpack `-noq`": ("gltfpack", "-i", "{0}", "-o", "{1}", "-kn", "-noq"),
    "gltfpack, its defaults": ("gltfpack", "-i", "{0}", "-o", "{1}", "-kn"),
}
"""Programs beside, with the arguments that make one file another."""


def points(file: File, clip: str | None, times: np.ndarray, names: list[str]) -> np.ndarray:
    """Return where the heads of nodes and points beside them are in the world, shape (nodes, times, 7, 3)."""
    numbers = {node.get("name"): number for number, node in enumerate(file.json["nodes"])}
    worlds = file.worlds(clip, times)[[numbers[name] for name in names]]
    axes = np.swapaxes(worlds[..., :3, :3], -1, -2)
    axes = RADIUS * axes / np.linalg.norm(axes, axis=-1, keepdims=True)
    heads = worlds[..., None, :3, 3]
    return np.concatenate((heads, heads + axes, heads - axes), axis=-2)


def errors_of(original: File, smaller: File, clip: str) -> np.ndarray:
    """Return how far each node is off at eighths of the gaps between the keys of both files, shape (nodes, times).

    Without the clip it rests.
    """
    kept = clip if any(animation["name"] == clip for animation in smaller.json["animations"]) else None
    times = eighths(np.union1d(original.moments(clip), smaller.moments(kept)))
    before, after = ({node.get("name") for node in file.json["nodes"]} for file in (original, smaller))
    names = sorted((before & after) - {None})
    there, truth = points(smaller, kept, times, names), points(original, clip, times, names)
    return np.linalg.norm(there - truth, axis=-1).max(axis=-1)


def animation_bytes(path: Path) -> int:
    """Return the bytes of all keys of a file: times and values."""
    document = read_document(path, in_memory=True)
    samplers = [sampler for animation in document.json["animations"] for sampler in animation["samplers"]]
    return sum(
        stored_size(document.json, it) for it in {sampler[side] for sampler in samplers for side in ("input", "output")}
    )


def beside(original: Path, smaller: Path, tool: str) -> dict[str, Any]:
    """Return what a tool made of a file, with the errors of all clips."""
    files = File(original), File(smaller)
    errors = np.concatenate([errors_of(*files, clip["name"]).ravel() for clip in files[0].json["animations"]])
    return {
        "tool": tool,
        "animation_bytes": animation_bytes(smaller),
        "share": animation_bytes(smaller) / animation_bytes(original),
        "file_bytes": smaller.stat().st_size,
        "error_mm": 1e3 * errors.max(),
        "within_tenth": (errors <= 1e-4).mean(),
        "within_one": (errors <= 1e-3).mean(),
    }


def export(path: Path, output: Path) -> None:
    """Import a body with Blender, scale it to `HEIGHT`, and export it with a key on every frame."""

    def load(scale: float) -> bpy.types.Object:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        if path.suffix.lower() == ".fbx":
            bpy.ops.import_scene.fbx(filepath=str(path), global_scale=scale)
        else:
            options = {"use_fps_scale": False, "update_scene_fps": True, "update_scene_duration": True}
            bpy.ops.import_anim.bvh(filepath=str(path), global_scale=scale, **options)
        return next(obj for obj in bpy.data.objects if obj.type == "ARMATURE")

    rig = load(1.0)
    heads = np.array([rig.matrix_world @ bone.head_local for bone in rig.data.bones])
    load(HEIGHT / float(np.ptp(heads, axis=0).max()))
    ends = [frame for action in bpy.data.actions for frame in action.frame_range]
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = int(min(ends)), int(max(ends))
    bpy.ops.export_scene.gltf(filepath=str(output), export_format="GLB")


def measure(path: Path, tools: Path | None, folder: Path) -> list[dict[str, Any]]:
    """Return what the exporter and each tool make of a body."""
    exported, output = folder / f"{path.stem}.glb", folder / f"{path.stem}-smaller.glb"
    export(path, exported)
    result = [beside(exported, exported, "exported by Blender")]
    for tolerance in TOLERANCES:
        reduce_file(exported, output, Options(tolerance, RADIUS))
        result.append(beside(exported, output, f"`reduce --tolerance {1e3 * tolerance:g}mm`"))
    for name, (program, *given) in TOOLS.items():
        if tools and (found := shutil.which(program, path=str(tools))):
            arguments = [argument.format(exported, output) for argument in given]
            subprocess.run([found, *arguments], check=True, capture_output=True)
            result.append(beside(exported, output, name))
    return result


def main(arguments: list[str] | None = None) -> int:
    """Measure, and write the figures."""
    parser = study_parser("glb_sizes", __doc__)
    parser.add_argument("bodies", type=Path, nargs="+", metavar="PATH", help="FBX and BVH files")
    parser.add_argument("--tools", type=Path, metavar="FOLDER", help="where gltfpack and gltf-transform are")
    options = parser.parse_args(arguments)
    clips = []
    with tempfile.TemporaryDirectory() as folder:
        for path in options.bodies:
            report(path.name)
            clips.append({"name": path.stem, "tools": measure(path, options.tools, Path(folder))})
    shares = np.array([[row["share"] for row in clip["tools"]] for clip in clips])
    means = dict(zip((row["tool"] for row in clips[0]["tools"]), geometric_mean(shares), strict=True))
    given = f"...{' --tools ...' if options.tools else ''}"
    return publish("benchmark_glb", {"clips": clips, "means": means}, options, given, Blender=bpy.app.version_string)
