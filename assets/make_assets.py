"""Make the files in this folder: the clips (*.csv), the models (models.blend) and a low-poly drill (drill.npz).

Every run makes the same files.

The clips need only NumPy. The models also need Blender's Python module, in the oldest version that the program
supports, because an older Blender cannot open files of a newer one. With another version, or none, they are kept.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np

ASSETS = Path(__file__).resolve().parent
sys.path[:0] = [str(ASSETS.parent / folder) for folder in ("addon", "scripts")]

from research.making.motions import GRIP, HOLD, MOTIONS, OTHER_MOTIONS, held_in
from research.making.tracking import STAMP_ERROR, noisy, table, table_of_devices, tick, track

SEED = 2021
MODELS_BLENDER = (4, 5)
DRILL_TRIANGLES = 1500


def clip(name: str) -> str:
    """Return the CSV text of a clip: seconds, metres, and quaternions with the scalar last."""
    motion = (MOTIONS | OTHER_MOTIONS)[name]
    rng = np.random.default_rng((SEED, zlib.crc32(name.encode())))
    times = tick(rng, motion.duration)
    if name == HOLD:
        # One tracking system sees both markers at the same moment, each with its own noise.
        hand = motion.poses(rng, times + STAMP_ERROR * rng.standard_normal(len(times)))
        devices = {"hand": hand, "tool": held_in(hand, GRIP)}
        return table_of_devices(times, {name: noisy(rng, poses, times) for name, poses in devices.items()})
    poses = track(rng, motion.poses, times)
    return table(times, poses)


def write(path: Path, fill: Callable[[Path], None]) -> None:
    """Fill a file in a temporary folder next to its destination, and move it into place only when it is complete."""
    with tempfile.TemporaryDirectory(prefix=".making-", dir=path.parent) as folder:
        whole = Path(folder) / path.name
        fill(whole)
        whole.replace(path)
    print(f"{path}  {path.stat().st_size / 1000:.0f} kB")


def main(arguments: list[str] | None = None) -> None:
    """Write all assets."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--output", type=Path, default=ASSETS, metavar="FOLDER", help="where to (default: this folder)")
    output = parser.parse_args(arguments).output
    output.mkdir(parents=True, exist_ok=True)

    for name in (*MOTIONS, *OTHER_MOTIONS):
        text = clip(name)
        write(output / f"{name}.csv", lambda path, text=text: path.write_text(text, encoding="utf-8", newline="\n"))

    try:
        import bpy
    except ImportError:
        print("models.blend is left as it is: there is no bpy here (pip install bpy==4.5.15, with Python 3.11)")
        return
    if bpy.app.version[:2] != MODELS_BLENDER:
        print(f"models.blend is left as it is: older versions cannot open what {bpy.app.version_string} writes")
        return
    from research.making.models import write_models
    from rigid_motion_batch.scenes.subject import simplified

    write(output / "models.blend", write_models)
    write(output / "drill.npz", lambda path: np.savez_compressed(path, **simplified("drill", DRILL_TRIANGLES)))


if __name__ == "__main__":
    main()
