"""Write a comparison as an Open Job Description bundle, for render farms to run."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.cli.commands import launch

if __name__ == "__main__":
    launch(__file__)
