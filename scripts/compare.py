"""Compare interpolation modes on recorded trajectories.

Of every recording only a few keys a second are kept, evenly or where the motion needs them; each mode fills them in
again; what was lost is measured, and shown in a video in which the modes move side by side. Without INPUT, the
recordings in assets/ are compared.
"""

from __future__ import annotations

import argparse
import re
import shlex
import sys
import time
import tomllib
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))

from scripts.system_libraries import missing_for_rendering, way_out

try:
    import bpy
except ImportError as error:
    print(f"compare.py: {error}\n{way_out(str(error))}", file=sys.stderr)
    sys.exit(2)

from addon.motion import KEYFRAME_MODES, MODES
from scripts.comparison import needed
from scripts.comparison.choices import Budget, Choice, Tolerance, Uniform
from scripts.comparison.clips import Clip
from scripts.comparison.film import render_film, save_blend
from scripts.comparison.metrics import measure_reconstruction, write_metrics, write_reconstruction
from scripts.comparison.needed import KeysNeeded
from scripts.comparison.progress import Progress
from scripts.comparison.reconstructions import Reconstruction
from scripts.comparison.report import Settings, write_report
from scripts.comparison.stage import ANTIALIASING, ENGINES, StageSettings, build_stage
from scripts.comparison.study import read_clips, reconstruct
from scripts.comparison.subject import SubjectError, load_subject
from scripts.comparison.timeline import Timeline
from scripts.trajectories import TrajectoryError
from scripts.trajectories.axes import AXES

RATES = "5,10,15,20"
"""Keys a second where none are asked for."""

KEYS_NEEDED = "keys_needed.csv"

