"""Reproduce the paper: its figures, its table and its example, from this program."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rigid_motion_batch.commands import launch

if __name__ == "__main__":
    launch(__file__)
