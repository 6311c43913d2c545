"""Keep the few keys that a motion needs, in .blend and glTF files and recordings, without a window.

In .blend files the program does the same as *Reduce Keys to Poses* in Blender's window, for objects and whole rigs. A
glTF file gets fewer keys in its clips, and nothing else changes. Of a recording it finds the few samples that a mode
needs as keys, and writes them as a table or a .blend file. No point is off by more than the tolerance on any frame. The
result is a new file; the input does not change.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

from rigid_motion_batch.command_line import as_typed, complain, not_empty, parser_of, program_of, whole
from rigid_motion_batch.system_libraries import blender_problem, require_blender

SCRIPT = "reduce.py"
PROGRAM = program_of(SCRIPT)

from rigid_motion.gltf.clips import CHANNELS
from rigid_motion.gltf.sizes import OF_A_BODY, OF_KEY_POSES
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.analysis.choices import RIGID_RADIUS_M, Tolerance, radius_in_metres
from rigid_motion_batch.keying.gltf_files import do_gltf
from rigid_motion_batch.keying.options import EXIT_CODES, add_file_options, add_target_options, refuse_odd_places
from rigid_motion_batch.keying.planning import NAMES_OF_FILES, InputJob, file_and_body, named_file, planned
from rigid_motion_batch.keying.records import FileProblem, InputRecord, is_made, refuse_read_only
from rigid_motion_batch.keying.reductions import FRAME_RATE_RANGE, GLB_SUFFIX, SUFFIX, TOLERANCE, Reductions, name_of
from rigid_motion_batch.keying.sessions import do_all
from rigid_motion_batch.keying.work import Outcome, RunningJob, Work
from rigid_motion_batch.places import manifest
from rigid_motion_batch.recordings.gltf import ENDINGS as GLTF
from rigid_motion_batch.recordings.options import add_clean_option, add_reading_options, reading_options
from rigid_motion_batch.recordings.reading import JSON, TEXT

IN_FOLDERS = (".blend", ".bvh", ".csv", ".fbx", *GLTF, ".tsv", ".tum")
"""Extensions of the files that are taken from a folder. Other readable files may be anything: .json, .txt."""

MODE = "motor_spline"

PAGE = "report.html"

MAX_KEYS = 1000000
"""The largest number of keys that can be requested: Blender's last frame."""

