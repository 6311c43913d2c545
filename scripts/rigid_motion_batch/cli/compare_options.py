"""The options of a comparison, for compare.py and job_bundle.py, with their help texts."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable
from dataclasses import fields

from rigid_motion.motion import MODES
from rigid_motion_batch.analysis.choices import (
    EVERYWHERE,
    JOINT_RADIUS_M,
    RIGID_RADIUS_M,
    Budget,
    Choice,
    Tolerance,
    Uniform,
    distinct,
    read_radii,
)
from rigid_motion_batch.analysis.modes import COMPARED, REFERENCE
from rigid_motion_batch.command_line import bounded, did_you_mean, folder_path, not_empty, parser_of, whole
from rigid_motion_batch.palette import THEMES
from rigid_motion_batch.pipeline.comparison_steps import STAGES
from rigid_motion_batch.places import ASSETS, from_here
from rigid_motion_batch.recordings import files_of
from rigid_motion_batch.recordings.options import add_clean_option, add_reading_options, reading_options
from rigid_motion_batch.scenes.settings import ANTIALIASING, ENGINES, SceneSettings

DESCRIPTION = """Compare interpolation modes on recorded trajectories.

The program keeps only a few keys a second of each recording, evenly spaced or where the motion needs them. Each mode
recomputes the in-betweens. The program measures their errors, and shows them in a report and in a video with the modes
side by side. Without INPUT it compares the recordings in assets/.
"""

RATES = "5,10,15,20"
"""Default rates, in keys per second."""

STREAM_MODES = tuple(mode for mode in MODES if mode not in COMPARED)

SPOKEN_OF = "verdict"
"""The value of --films for films of the choice of keys that the verdict is about."""

ALL, DISTINCT = "all", "distinct"
"""The values of --modes for `COMPARED`, with a film lane for each mode, or for each distinct motion."""

SCRIPT = "compare.py"

EPILOG = """
inputs:
  tables with named columns (t,x,y,z,qx,qy,qz,qw and the like, in any order), TUM, KITTI, Motive, Vicon, Qualisys,
  COLMAP, JSON and more (docs/csv.md), BVH, FBX, glTF, .blend; a folder stands for the recordings in it. FILE:BODY takes
  one body of several, FILE:* all of them. A BVH, FBX or glTF is a whole body, FILE:JOINT one joint of it; without a
  skeleton, an FBX or glTF is the objects that move in it. In a .blend, a body is an object (FILE.blend:OBJECT), a bone
  of a rig (FILE.blend:OBJECT/BONE) or a whole rig (FILE.blend:RIG).

examples:
  python scripts/compare.py
  python scripts/compare.py hand_left.csv hand_right.csv --axes unity --output renders/hands
  python scripts/compare.py log.csv:left --columns t=when,device=who --time-unit ms --scale 0.01
  python scripts/compare.py take.csv --rates 7.5,15 --modes lerp_slerp,dq_sclerp --slow-motion 4
  python scripts/compare.py dance.bvh walk.fbx fox.glb shot.blend:Rig
  python scripts/compare.py dances/ --tolerance 1cm --shared --no-video
  python scripts/compare.py take.csv --budget 5,10 --rates 10
  python scripts/compare.py take.csv --against mine.csv
  python scripts/compare.py take.csv --against lerp_slerp

keys:
  By default, --rates keys a second are kept, evenly spaced in time and the same for every mode. --tolerance and
  --budget also count the keys that each mode needs to be as good as Blender's own curves, which takes up to two seconds
  for every 100 samples; --rates adds evenly spaced keys for comparison.

output:
  A table of errors, one sentence, and as the last line the path of OUTPUT/report.html; everything else goes to standard
  error. OUTPUT/metrics.csv has all numbers, and every clip and choice of keys has a folder with its keys and motions.
  An earlier run of the same recordings is replaced, and finished work is not repeated. docs/comparing.md describes each
  file, and how errors are measured.

