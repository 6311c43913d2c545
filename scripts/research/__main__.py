"""Run a study or a benchmark of this checkout: `python scripts/research NAME ...`; `--help` lists them."""

import sys
from pathlib import Path

sys.path[:0] = [str(Path(__file__).resolve().parents[1]), str(Path(__file__).resolve().parents[2])]

from rigid_motion_batch.cli.commands import launch_research
from rigid_motion_batch.command_line import own_arguments

if __name__ == "__main__":
    launch_research(own_arguments(str(Path(__file__).parent)))