EPILOG = """
examples:
  python scripts/reduce.py shots/*.blend --tolerance 2mm --output reduced
  python scripts/reduce.py shot.blend --objects 'Camera,Rig/*' --shared
  python scripts/reduce.py shot.blend --keys 12
  python scripts/reduce.py hand.csv --axes unity --tolerance 5mm --blend --fps 30
  python scripts/reduce.py walk.glb --output small/walk.glb --tolerance 2mm
  python scripts/reduce.py walk.glb --tolerance 2mm --meshopt
  python scripts/reduce.py walk.glb --curves --tolerance 1mm
  python scripts/reduce.py walk.bvh --curves --tolerance 1mm
  python scripts/reduce.py avatar.vrm wave.vrma --json
  python scripts/reduce.py walk.fbx dance.bvh shot.blend --glb --tolerance 2mm
  python scripts/reduce.py mocap --output small --jobs 4 --dry-run
  python scripts/reduce.py clips --output small --report
  blender --background --python scripts/reduce.py -- shot.blend

.blend files:
  The program reduces every object, and all bones of a rig together, with more than two keys of location or rotation,
  and sets the mode on the remaining keys. The dense keys stay in the file for Restore Keys. Bones that follow
  constraints or drivers, and their children, may be off by more: they are named. Anything that needs all of its keys
  does not change, and neither does an object with non-uniform scale on all keys.

glTF files:
  walk.glb becomes walk-reduced.glb, and so with .vrm and .vrma; walk.gltf becomes walk-reduced.gltf with its .bin
  beside it. Every clip has fewer keys, and nothing else changes. Blender is not needed. No vertex, and no point within
  --radius of any node, is off by more than the tolerance in the world, neither at keys nor at eighths between them: the
  result is played back to check. Clips that move no node, or would become larger, are left alone. With --glb, Blender
  exports .blend and FBX files and recordings, sampled on every frame. Files compressed by meshopt stay compressed.

recordings:
  The program reads what compare.py reads; FILE:BODY takes one body of several, FILE:* all. A rigid motion becomes
  NAME-keys.csv, t,x,y,z,qw,qx,qy,qz in the axes and units of the recording, or with --curves NAME-keys.blend with an
  empty; a whole body becomes NAME-keys.blend with a rig, with the mode or with curves, whichever needs fewer keys.
  .blend files are in metres and Blender's axes, and play without the extension. The first sample is on frame 1.

what is written:
  New files beside the inputs or in --output, which for a single input may be the name of the file. A file that was
  edited since, or that is not the program's own, is replaced only with --overwrite. With --in-place the file before is
  kept as NAME.blend1. The paths of the results are printed on standard output, one a line; everything else goes to
  standard error, with a sentence on all of it as the last line. Scripts and Python expressions in files do not run. A
  folder stands for the .blend, glTF, VRM, FBX, BVH, CSV (.csv, .tsv) and .tum files in it and below, but for results of
  this program. The same command again does what is new or has changed: the folder .rigid-motion beside the results has
  the record of them.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """Return the options; a wrong option ends the program with exit code 2 and one line of explanation."""
    parser = parser_of(SCRIPT, __doc__, EPILOG + EXIT_CODES)
    parser.add_argument(
        "inputs",
        nargs="+",
        type=not_empty,
        metavar="INPUT",
        help=".blend files, glTF files, recordings, folders",
    )
    add_target_options(parser, "keys")
    keys = parser.add_argument_group("keys")
    keys.add_argument(
        "--tolerance",
        type=Tolerance,
        metavar="LENGTH",
        help="largest error on any frame: 5mm, 0.5cm, 0.005m; a plain number is in the unit of the file (in .blend "
        f"files 1mm for objects and {OF_A_BODY:.1%}% of the size of a rig; for recordings {TOLERANCE.written}, with "
        f"--glb too; in glTF files, and of .blend and FBX files with --glb, {OF_A_BODY:.1%}% of the size; with "
        f"--shared {OF_KEY_POSES:.0%}% of the size of a rig or body)",
    )
    keys.add_argument(
        "--keys",
        "--key-poses",
        dest="count",
        type=whole("number of keys", 2, MAX_KEYS),
        metavar="N",
        help="instead of a tolerance: N keys of each object, or N key poses of each rig, where the error is smallest",
    )
    keys.add_argument(
        "--mode", choices=KEYFRAME_MODES, help=f"mode between the keys ({MODE}, or curves; glTF knows one)"
    )
    keys.add_argument(
        "--curves",
        action="store_true",
        help="Bezier keys with handles in place of a mode, in glTF files cubic splines: they keep to the tolerance on "
        "the frames of the input, and how far they are off between is said",
    )
    keys.add_argument(
        "--radius",
        type=radius_in_metres,
        metavar="LENGTH",
        help="how far around the origin of each object, bone and node no point is off by more: 3cm, or 0.03 for "
        "metres (as far as what it carries reaches, and 3 cm of a grown-up at least, in proportion; in glTF files what "
        f"a node carries counts in any case; for rigid recordings {RIGID_RADIUS_M})",
    )
    keys.add_argument("--shared", action="store_true", help="key poses: all bones of a rig get keys on the same frames")
    keys.add_argument(
        "--discard",
        action="store_true",
        help="remove the dense keys from the file, which disables Restore Keys",
    )
    recordings = parser.add_argument_group("recordings")
    recordings.add_argument("--blend", action="store_true", help="also write rigid motions as .blend files")
    recordings.add_argument(
        "--fps",
        type=whole("number of frames a second", *FRAME_RATE_RANGE),
        metavar="N",
        help="frames a second of .blend and GLB files (those of the recording)",
    )
    add_clean_option(recordings)
    add_reading_options(parser)
    gltf = parser.add_argument_group("glTF files")
    gltf.add_argument("--glb", action="store_true", help="write GLB files from .blend files, FBX files and recordings")
    gltf.add_argument(
        "--channels",
        choices=CHANNELS,
        default=CHANNELS[0],
        help="needed: drop channels at rest, unless another clip of the file moves them or the file has no meshes; "
        "moving: drop them without meshes too; all: every channel keeps at least one key (%(default)s)",
    )
    gltf.add_argument(
        "--meshopt",
        action="store_true",
        help="compress the file with EXT_meshopt_compression, and search for the keys that then take the fewest "
        "bytes; for viewers that read it",
    )
    gltf.add_argument(
        "--feet-may-slide",
        dest="feet",
        action="store_false",
        help="let standing feet slide as far as the tolerance allows, not only a millimetre",
    )
    add_file_options(parser)
    parser.add_argument(
        "--report",
        action="store_true",
        help=f"also write a page, {PAGE}, into the folder of --output or of the first input: bytes and keys of all "
        "files, and the motion of glTF files before and after, side by side, with its error over time",
    )
    parser.add_argument(
        "--json",
        action="store_true",
        help="print JSON instead of paths: a list with the result for each input, in metres and bytes",
    )
    options = parser.parse_args(arguments)
    try:
        refuse_odd_places(options)
        options.reading = reading_options(options)
        options.fewest = not (options.mode or options.curves)
        how = {field.name: getattr(options, field.name) for field in fields(Reductions)}
        options.report = _place_of_page(options)
        options.work = Reduce.of(options, how=Reductions(**how | {"mode": options.mode or MODE}))
        options.todo = _planned(options)
        _refuse_wrong_options(options)
    except ValueError as error:
        parser.error(str(error))
    return options


def main(arguments: list[str]) -> int:
    """Do all inputs, and return the exit code."""
    options = parse(arguments)
    todo, needing = options.todo, [job for job in options.todo if options.work.needs_blender(job)]
    if needing and len(needing) == len(todo):
        require_blender(SCRIPT)
    elif needing and (problem := blender_problem(SCRIPT)):
        lacking = " ".join(map(str.strip, problem.splitlines()))
        todo = [replace(job, problem=lacking) if job in needing else job for job in todo]
    page = _page(options, as_typed(PROGRAM, arguments, options.inputs)) if options.report else None
    return do_all(PROGRAM, todo, options.work, options.jobs, as_json=options.json, page=page)


def _page(options: argparse.Namespace, command: str) -> Callable[[Sequence[Outcome]], Path]:
    """Return a function that writes the page of a run; end the program with code 2 if the page must not be replaced."""
    from rigid_motion_batch.keying.views import place_of_views, read_views
    from rigid_motion_batch.report.reduced import write_reduced

    path = options.report
    record = InputRecord(path.parent, path, overwrite=options.overwrite)
    try:
        record.refuse_to_replace(path)
        refuse_read_only(path)
    except FileProblem as problem:
        complain(PROGRAM, problem)
        sys.exit(2)

    def write(outcomes: Sequence[Outcome]) -> Path:
        done = [
            (outcome.as_data(), [view for made in outcome.written for view in read_views(place_of_views(made))])
            for outcome in outcomes
        ]
        with record.writing(path) as beside:
            write_reduced(beside, done, f"{manifest()['name']} {manifest()['version']}", command)
        return path

    return write


@dataclass(frozen=True)
class Reduce(Work):
    """Reducing keys."""

    doing, done = "Reducing", "reduced"
    how: Reductions

    def needs_blender(self, job: InputJob) -> bool:
        if job.is_recording and not (self.how.blend or self.how.glb or self.how.curves):
            return not job.problem and job.file.suffix.lower() not in (*TEXT, *JSON)
        return not job.problem and (job.is_recording or not _is_gltf(job.file))

    def do(self, doing: RunningJob) -> None:
        if doing.job.is_recording:
            from rigid_motion_batch.keying.recordings import do_recording

            do_recording(doing, self.how)
        elif not self.needs_blender(doing.job):
            do_gltf(doing, self.how)
        elif self.how.glb:
            from rigid_motion_batch.keying.exporting import export_file

            export_file(doing, self.how)
        else:
            from rigid_motion_batch.keying.jobs import do_blend
            from rigid_motion_batch.keying.reducing import reducing

            do_blend(doing, reducing(self.how, self.objects))


def _planned(options: argparse.Namespace) -> list[InputJob]:
    """Return the jobs.

    A body of a file is a recording, and so is a glTF file that becomes a .blend file. An FBX file is not a recording if
    it becomes a GLB file with all its contents.
    """
    whole = (".blend", *(() if options.blend else GLTF), *((".fbx",) if options.glb else ()))

    def kind_of(path: Path) -> str:
        return ".glb" if options.glb and not _is_gltf(path) else path.suffix.lower()

    first = Path(options.inputs[0])
    is_whole = options.glb or first.name.lower().endswith(whole)
    endings = (kind_of(first),) if is_whole else (".csv", ".tum", ".blend")
    if (options.output or first).suffix.lower() == ".glb" and not (options.glb or _is_gltf(first)):
        raise ValueError(f"--output {options.output}: add --glb, and {first} becomes a GLB file")
    named = named_file(options.output, options.inputs, endings)

    def job_of(source: str, folder: Path) -> InputJob:
        folder = named.parent if named else folder
        if source.lower().endswith(whole):
            file = Path(source)
            made = file if options.in_place else named or folder / f"{file.stem}{GLB_SUFFIX}{kind_of(file)}"
            return InputJob(source, made.parent, made)
        name, suffix = name_of(*file_and_body(source)), GLB_SUFFIX if options.glb else SUFFIX
        made = named.with_suffix("") if named else folder / f"{name}{suffix}"
        kind = named.suffix.lower() if named else ""
        possible = (".glb",) if options.glb else tuple(dict.fromkeys((kind or ".csv", ".blend")))
        return InputJob(source, folder, made, possible, kind, is_recording=True)

    return planned(options.inputs, None if named else options.output, IN_FOLDERS, _is_result, job_of)


def _refuse_wrong_options(options: argparse.Namespace) -> None:
    """Raise ValueError for options that do not apply to the inputs, or exclude each other."""
    jobs = [job for job in options.todo if not job.problem]
    recorded = [job for job in jobs if job.is_recording]
    gltf = [job for job in jobs if not job.is_recording and _is_gltf(job.file)]
    if options.count is not None and options.tolerance is not None:
        raise ValueError("--keys and --tolerance exclude one another: each determines the number of keys")
    if options.curves and options.mode:
        raise ValueError("--curves and --mode exclude one another: curves need no mode")
    if options.curves and options.shared and (gltf or options.glb):
        raise ValueError("--curves and --shared exclude one another in glTF files: --key-poses N --curves shares keys")
    if options.in_place and (others := recorded + gltf):
        raise ValueError(f"--in-place is for .blend files, and {others[0].source} is none: leave one out")
    if options.glb:
        _refuse_beside_glb(options, jobs)
    if gltf and options.mode:
        raise ValueError(
            f"--mode is for .blend files and tables, and {gltf[0].source} knows lines and even turns alone: leave it "
            "out, or add --blend, for a .blend file with that mode"
        )
    if options.clean is not None and (others := [job for job in jobs if not job.is_recording]):
        raise ValueError(f"--clean is for recordings, and {others[0].source} is none: leave it out")
    if options.meshopt and not options.glb and (others := [job for job in jobs if job not in gltf]):
        raise ValueError(f"--meshopt is for glTF files, and {others[0].source} is none: add --glb, or leave it out")
    if options.objects and jobs and len(jobs) == len(gltf) + len(recorded):
        raise ValueError("--objects is for .blend files: name one body of a recording with FILE:BODY")


def _refuse_beside_glb(options: argparse.Namespace, jobs: list[InputJob]) -> None:
    """Raise ValueError for options that do not apply to GLB files."""
    for option in ("--mode", "--blend", "--in-place", "--objects", "--discard"):
        if getattr(options, option[2:].replace("-", "_")):
            raise ValueError(f"{option} is for .blend files, and --glb writes others: leave one of them out")
    for job in jobs:
        if job.file.suffix.lower() == ".gltf" and not job.is_found:
            raise ValueError(f"{job.source} is reduced to a .gltf file: do it without --glb")
        if job.file.suffix.lower() == ".fbx" and (options.axes or options.reading.given):
            raise ValueError(
                f"with --glb Blender imports {job.source} whole: leave out --axes and what says how to read it"
            )


def _place_of_page(options: argparse.Namespace) -> Path | None:
    """Return the path of the page; None without one. Raises ValueError if nothing is written."""
    if options.report and options.dry_run:
        raise ValueError("--report describes written files, and --dry-run writes none: leave one of them out")
    first = file_and_body(options.inputs[0])[0]
    named = named_file(options.output, options.inputs, NAMES_OF_FILES) if options.report else None
    folder = named.parent if named else options.output or (first if first.is_dir() else first.parent)
    return folder / PAGE if options.report else None


def _is_gltf(path: Path) -> bool:
    return path.suffix.lower() in GLTF


def _is_result(path: Path) -> bool:
    return path.stem.endswith(GLB_SUFFIX) or is_made(path)
