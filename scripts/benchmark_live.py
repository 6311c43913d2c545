"""What live in-betweens cost in Blender, beside its own baking and its own playback, in one run on this machine."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.commands import launch

if __name__ == "__main__":
    launch(__file__)
