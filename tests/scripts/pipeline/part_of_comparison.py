"""A command that does a share of a comparison, for the tests of job bundles."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rigid_motion_batch.pipeline.comparison import ComparisonPlan
from rigid_motion_batch.pipeline.performing import Executor
from rigid_motion_batch.pipeline.running import Share, run
from rigid_motion_batch.pipeline.store import Store
from rigid_motion_batch.progress import Progress
from tests.scripts.pipeline.test_comparison import ABOUT, STAGE, planned

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("inputs", nargs="+", type=Path)
    parser.add_argument("--rates", required=True)
    parser.add_argument("--output", type=Path)
    parser.add_argument("--only")
    parser.add_argument("--part")
    options = parser.parse_args()
    number, of = map(int, options.part.split("/"))
    share, progress = Share(frozenset({options.only}), number, of), Progress()
    with Store(options.output, alone=False) as store, Executor() as executor:
        plan = ComparisonPlan(planned(*options.inputs, stage=STAGE, about=ABOUT), store)
        outcome = run(plan.reading, store, executor, share=share, progress=progress)
        plan.look_into()
        later = run(plan.tasks, store, executor, share=share, progress=progress)
    sys.exit(bool(outcome.failures or later.failures))
