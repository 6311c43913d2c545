"""Compare interpolation modes on recorded trajectories.

Of every recording only a few keys a second are kept, evenly or where the motion needs them; each mode fills them in
again; what was lost is measured, and shown in a video in which the modes move side by side. Without INPUT, the
recordings in assets/ are compared.
"""

from __future__ import annotations

import argparse
import re
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from addon.motion import KEYFRAME_MODES, MODES
from scripts.command_line import as_typed, number, own_arguments
from scripts.comparison import steps
from scripts.comparison.explaining import explain_comparison
from scripts.comparison.planning import Wanted, comparison_tasks, look_into, plan_of, reading_tasks
from scripts.comparison.report.pages import Settings
from scripts.comparison.stage.settings import ANTIALIASING, ENGINES, StageSettings, SubjectError
from scripts.comparison.steps import KEYS_NEEDED, METRICS, REPORT
from scripts.comparison.study.choices import Budget, Choice, Tolerance, Uniform, distinct
from scripts.comparison.study.modes import BEST_OF, single_modes
from scripts.comparison.version import blender_version, program_version
from scripts.progress import Progress
from scripts.system_libraries import missing_for_rendering, way_out
from scripts.trajectories.axes import AXES
from scripts.workplan import (
    Executor,
    ExecutorError,
    FolderInUse,
    ManifestError,
    Outcome,
    Plan,
    ProcessExecutor,
    SerialExecutor,
    State,
    Workspace,
    run,
)
from scripts.workplan.ownership import OutputError, require_free, require_same_inputs

RATES = "5,10,15,20"
"""Keys a second where none are asked for."""

STREAM_MODES = tuple(mode for mode in MODES if mode not in KEYFRAME_MODES)

ALL = "all"
"""Stands for the modes that are compared where none are named."""

EPILOG = """
inputs:
  CSV with named columns (t,x,y,z,qx,qy,qz,qw in any order), TUM, EuRoC, Motive (OptiTrack) CSV,
  A-Frame motion capture JSON, BVH, .blend. FILE:BODY takes one body of several, FILE:* all of them.
  Of a .blend a body is an object (FILE.blend:OBJECT) or a bone of a rig (FILE.blend:OBJECT/BONE), as Blender shows it
  in the world, with parents, constraints, drivers and NLA strips. FILE.blend:* is every object that is animated.

examples:
  python scripts/compare.py
  python scripts/compare.py hand_left.csv hand_right.csv --axes unity --output renders/hands
  python scripts/compare.py take.csv --rates 7.5,15 --modes lerp_slerp,dq_sclerp --slow-motion 4
  python scripts/compare.py dance.bvh:LeftHand --axes opengl --object controller
  python scripts/compare.py shot.blend:Camera --no-video
  python scripts/compare.py shot.blend:Rig/Hand --no-video
  python scripts/compare.py hand_left.csv --modes all,best_of
  python scripts/compare.py take.csv --decimate adaptive --tolerance 5mm
  python scripts/compare.py take.csv --decimate adaptive --budget 5,10 --rates 10
  blender --background --python scripts/compare.py -- hand_left.csv --axes unity

choosing keys:
  --decimate uniform keeps --rates keys a second, evenly in time and the same for every mode. With --decimate adaptive
  each mode gets keys of its own among the recorded samples: the fewest that keep its shell error within --tolerance
  everywhere, or --budget keys a second, on average over the clip, that make its RMS shell error small. Given neither,
  --rates are the budgets. Rates that are given beside adaptive keys are kept evenly as well, for comparison. The report
  then also shows the curve of error over keys, and how many keys every mode needs to be as good as lerp_slerp at 30,
  20, 15 and 12 a second; that alone takes up to a second for every 100 samples. --fit adds how many it needs where they
  need not be recorded poses, but are moved to where the motion follows the recording best; two to three times as long.

choosing modes:
  best_of takes in every segment, from key to key, that of the other modes named which comes closest to the recording
  there. Evenly spaced keys are the same for all; of adaptive ones it has those of the best single mode. The mode of
  each segment is a column of best_of.keys.csv.

It writes OUTPUT/report.html (all of it in one file; of more than 24 clips each has a page of its own, beside its
folders), OUTPUT/metrics.csv, with adaptive keys OUTPUT/keys_needed.csv, and for every clip and choice of keys a folder
(OUTPUT/CLIP/10, /budget-10, /tolerance-5mm) with keys.csv (MODE.keys.csv for adaptive keys), MODE.csv, comparison.mp4
and comparison.blend. The last line it prints is the path of the report.

one folder, one comparison:
  With the same recordings, more of them or fewer, a second run into a folder goes on. A folder that holds another
  comparison is refused, and so are files that this program has not written where outputs go: choose another --output,
  or replace them with --force. Inputs are never replaced. --explain says what a run would do and why, and does nothing.

many clips:
  The work is done in small tasks, by as many processes as --jobs says. What is done is kept: stopped by Ctrl-C, a full
  disk or worse, the same command goes on from there, and with other options it does what these ask for anew. A
  recording that cannot be read, or a video that cannot be rendered, is reported, and the others go on. With
  --scheduler the processes are on all machines that a Dask scheduler knows; docs/farm.md says how.
Exit code: 0 done, 1 some recordings or videos could not be done, 2 nothing could, or a wrong option, 130 stopped by
Ctrl-C; after that the report holds what was ready.
"""


