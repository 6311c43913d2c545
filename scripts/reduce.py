"""Keep the few keys that a motion needs, in glTF and .blend files and recordings, without a window."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.cli.commands import launch

if __name__ == "__main__":
    launch(__file__)
