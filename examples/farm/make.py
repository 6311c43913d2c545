"""Three takes of a tool, compared as a job of several tasks that a render farm can run."""

from __future__ import annotations

import json
import sys
import tempfile
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "addon"), str(ROOT / "scripts")]

from examples import staging
from examples.stills import render_still
from research.making.motions import MOTIONS
from research.making.tracking import table, tick, track
from rigid_motion_batch import palette
from rigid_motion_batch.cli import job_bundle
from rigid_motion_batch.scenes import captions
from rigid_motion_batch.scenes.materials import ink, surface

TAKES = {"drill": "screw", "probe": "pivot", "toss": "throw"}
"""The name of each take, and its motion."""

SEED, SECONDS = 5, 2.0

RATES, PARTS = "5,10", "3"
"""Options of the job in the picture: keys per second, and tasks per step."""

PICTURE = 960, 300

WIDTH, STEP, CARD, SQUARE = 10.0, 1.56, (1.46, 1.3), 0.2
"""Width of the picture, distance between cards, width and height of a card, and width of a task's square."""


def main(arguments: list[str] | None = None) -> None:
    """Write the takes, and render the picture if asked to."""
    options = staging.parse(HERE, __doc__, arguments)
    for number, (name, motion) in enumerate(TAKES.items()):
        rng = np.random.default_rng((SEED, number))
        times = tick(rng, SECONDS)
        poses = track(rng, MOTIONS[motion].poses, times)
        staging.put(options.output, f"takes/{name}.csv", table(times, poses))
    if options.picture:
        picture(options.output / "takes", options.output)


def picture(takes: Path, output: Path) -> None:
    """Draw the steps of the job: a card for each step, with a square for each task."""
    counts = tasks_of_steps(takes)
    scene = staging.begin(1)
    scene.render.resolution_x, scene.render.resolution_y = PICTURE
    camera = staging.look((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), WIDTH)
    card, square = surface("Card", palette.DARK.card), ink("Task", staging.RIGID)
    left = -STEP * (len(counts) - 1) / 2.0
    for number, (step, count) in enumerate(counts.items()):
        x = left + STEP * number
        lay(captions.card(step, *CARD, card, 0.06), x, 0.0, 0.0)
        staging.write(camera, step, (x - 0.64) / WIDTH, 0.036, 0.022, palette.DARK.ink)
        for task in range(count):
            row, column = divmod(task, 3)
            mesh = captions.card("Task", SQUARE, SQUARE, square, 0.04)
            lay(mesh, x - 0.54 + 0.3 * column, 0.05 - 0.3 * row, 0.1)
    heading = f"{len(TAKES)} takes, {sum(counts.values())} tasks"
    staging.write(camera, heading, (left - CARD[0] / 2.0) / WIDTH, 0.1, 0.03, palette.DARK.ink)
    says = "A card is a step, which waits for the one before it. A square is a task, which any machine may take."
    staging.write(camera, says, (left - CARD[0] / 2.0) / WIDTH, -0.11, 0.02, palette.DARK.faint)
    render_still(scene, output / "farm.png")


def lay(mesh: bpy.types.Mesh, x: float, y: float, height: float) -> None:
    """Add a flat mesh to the scene at a position."""
    obj = bpy.data.objects.new(mesh.name, mesh)
    obj.location = (x, y, height)
    bpy.context.scene.collection.objects.link(obj)


def tasks_of_steps(takes: Path) -> dict[str, int]:
    """Return the names of the job's steps, in order, and the number of tasks of each."""
    with tempfile.TemporaryDirectory() as scratch:
        job = Path(scratch) / "job"
        recordings = [str(path) for path in sorted(takes.glob("*.csv"))]
        with redirect_stdout(StringIO()):  # It prints a command for this temporary job.
            own = ["--parts", PARTS, "--output", f"{scratch}/out", "--bundle", str(job)]
            job_bundle.main([*recordings, "--rates", RATES, *own])
        template = json.loads((job / "template.json").read_text(encoding="utf-8"))
    return {step["name"]: count_of(step) for step in template["steps"]}


def count_of(step: dict) -> int:
    """Return the number of tasks of a step in a job template: its parameter has the range 1 to that number."""
    (part,) = step["parameterSpace"]["taskParameterDefinitions"]
    return int(part["range"].removeprefix("1-"))


if __name__ == "__main__":
    staging.run(main)