EPILOG = """
inputs:
  CSV with named columns (t,x,y,z,qx,qy,qz,qw in any order), TUM, EuRoC, Motive (OptiTrack) CSV,
  A-Frame motion capture JSON, BVH, .blend. FILE:BODY takes one body of several, FILE:* all of them.

examples:
  python scripts/compare.py
  python scripts/compare.py hand_left.csv hand_right.csv --axes unity
  python scripts/compare.py take.csv --rates 7.5,15 --modes lerp_slerp,dq_sclerp --slow-motion 4
  python scripts/compare.py dance.bvh:LeftHand --axes opengl --object controller
  python scripts/compare.py shot.blend:Camera --no-video
  python scripts/compare.py take.csv --decimate adaptive --tolerance 5mm
  python scripts/compare.py take.csv --decimate adaptive --budget 5,10 --rates 10
  blender --background --python scripts/compare.py -- hand_left.csv --axes unity

choosing keys:
  --decimate uniform keeps --rates keys a second, evenly in time and the same for every mode. With --decimate adaptive
  each mode gets keys of its own among the recorded samples: the fewest that keep its shell error within --tolerance
  everywhere, or --budget keys a second, on average over the clip, that make its RMS shell error small. Given neither,
  --rates are the budgets. Rates that are given beside adaptive keys are kept evenly as well, for comparison. The report
  then also shows the curve of error over keys, and how many keys every mode needs to be as good as lerp_slerp at 30,
  20, 15 and 12 a second; that alone takes up to a second for every 100 samples.

It writes OUTPUT/report.html (all of it in one file), OUTPUT/metrics.csv, with adaptive keys OUTPUT/keys_needed.csv, and
for every clip and choice of keys a folder (OUTPUT/CLIP/10, /budget-10, /tolerance-5mm) with keys.csv (MODE.keys.csv for
adaptive keys), MODE.csv, comparison.mp4 and comparison.blend. The last line it prints is the path of the report.
Exit code: 0 done, 1 a video could not be rendered, 2 a wrong input or option, 130 stopped by Ctrl-C; after that the
report holds what was ready.
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
        help="what fills them in (%(default)s)",
    )
    parser.add_argument(
        "--output", type=Path, default=ROOT / "renders" / "comparison", help="folder to write to (renders/comparison)"
    )
    parser.add_argument("--axes", choices=AXES, default="blender", help="axes of the recordings (%(default)s)")
    parser.add_argument(
        "--radius", type=_positive, default=0.1, metavar="M", help="of the shell error, in metres (%(default)s)"
    )
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
        for option, given in (("--tolerance", tolerance), ("--budget", budget)):
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
    missing = None if options.no_video or options.engine == "cycles" else missing_for_rendering()
    if missing:
        print(f"compare.py: {way_out(missing)}\nOr go without videos: --no-video", file=sys.stderr)
        return 2
    started = time.perf_counter()
    with Progress() as progress:
        try:
            with progress.stage("Reading", 1):
                clips, notes = read_clips(options.inputs, options.axes)
                if not options.no_video:
                    load_subject(options.object)
        except (TrajectoryError, SubjectError) as error:
            progress.note(f"compare.py: {error}")
            return 2
        for note in notes:
            progress.note(note)
        for clip in clips:
            for repaired in clip.repairs:
                progress.note(f"{clip.name}: {repaired}")
        run = _Run(options, progress, shlex.join(["compare.py", *arguments]))
        try:
            run.measure(clips)
            if options.decimate == "adaptive":
                run.count_keys()
            if run.reconstructions and not options.no_video:
                run.film()
        except KeyboardInterrupt:
            run.interrupted = True
        except OSError as error:
            progress.note(f"compare.py: {error.filename or options.output}: {error.strerror or error}")
            return 2
        if not run.reconstructions:
            if not run.interrupted:
                higher = "--budget" if options.budget else "--rates"
                progress.note(f"compare.py: every clip is too short for two keys at these rates; give higher {higher}")
            return 130 if run.interrupted else 2
        report = run.report()
    seconds = time.perf_counter() - started
    print(
        f"{seconds:.1f} s in all, {run.rendering:.1f} s ({run.rendering / seconds:.0%}) of them Blender's rendering.",
        file=sys.stderr,
    )
    if run.interrupted:
        print("Stopped; the report holds what was ready.", file=sys.stderr)
    print(report, flush=True)
    return 130 if run.interrupted else int(run.failed)


class _Run:
    """What a run has made so far: enough for a report at any time."""

    def __init__(self, options: argparse.Namespace, progress: Progress, command: str) -> None:
        self.options, self.progress, self.command = options, progress, command
        self.reconstructions: list[Reconstruction] = []
        self.needed: list[KeysNeeded] = []
        self.films: dict[tuple[str, str], Path] = {}
        self.rendering = 0.0
        self.failed = self.interrupted = False

    def measure(self, clips: list[Clip]) -> None:
        """All numbers first: they take seconds, and are there whatever becomes of the videos."""
        # What an earlier run found must not pass for a finding of this.
        (self.options.output / KEYS_NEEDED).unlink(missing_ok=True)
        with self.progress.stage("Measuring", len(clips) * len(self.options.choices)) as stage:
            for clip in clips:
                for choice in self.options.choices:
                    stage.say(f"{clip.name} {choice.phrase}")
                    made = reconstruct(clip, choice, self.options.modes, self.options.radius)
                    if made is None:
                        self.progress.note(f"{clip.name}: too short for two keys at {choice.rate} a second; left out")
                    else:
                        write_reconstruction(self._folder(made), made)
                        self.reconstructions.append(made)
                    stage.advance()
        rows = [row for made in self.reconstructions for row in measure_reconstruction(made)]
        write_metrics(self.options.output / "metrics.csv", rows)

    def count_keys(self) -> None:
        """How many keys every mode needs, on the clips that there are reconstructions of."""
        clips = {made.clip.name: made.clip for made in self.reconstructions}
        with self.progress.stage("Counting the keys needed", len(clips) * len(needed.RATES)) as stage:
            for clip in clips.values():
                stage.say(clip.name)
                self.needed.append(needed.keys_needed(clip, self.options.modes, self.options.radius, stage.advance))
        needed.write_keys_needed(self.options.output / KEYS_NEEDED, self.needed)

    def film(self) -> None:
        """A .blend and an MP4 for every clip and choice of keys."""
        self.films = {
            (made.clip.name, made.choice.name): self._folder(made) / "comparison.mp4" for made in self.reconstructions
        }
        count = sum(
            Timeline.of(made, self.options.fps, self.options.slow_motion).count for made in self.reconstructions
        )
        with self.progress.stage("Rendering", count) as stage:
            for made in self.reconstructions:
                title = f"{made.clip.name} {made.choice.phrase}"
                stage.say(title)
                path = self.films[made.clip.name, made.choice.name]
                path.unlink(missing_ok=True)  # A film of an earlier run must not pass for one of this.
                try:
                    scene = build_stage(made, self.options.stage)
                    save_blend(path.with_suffix(".blend"))
                    self.rendering += render_film(
                        scene, path, lambda done, of, title=title: stage.advance(1, f"{title}: {done}/{of}")
                    )
                except RuntimeError as error:
                    self.failed = True
                    self.progress.note(f"{title}: no video: {error}")

    def report(self) -> Path:
        """The page, with the films that there are."""
        path = self.options.output / "report.html"
        manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
        stage = self.options.stage
        settings = Settings(
            radius=self.options.radius,
            program=f"{manifest['name']} {manifest['version']}",
            blender=bpy.app.version_string,
            command=self.command,
            details={}
            if self.options.no_video
            else {
                "Videos": f"{stage.engine}, {stage.resolution[0]} x {stage.resolution[1]}, {stage.fps} frames/s",
                "Speed of the videos": "real time" if stage.slow_motion == 1 else f"{stage.slow_motion:g} times slower",
            },
        )
        write_report(path, self.reconstructions, films=self.films, settings=settings, needed=self.needed)
        return path.resolve()

    def _folder(self, made: Reconstruction) -> Path:
        return self.options.output / made.clip.name / made.choice.name


def _amounts(kind: type[Choice]) -> Callable[[str], list[Choice]]:
    """How a list of amounts is read: each as a choice of that kind."""

    def parse_amounts(text: str) -> list[Choice]:
        written = ["".join(part.split()) for part in text.split(",") if part.strip()] or [text]
        try:
            return [kind(amount) for amount in dict.fromkeys(written)]
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return parse_amounts


def _modes(text: str) -> list[str]:
    modes = list(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    wrong = [mode for mode in modes if mode not in MODES]
    if wrong or not modes:
        raise argparse.ArgumentTypeError(
            f"there is no mode {wrong[0] if wrong else text!r}; there are {', '.join(MODES)}"
        )
    return modes


def _positive(text: str) -> float:
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"{text!r} is not a number above 0")
    return number


def _resolution(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text, re.ASCII)
    if not found:
        raise argparse.ArgumentTypeError(f"{text!r} is no resolution; give one such as 1280x720")
    return int(found[1]), int(found[2])


def _arguments() -> list[str]:
    """Ours: in Blender what is behind the "--", in Python everything."""
    if Path(sys.argv[0]).name == Path(__file__).name:
        return sys.argv[1:]
    return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []


if __name__ == "__main__":
    try:
        sys.exit(main(_arguments()))
    except KeyboardInterrupt:
        sys.exit(130)
