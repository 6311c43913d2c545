"""Send a recorded motion over a network in real time, show what arrives, or pass on what many send."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.cli.commands import launch

if __name__ == "__main__":
    launch(__file__)