Exit code: 0 done, 1 some recordings or videos could not be done, 2 nothing could be done, or a wrong option, 130
stopped by Ctrl-C, and 143 by SIGTERM.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """Return the options; a wrong option ends the program with exit code 2 and one line of explanation."""
    parser = parser_of(SCRIPT, DESCRIPTION, EPILOG)
    parser.add_argument("inputs", nargs="*", metavar="INPUT", help="recordings (those in assets/)")
    parser.add_argument(
        "--rates", type=_amounts(Uniform), metavar="HZ,...", help=f"keys a second that are kept ({RATES})"
    )
    parser.add_argument(
        "--modes",
        type=_modes,
        default=DISTINCT,
        metavar="MODE,...",
        help=f"modes to compare: {DISTINCT} for {', '.join(COMPARED)}, with one lane in the film for those that "
        f"give the same motion (the default); {ALL} for the same modes, each in a lane of its own; or names of these, "
        f"and of {', '.join(STREAM_MODES)} for streams, which know no later keys",
    )
    parser.add_argument(
        "-o",
        "--output",
        type=folder_path,
        help="folder to write to (renders/NAME after the first recording, numbered if another comparison is there)",
    )
    parser.add_argument(
        "--radius",
        type=read_radii,
        default=EVERYWHERE,
        metavar="LENGTH",
        help=f"radius of the shell error: 3cm, or 0.03 for metres ({RIGID_RADIUS_M}, around the joints of bodies "
        f"{JOINT_RADIUS_M})",
    )
    parser.add_argument(
        "--against",
        type=not_empty,
        metavar="MODE|FILE",
        help="what the modes are compared with: another mode, such as lerp_slerp, as most game engines do it "
        f"({REFERENCE}, Blender's own curves); or a file with another motion of the same clip, to show as well",
    )
    parser.add_argument(
        "--held",
        nargs=2,
        action="append",
        default=[],
        metavar=("TOOL", "HAND"),
        help="measure how far the first of two clips slips in the second, which holds it, as for pairs found in a "
        "file; may be repeated",
    )
    add_reading_options(parser)
    add_clean_option(parser)
    parser.add_argument(
        "--jobs",
        type=whole("number of processes", 0, 999),
        metavar="N",
        help="worker processes; 0 to work in this one (one for each processor)",
    )
    parser.add_argument(
        "--overwrite",
        action="store_true",
        help="replace another comparison in that folder, and files that were edited or come from other programs",
    )
    output = parser.add_argument_group("output")
    output.add_argument("--open", action="store_true", help="open the report in the browser")
    output.add_argument("--quiet", action="store_true", help="print only the path of the report, and failures")
    output.add_argument("--json", action="store_true", help="print verdict, table, notes and failures as JSON")
    farm = parser.add_argument_group("farms", "One of many machines that share the folder; docs/farm.md has more.")
    farm.add_argument("--only", choices=STAGES, metavar="STAGE", help=f"do this part alone: {', '.join(STAGES)}")
    farm.add_argument("--part", type=_part, default=(1, 1), metavar="K/N", help="and of it the K-th of N shares")
    keys = parser.add_argument_group("choosing keys")
    by_motion = keys.add_mutually_exclusive_group()
    by_motion.add_argument(
        "--tolerance",
        type=_amounts(Tolerance),
        metavar="LENGTH,...",
        help="largest shell error of adaptive keys: 5mm, 0.5cm, 0.005m; a plain number is in the recording's unit",
    )
    by_motion.add_argument(
        "--budget", type=_amounts(Budget), metavar="HZ,...", help="adaptive keys a second, on average over the clip"
    )
    keys.add_argument(
        "--shared",
        action="store_true",
        help="key poses: all joints of a body have keys at the same times (default: each joint where it needs them)",
    )
    keys.add_argument(
        "--fit",
        action="store_true",
        help="also count the keys needed if they are fitted, not recorded poses",
    )
    video = parser.add_argument_group("video")
    video.add_argument("--no-video", action="store_true", help="numbers and report only")
    video.add_argument(
        "--blender",
        metavar="PROGRAM",
        help="make films and read FBX and .blend files with this Blender (the module bpy)",
    )
    video.add_argument("--engine", choices=ENGINES, default="workbench", help="Blender's renderer (%(default)s)")
    video.add_argument(
        "--resolution", type=_resolution, default="1280x720", metavar="WxH", help="in pixels (%(default)s)"
    )
    video.add_argument(
        "--fps",
        type=whole("number of frames a second", 1, 240),
        default=30,
        metavar="N",
        help="frames a second (%(default)s)",
    )
    factor = bounded("number above 0", 0.0, 1e6, above=True)
    video.add_argument("--slow-motion", type=factor, default=1.0, metavar="N", help="play N times slower (%(default)s)")
    video.add_argument(
        "--object",
        dest="subject",
        default="drill",
        metavar="OBJECT",
        help="the object to show: drill, controller, or FILE.blend:NAME (%(default)s)",
    )
    video.add_argument(
        "--films",
        choices=(SPOKEN_OF, ALL),
        default=SPOKEN_OF,
        help="for each recording one video, with the keys of the verdict, or one for every choice of keys "
        "(%(default)s)",
    )
    video.add_argument("--theme", choices=THEMES, default="dark", help="colours of the videos (%(default)s)")
    video.add_argument(
        "--deviation",
        type=factor,
        metavar="N",
        help="magnify errors N times; 1 shows true poses (a suitable round number)",
    )
    video.add_argument(
        "--antialiasing",
        choices=ANTIALIASING,
        help="for workbench: OFF, FXAA or a number of samples (8 on a graphics card, otherwise edges are smoothed)",
    )
    video.add_argument(
        "--samples",
        type=whole("number of samples", 1, 4096),
        default=16,
        metavar="N",
        help="samples for eevee and cycles (%(default)s)",
    )
    options = parser.parse_args(arguments)
    try:
        options.modes, options.distinct = options.modes
        stage = SceneSettings(**{field.name: getattr(options, field.name) for field in fields(SceneSettings)})
        options.stage = None if options.no_video else stage
        if options.part != (1, 1) and not options.only:
            raise ValueError("--part is a share of one stage: add --only STAGE")
        options.choices = _choices(options)
        options.reading = reading_options(options)
    except ValueError as error:
        parser.error(str(error))
    options.reference = REFERENCE
    if options.against in MODES:
        options.reference, options.against = options.against, None
        options.modes = tuple(dict.fromkeys((options.reference, *options.modes)))
    options.inputs = options.inputs or own_recordings()
    options.inputs = [file for source in options.inputs for file in files_of(source)]
    if options.against and len(options.inputs) != 1:
        parser.error(f"--against is a motion of one clip, and there are {len(options.inputs)}: name one recording")
    return options


