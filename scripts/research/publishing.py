"""The command line that all studies share, and where their figures go."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from research.pages import ROOT, write_figures
from rigid_motion_batch.command_line import Parser, parser_of


def study_parser(name: str, description: str) -> Parser:
    """Return the parser of a study, with the option where to write."""
    parser = parser_of(f"research {name}", description)
    parser.add_argument(
        "--root", type=Path, default=ROOT, metavar="FOLDER", help="write FOLDER/docs/figures (this checkout)"
    )
    return parser


def publish(name: str, figures: dict[str, Any], options: argparse.Namespace, *given: object, **versions: object) -> int:
    """Write figures, made by a study with these arguments, and return the exit code."""
    study = {"benchmark_glb": "glb_sizes"}.get(name, name)
    command = " ".join(["python scripts/research", study, *map(str, given)])
    print(write_figures(name, figures, command, options.root, **versions))
    return 0


def say(text: str) -> None:
    """Tell what is measured now."""
    print(f"{text} ...", file=sys.stderr, flush=True)
