"""What Reduce Keys to Poses leaves of recordings, beside Blender's own Decimate of the Graph Editor."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.commands import launch

if __name__ == "__main__":
    launch(__file__)