def parse(arguments: list[str]) -> argparse.Namespace:
    """The options; a wrong one ends the program with code 2 and a line that says what is wrong."""
    parser = argparse.ArgumentParser(
        prog="compare.py", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("inputs", nargs="*", metavar="INPUT", help="recordings; those in assets/ where none is given")
    parser.add_argument(
        "--rates", type=_amounts(Uniform), metavar="HZ,...", help=f"keys a second that are kept ({RATES})"
    )
    parser.add_argument(
        "--modes",
        type=_modes,
        default=",".join(KEYFRAME_MODES),
        metavar="MODE,...",
        help=f"what fills them in ({', '.join(KEYFRAME_MODES)}); {ALL} for all of these, {', '.join(STREAM_MODES)} for "
        f"streams, which know no later keys, and {BEST_OF} for the best of each segment",
    )
    parser.add_argument(
        "--output",
        type=_folder,
        default=ROOT / "renders" / "comparison",
        help="folder to write to (renders/comparison)",
    )
    parser.add_argument("--axes", choices=AXES, default="blender", help="axes of the recordings (%(default)s)")
    parser.add_argument(
        "--radius", type=_positive, default=0.1, metavar="M", help="of the shell error, in metres (%(default)s)"
    )
    workers = parser.add_mutually_exclusive_group()
    workers.add_argument(
        "--jobs", type=_jobs, metavar="N", help="processes that work; 0 for none but this one (one for each processor)"
    )
    workers.add_argument(
        "--scheduler", metavar="ADDRESS", help="let the workers of a Dask scheduler do it: tcp://HOST:8786"
    )
    parser.add_argument(
        "--force",
        action="store_true",
        help="do everything again, also what is done already; replace another comparison, and files of other programs",
    )
    parser.add_argument("--explain", action="store_true", help="say what would be done and why, and do nothing")
    keys = parser.add_argument_group("choosing keys")
    keys.add_argument(
        "--decimate",
        choices=("uniform", "adaptive"),
        default="uniform",
        help="keep keys evenly in time, or where each mode needs them (%(default)s)",
    )
    keys.add_argument(
        "--tolerance",
        type=_amounts(Tolerance),
        metavar="LENGTH,...",
        help="largest shell error of adaptive keys: 5mm, 0.5cm, 0.005m; a plain number is in the recording's unit",
    )
    keys.add_argument(
        "--budget", type=_amounts(Budget), metavar="HZ,...", help="adaptive keys a second, on average over the clip"
    )
    keys.add_argument("--fit", action="store_true", help="count the keys needed also where they are fitted")
    video = parser.add_argument_group("video")
    video.add_argument("--no-video", action="store_true", help="numbers and report only")
    video.add_argument("--engine", choices=ENGINES, default="workbench", help="Blender's renderer (%(default)s)")
    video.add_argument("--resolution", type=_resolution, default="960x540", metavar="WxH", help="(%(default)s)")
    video.add_argument("--fps", type=int, default=30, help="frames a second (%(default)s)")
    video.add_argument(
        "--slow-motion", type=_positive, default=1.0, metavar="N", help="times slower than life (%(default)s)"
    )
    video.add_argument(
        "--object",
        default="drill",
        metavar="OBJECT",
        help="what moves: drill, controller, or FILE.blend:NAME (%(default)s)",
    )
    video.add_argument(
        "--antialiasing",
        choices=ANTIALIASING,
        help="of workbench: FXAA or a number of samples; 8 for a talk (FXAA for small pictures, OFF for others)",
    )
    video.add_argument("--samples", type=int, default=16, help="of eevee and cycles (%(default)s)")
    options = parser.parse_args(arguments)
    try:
        options.stage = StageSettings(
            engine=options.engine,
            resolution=options.resolution,
            fps=options.fps,
            slow_motion=options.slow_motion,
            subject=options.object,
            antialiasing=options.antialiasing,
            samples=options.samples,
        )
    except ValueError as error:
        parser.error(str(error))
    try:
        options.choices = _choices(options)
    except ValueError as error:
        parser.error(str(error))
    if not options.inputs:
        assets = ROOT / "assets"
        if Path.cwd() == ROOT:
            assets = assets.relative_to(ROOT)
        options.inputs = [str(path) for path in sorted(assets.glob("*.csv"))]
    return options


def _choices(options: argparse.Namespace) -> list[Choice]:
    """All choices of keys of the run. Raises ValueError for options that do not go together."""
    rates, tolerance, budget = options.rates, options.tolerance, options.budget
    if options.decimate == "uniform":
        for option, given in (("--tolerance", tolerance), ("--budget", budget), ("--fit", options.fit)):
            if given:
                raise ValueError(f"{option} is for keys that are chosen by the motion: add --decimate adaptive")
        return rates or _amounts(Uniform)(RATES)
    if tolerance and budget:
        raise ValueError(
            "--tolerance and --budget exclude one another: a tolerance decides how many keys there are, a budget how "
            "large the error is; give one of them"
        )
    by_motion = tolerance or budget or [Budget(rate.written) for rate in rates or _amounts(Uniform)(RATES)]
    return [*(rates or []), *by_motion]


def main(arguments: list[str]) -> int:
    """Run a comparison, and return the exit code."""
    options = parse(arguments)
    command = as_typed("compare.py", arguments, options.inputs)
    needs_screen = not (options.explain or options.no_video or options.engine == "cycles")
    missing = missing_for_rendering() if needs_screen else None
    if missing:
        print(f"compare.py: {way_out(missing)}\nOr go without videos: --no-video", file=sys.stderr)
        return 2
    try:
        if options.explain:
            asked = wanted(options, command)
            print(
                *explain_comparison(options.output, options.inputs, options.axes, asked, force=options.force), sep="\n"
            )
            return 0
        if not options.no_video:
            require_subject(options.object)
        version = program_version()
        with (
            Progress() as progress,
            Workspace(options.output) as workspace,
            _executor(options, progress, version) as executor,
        ):
            return _Run(options, workspace, executor, progress, command, version).run()
    except ImportError as error:
        print(f"compare.py: {error}\n{way_out(str(error))}", file=sys.stderr)
    except (SubjectError, FolderInUse, ManifestError, ExecutorError, OutputError) as error:
        print(f"compare.py: {error}", file=sys.stderr)
    except OSError as error:
        print(f"compare.py: {error.filename or options.output}: {error.strerror or error}", file=sys.stderr)
    return 2


def require_subject(wanted: str) -> None:
    """Make sure that the object to show can be had.

    Raises
    ------
    SubjectError
        Where it cannot.
    ImportError
        Where there is no Blender to ask.
    """
    # Only here is Blender loaded, which takes longer than all else before the work begins.
    from scripts.comparison.stage.subject import load_subject

    load_subject(wanted)


def _executor(options: argparse.Namespace, progress: Progress, version: str) -> Executor:
    """Who does the work. Raises ExecutorError where Dask is wanted, and is not there."""
    if options.scheduler is None:
        return SerialExecutor() if options.jobs == 0 else ProcessExecutor(options.jobs)
    try:
        from scripts.workplan.dask_executor import DaskExecutor
    except ImportError as error:
        raise ExecutorError(f"--scheduler: {error}; `python scripts/bootstrap.py dask` installs it") from None
    return DaskExecutor(
        options.scheduler,
        options.output,
        identify=f"{steps.__name__}:{steps.identify.__name__}",
        version=version,
        note=lambda text: progress.note(f"compare.py: {text}"),
    )


class _Run:
    """A comparison in its output folder."""

    def __init__(
        self,
        options: argparse.Namespace,
        workspace: Workspace,
        executor: Executor,
        progress: Progress,
        command: str,
        version: str,
    ) -> None:
        self.options, self.workspace, self.executor, self.progress = options, workspace, executor, progress
        self.command, self.version = command, version

    def run(self) -> int:
        """Read the recordings, see what there is to do, do it, and say what came of it."""
        started = time.perf_counter()
        options = self.options
        reading = reading_tasks(options.inputs, options.axes)
        first = plan_of(list({task.name: task for task in reading}.values()), self.version)
        require_same_inputs(first, self.workspace, force=options.force)
        require_free(first, self.workspace, (METRICS, KEYS_NEEDED, REPORT), force=options.force)
        read = self._do(first, "Reading")
        if read.interrupted:
            return 130
        there = [task for task in reading if read.states[task.name].there]
        if read.problem or not there:
            return 2
        try:
            found = look_into(self.workspace.output, there, options.choices)
        except Exception:  # What was read before may be damaged in any way: it is read again.
            self.workspace.withdraw_damaged(first.order) or self.workspace.withdraw(first.order)
            read = self._do(first, "Reading")
            found = look_into(self.workspace.output, there, options.choices)
        for note in found.notes:
            self.progress.note(note)
        if not found.studies:
            higher = "--budget" if options.budget else "--rates"
            self.progress.note(f"compare.py: every clip is too short for two keys at these rates; give higher {higher}")
            return 2
        tasks = comparison_tasks(found.studies, there, wanted(self.options, self.command))
        plan = plan_of(tasks, self.version)
        require_free(plan, self.workspace, force=options.force)
        if options.decimate != "adaptive":
            # What an earlier run found must not pass for a finding of this.
            (options.output / KEYS_NEEDED).unlink(missing_ok=True)
        del first, reading, there, found, tasks  # Of ten thousand clips that is a third of the memory.
        outcome = self._do(plan, "Comparing")
        outcome.states |= read.states
        self._say(outcome, time.perf_counter() - started)
        return 130 if outcome.interrupted else 2 if outcome.problem else int(State.FAILED in outcome.states.values())

    def _do(self, plan: Plan, title: str) -> Outcome:
        outcome = run(
            plan,
            self.workspace,
            self.executor,
            force=self.options.force,
            progress=self.progress,
            title=title,
            describe=lambda problem: f"compare.py: {problem}",
        )
        if outcome.problem:
            self.progress.note(
                f"compare.py: {outcome.problem}; nothing that is done is lost: put that right, and run the same "
                "command again"
            )
        return outcome

    def _say(self, outcome: Outcome, seconds: float) -> None:
        """What came of it, and last the path of the report."""
        work = rendering = 0.0
        for record in map(self.workspace.manifest.get, outcome.of(State.DONE)):
            if record:
                work, rendering = work + record.seconds, rendering + record.facts.get("rendering", 0.0)
        share = f", {rendering:.1f} s ({rendering / work:.0%}) of them Blender's rendering" if rendering else ""
        lines = [f"{seconds:.1f} s in all; {work:.1f} s of work{share}.", f"Tasks: {outcome}."]
        report = self.workspace.output / REPORT
        if outcome.interrupted:
            holds = "the report holds what was ready" if outcome.states[REPORT].there else "there is no new report yet"
            lines.append(f"Stopped; {holds}. The same command goes on from here.")
        for line in lines:
            print(line, file=sys.stderr)
        if outcome.states[REPORT].there:
            print(report, flush=True)


def wanted(options: argparse.Namespace, command: str) -> Wanted:
    """What is wanted of every clip, by these options of that command."""
    stage = options.stage
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    settings = Settings(
        radius=options.radius,
        program=f"{manifest['name']} {manifest['version']}",
        blender=blender_version(),
        command=command,
        details={}
        if options.no_video
        else {
            "Videos": f"{stage.engine}, {stage.resolution[0]} x {stage.resolution[1]}, {stage.fps} frames/s",
            "Speed of the videos": "real time" if stage.slow_motion == 1 else f"{stage.slow_motion:g} times slower",
        },
    )
    return Wanted(
        choices=tuple(options.choices),
        modes=tuple(options.modes),
        radius=options.radius,
        settings=settings,
        stage=None if options.no_video else stage,
        count_keys=options.decimate == "adaptive",
        fit=options.fit,
    )


def _amounts(kind: type[Choice]) -> Callable[[str], list[Choice]]:
    """How a list of amounts is read: each as a choice of that kind."""

    def parse_amounts(text: str) -> list[Choice]:
        written = ["".join(part.split()) for part in text.split(",") if part.strip()] or [text]
        try:
            return distinct(map(kind, written))
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parse_amounts


def _modes(text: str) -> list[str]:
    written = [part.strip() for part in text.split(",") if part.strip()]
    named = list(dict.fromkeys(m for part in written for m in (KEYFRAME_MODES if part == ALL else (part,))))
    modes = single_modes(named)
    wrong = [mode for mode in modes if mode not in MODES]
    if wrong or not named:
        raise argparse.ArgumentTypeError(
            f"there is no mode {wrong[0] if wrong else text!r}; there are {', '.join((*MODES, ALL, BEST_OF))}"
        )
    if BEST_OF not in named:
        return list(modes)
    if len(modes) < 2:
        raise argparse.ArgumentTypeError(
            f"{BEST_OF} chooses among the other modes that are named: name two or more, or {ALL},{BEST_OF}"
        )
    return [*modes, BEST_OF]


def _folder(text: str) -> Path:
    if not text.strip() or "\0" in text:
        raise argparse.ArgumentTypeError(f"{text!r} is no folder; give one such as renders/hand, or . for this one")
    return Path(text)


def _jobs(text: str) -> int:
    if not re.fullmatch(r"\d{1,3}", text, re.ASCII):
        raise argparse.ArgumentTypeError(f"{text!r} is no number of processes; give 0, 1, 2, ...")
    return int(text)


def _positive(text: str) -> float:
    positive = number(text)
    if not 0.0 < positive < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return positive


def _resolution(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text, re.ASCII)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} is no resolution; give one such as 1280x720")
    return int(found[1]), int(found[2])


if __name__ == "__main__":
    try:
        sys.exit(main(own_arguments(__file__)))
    except KeyboardInterrupt:
        sys.exit(130)
