"""Benchmark of GLB animation sizes: reduce, gltf-transform and gltfpack compared.

    python scripts/research glb_sizes --hand-made walk.fbx fox.glb --mocap run.bvh --avatars run.bvh --tools FOLDER

GLB files are used as they are; all others are exported by Blender, avatars with a skin and an expression. `--tools` is
the folder with the programs `gltfpack` and `gltf-transform`, which `npm install gltfpack @gltf-transform/cli` puts into
`node_modules/.bin`; without it, these programs and every compressed file that needs their decoder are left out.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout
from functools import cache, partial
from io import StringIO
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from research.glb_bodies import HEIGHT_M, RADIUS_M, export
from research.glb_playing import animation_bytes, errors_of, opened, size_of
from research.studies import publish, report, study_parser
from rigid_motion_batch.analysis.metrics import geometric_mean
from rigid_motion_batch.cli import reduce

TOLERANCES_M = (1e-4, 1e-3, 5e-3)

WAYS = ("", " --curves", " --meshopt", " --meshopt --feet-may-slide --channels moving")
"""Options of reduce."""

NEEDS_TOOLS = " --meshopt"

GROUPS = {"hand_made": "Hand-made", "mocap": "Motion capture", "avatars": "Avatars"}

EXPORTED, RESAMPLED = "as exported", "gltf-transform `resample`"
NOT_PACKED, DEFAULTS = "gltfpack `-noq -af 0`", "gltfpack `-cc`, its defaults"

KINDS = ("animation", "file", "brotli")
"""Counts of bytes: all keys, the whole file, and the file as compressed by a web server."""

RATE_KEPT = {"-cc": "gltfpack `-cc -af 0`", "-cz": "gltfpack `-cz -af 0`"}
"""gltfpack's options for compressed animations: EXT_meshopt_compression and the newer KHR_meshopt_compression."""

ROTATION_BITS, TRANSLATION_BITS = range(4, 17), range(6, 25)
"""Valid values of gltfpack's `-ar` and `-at`."""


class Measured:
    """A body, and the results of each program for it."""

    def __init__(self, path: Path, group: str, tools: Path | None, folder: Path) -> None:
        self.tools, self.output = tools, folder / "smaller.glb"
        self.exported = folder / "exported.glb"
        if path.suffix.lower() == ".glb":
            shutil.copyfile(path, self.exported)
        else:
            export(path, self.exported, as_avatar=group == "avatars")
        self.original = opened(self.exported, tools)
        self.scale = size_of(self.original) / HEIGHT_M
        self.cheapest = cache(self._cheapest)

    def ways(self) -> Iterator[tuple[str, Callable[[], dict[str, Any]]]]:
        """Yield the names of all rows, with functions that make them."""
        yield EXPORTED, partial(self._row, self.exported)
        for tolerance in TOLERANCES_M:
            within = f"within {1e3 * tolerance:g} mm"
            for way in WAYS:
                if self.tools or NEEDS_TOOLS not in way:
                    yield f"reduce{way}, {within}", partial(self._reduced, way, tolerance)
            for flag, name in RATE_KEPT.items() if self.tools else ():
                yield f"{name}, {within}", partial(self._packed_within, flag, tolerance)
        if self.tools:
            yield NOT_PACKED, partial(self._packed, "-noq", "-af", 0)
            yield DEFAULTS, partial(self._packed, "-cc")
            yield RESAMPLED, self._resampled

    def _row(self, path: Path) -> dict[str, Any]:
        import brotli  # Needed only for figures: the tests run without it.

        content = path.read_bytes()
        errors = errors_of(self.original, opened(path, self.tools), RADIUS_M * self.scale)
        millimetres = {name: None if off is None else 1e3 * off / self.scale for name, off in errors.items()}
        sizes = {"animation": animation_bytes(path), "file": len(content), "brotli": len(brotli.compress(content))}
        return {**sizes, **millimetres}

    def _reduced(self, way: str, tolerance: float) -> dict[str, Any]:
        """Return a row for reduce; empty if reduce leaves the file alone because it would grow."""
        self.output.unlink(missing_ok=True)
        given = {"--tolerance": tolerance * self.scale, "--radius": RADIUS_M * self.scale}
        lengths = [part for name, length in given.items() for part in (name, f"{1e3 * length:.6f}mm")]
        arguments = [str(self.exported), "--output", str(self.output), "--overwrite", "--jobs", "0"]
        with redirect_stdout(StringIO()):
            code = reduce.main([*arguments, *lengths, *way.split()])
        assert code == 0
        return self._row(self.output) if self.output.exists() else {}

    def _packed_within(self, flag: str, tolerance: float) -> dict[str, Any]:
        """Return a row for gltfpack with all frames, and the bits that need the fewest bytes; empty if none suffice."""
        bits = self.cheapest(tolerance)
        return {} if bits is None else self._packed(flag, *_frame_options(bits)) | {"bits": "{}/{}".format(*bits)}

    def _packed(self, *options: object) -> dict[str, Any]:
        self._pack(*options)
        return self._row(self.output)

    def _pack(self, *options: object) -> None:
        self._run("gltfpack", "-i", self.exported, "-o", self.output, "-kn", *options)

    def _resampled(self) -> dict[str, Any]:
        self._run("gltf-transform", "resample", self.exported, self.output)
        return self._row(self.output)

    def _run(self, program: str, *arguments: object) -> None:
        found = shutil.which(program, path=str(self.tools))
        assert found, f"{program} is not in {self.tools}"
        subprocess.run([found, *map(str, arguments)], check=True, capture_output=True)

    def _cheapest(self, tolerance: float) -> tuple[int, int] | None:
        """Return the bits of rotations and translations with the fewest bytes within a tolerance, or None."""
        largest = tolerance * self.scale

        def is_within(*bits: int) -> bool:
            self._pack("-cc", *_frame_options(bits))
            errors = errors_of(self.original, opened(self.output, self.tools), RADIUS_M * self.scale, largest)
            return max(error or 0.0 for error in errors.values()) <= largest

        def size(bits: tuple[int, int]) -> int:
            self._pack("-cc", *_frame_options(bits))
            return animation_bytes(self.output)

        def least(of: range, fits: Any) -> int | None:
            below, above = of.start - 1, of.stop
            while above - below > 1:
                middle = (below + above) // 2
                below, above = (below, middle) if fits(middle) else (middle, above)
            return above if above < of.stop else None

        if not is_within(ROTATION_BITS[-1], TRANSLATION_BITS[-1]):
            return None
        fewest = least(ROTATION_BITS, lambda bits: is_within(bits, TRANSLATION_BITS[-1]))
        found = []
        for rotation in range(fewest or ROTATION_BITS.stop, ROTATION_BITS.stop)[:3]:
            translation = least(TRANSLATION_BITS, lambda bits, rotation=rotation: is_within(rotation, bits))
            found += [(rotation, translation)] if translation else []
        return min(found, key=size, default=None)