def without(arguments: list[str], *options: str) -> list[str]:
    """Return the arguments of a comparison without some options and their values."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    for option in options:
        parser.add_argument(option)
    return parser.parse_known_args(arguments)[1]


def own_recordings() -> list[str]:
    """Return the recordings that come with the program."""
    return [f"{path}:*" for path in sorted(from_here(ASSETS).glob("*.csv"))]


def _choices(options: argparse.Namespace) -> list[Choice]:
    """Return all choices of keys of the run. Raises ValueError for options that do not go together."""
    by_motion = options.tolerance or options.budget or []
    for option, given in (("--fit", options.fit), ("--shared", options.shared)):
        if given and not by_motion:
            raise ValueError(f"{option} is for keys that are chosen by the motion: add --tolerance or --budget")
    rates = options.rates or ([] if by_motion else _amounts(Uniform)(RATES))
    return [*rates, *by_motion]


def _amounts(kind: type[Choice]) -> Callable[[str], list[Choice]]:
    """Return a parser for a list of amounts, each a choice of this kind."""

    def parse_amounts(text: str) -> list[Choice]:
        return distinct(map(kind, [part.strip() for part in text.split(",") if part.strip()] or [text]))

    return parse_amounts


def _modes(text: str) -> tuple[tuple[str, ...], bool]:
    """Return the modes of a run, and whether modes that are one motion share a lane."""
    written = [part.strip() for part in text.split(",") if part.strip()]
    modes = tuple(dict.fromkeys(m for part in written for m in (COMPARED if part in (ALL, DISTINCT) else (part,))))
    if wrong := next((mode for mode in modes if mode not in MODES), "" if modes else text):
        known = (*MODES, DISTINCT, ALL)
        near = did_you_mean(wrong, known) or f"; there are {', '.join(known)}"
        raise ValueError(f"there is no mode {wrong!r}{near}")
    return modes, DISTINCT in written


def _part(text: str) -> tuple[int, int]:
    part, of = _two_numbers(text, "/", "share; give one such as 1/8")
    if not 1 <= part <= of:
        raise ValueError(f"{text!r} is not a share; give one such as 1/8")
    return part, of


def _resolution(text: str) -> tuple[int, int]:
    return _two_numbers(text, "x", "resolution; give one such as 1280x720")


def _two_numbers(text: str, between: str, what: str) -> tuple[int, int]:
    """Return the two whole numbers in a text."""
    if not (numbers := re.fullmatch(rf"(\d{{1,6}}){between}(\d{{1,6}})", text, re.ASCII)):
        raise ValueError(f"{text!r} is not a {what}")
    return int(numbers[1]), int(numbers[2])
