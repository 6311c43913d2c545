"""What many clips cost: how much two workers are quicker than one, how much is Blender's rendering, and the memory."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.commands import launch

if __name__ == "__main__":
    launch(__file__)