def _frame_options(bits: tuple[int, ...]) -> tuple[object, ...]:
    """Return gltfpack's options to keep all frames, with these bits for rotations and translations."""
    return ("-af", 0, "-ar", bits[0], "-at", bits[1])


def means(clips: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return geometric means over clips of the fraction of the exported bytes that each program leaves."""
    result = []
    for rows in zip(*(clip["tools"] for clip in clips), strict=True):
        known = [(row, clip["tools"][0]) for row, clip in zip(rows, clips, strict=True) if "animation" in row]
        shares = {
            kind: float(geometric_mean(np.array([[row[kind] / first[kind]] for row, first in known]))[0])
            for kind in KINDS
            if known
        }
        result.append({"tool": rows[0]["tool"], "clips": len(known), **shares})
    return result


def beside(clips: list[dict[str, Any]]) -> dict[str, dict[str, dict[str, float]]]:
    """Return ratios of reduce's bytes to gltfpack `-cc`'s at the same tolerance: geometric means over clips."""
    result: dict[str, dict[str, dict[str, float]]] = {}
    for tolerance in TOLERANCES_M:
        within = f"within {1e3 * tolerance:g} mm"
        for way in WAYS:
            found: dict[str, list[float]] = {}
            for clip in clips:
                rows = {row["tool"]: row for row in clip["tools"]}
                ours, theirs = (rows.get(f"{name}, {within}", {}) for name in (f"reduce{way}", RATE_KEPT["-cc"]))
                for kind in KINDS if "file" in ours and "file" in theirs else ():
                    found.setdefault(kind, []).append(ours[kind] / theirs[kind])
            if found:
                ratios = {kind: float(geometric_mean(np.array(own)[:, None])[0]) for kind, own in found.items()}
                result.setdefault(within, {})[f"reduce{way}"] = ratios
    return result


def main(arguments: list[str] | None = None) -> int:
    """Measure all files, and write the figures."""
    parser = study_parser("glb_sizes", __doc__)
    for group, title in GROUPS.items():
        option = f"--{group.replace('_', '-')}"
        parser.add_argument(option, type=Path, nargs="+", default=[], metavar="PATH", help=f"{title}: FBX, BVH, GLB")
    parser.add_argument("--tools", type=Path, metavar="FOLDER", help="where gltfpack and gltf-transform are")
    options = parser.parse_args(arguments)
    versions = {"Blender": bpy.app.version_string}
    if options.tools:
        said = subprocess.run([options.tools / "gltfpack", "-v"], capture_output=True, text=True).stdout
        versions["gltfpack"] = said.split()[-1]
    groups = {}
    for group, title in GROUPS.items():
        clips: list[dict[str, Any]] = []
        for path in getattr(options, group):
            report(f"{title}: {path.name}")
            with tempfile.TemporaryDirectory() as folder:
                ways = Measured(path, group, options.tools, Path(folder)).ways()
                rows = [{"tool": tool, **make()} for tool, make in ways]
            clips.append({"name": path.stem, "tools": rows})
            groups[title] = {"clips": clips, "means": means(clips), "beside": beside(clips)}
            publish("benchmark_glb", {"groups": groups}, options, "...", **versions)
    return 0
