"""Compare interpolation modes on recorded trajectories: the program that people run."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.cli.commands import launch

if __name__ == "__main__":
    launch(__file__)
