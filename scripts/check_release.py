"""Look whether all is there that a release on extensions.blender.org needs, and say what is not."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.commands import launch

if __name__ == "__main__":
    launch(__file__)
