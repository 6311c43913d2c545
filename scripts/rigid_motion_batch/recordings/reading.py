"""Reading of `FILE`, `FILE:BODY` or `FILE:*` into trajectories: the table of formats, and the choice of format."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from rigid_motion_batch.command_line import did_you_mean

from . import blend, bvh, fbx, gltf, json_logs, optical, plain
from .options import AS_THE_FILE_SAYS, ReadingOptions
from .plausibility import implausibilities
from .recordings import ALL, Recording, Selection, Trajectory, TrajectoryError, shown
from .sizing import sized
from .tables import encoding_of

HEAD_BYTES = 65536
"""Bytes at the start of a file that determine its format."""


@dataclass(frozen=True)
class Format:
    """A file format."""

    label: str
    extensions: tuple[str, ...]
    read: Callable[..., list[Trajectory]]
    """A function of the path, the selection of bodies and, if the format honours any, the options."""

    recognises: Callable[[list[str]], bool] | None = None
    """A function of the first lines. None if the extension is sufficient."""

    honours: tuple[str, ...] = ()
    """The options that it takes, for facts that its files do not state. The scale is applied to all formats; start and
    end are applied when clips are made."""

    measured: bool = True
    """True if it holds measurements of devices, and not animation, which may have any speed."""

    axes: str = "blender"
    """The default axes of its files: a name in `axes.AXES`."""

    in_metres: bool = True
    """True if its files state the unit of a body's length, or the format prescribes it. It may still be wrong."""

    says_unit: bool = True
    """True if the format prescribes a unit of length, or its files always state theirs."""


TEXT = (".csv", ".tsv", ".txt", ".tum", ".chan", ".g2o")
"""Extensions of tables. The content determines the format."""

JSON = (".json",)

VALUE_OPTIONS = ("time_unit", "frame_rate", "euler", "degrees")
TABLE = ("columns", *VALUE_OPTIONS)

# If formats share an extension, the first that recognises the content reads it. The last format takes the rest, and
# reports what is wrong with it.
FORMATS = (
    Format("Motive CSV", TEXT, optical.read_motive, optical.recognises_motive),
    Format("Vicon CSV", TEXT, optical.read_vicon, optical.recognises_vicon, VALUE_OPTIONS),
    Format("Qualisys TSV", TEXT, optical.read_qualisys, optical.recognises_qualisys, VALUE_OPTIONS),
    Format("COLMAP images", TEXT, plain.read_images, plain.recognises_images, VALUE_OPTIONS, says_unit=False),
    Format("g2o graph", TEXT, plain.read_graph, plain.recognises_graph, VALUE_OPTIONS, says_unit=False),
    Format("rows of numbers (TUM, KITTI)", TEXT, plain.read_rows, plain.recognises_rows, TABLE, says_unit=False),
    Format("CSV with named columns", TEXT, plain.read_named, honours=TABLE, says_unit=False),
    Format("JSON", JSON, json_logs.read, honours=TABLE, says_unit=False),
    Format("BVH", (".bvh",), bvh.read, axes=bvh.AXES, in_metres=False),
    Format("FBX", (".fbx",), fbx.read, honours=("scale",), measured=False),
    Format("glTF", gltf.ENDINGS, gltf.read, honours=("scale",), measured=False),
    Format("Blender file", (".blend",), blend.read, honours=("scale",), measured=False),
)

ENDINGS = tuple(dict.fromkeys(extension for known in FORMATS for extension in known.extensions))

OTHER_FORMATS = {
    ".abc .usd .usda .usdc .usdz": "open it in Blender, and name the .blend",
    ".amc .asf .mvnx": "convert it to BVH or FBX",
    ".bag": "export the poses: rostopic echo -b FILE -p /TOPIC > poses.csv",
    ".bin": "of COLMAP, export text: colmap model_converter --output_type TXT",
    ".c3d .trc": "it holds markers: export bodies or a skeleton, as CSV, BVH or FBX",
    ".dat .log": "if it is a table or rows of numbers, call it .txt",
    ".db3 .mcap": "export the poses as CSV, such as by PlotJuggler",
    ".h5 .hdf5 .mat .npy .npz .pkl": "write the poses as a table: t,x,y,z,qx,qy,qz,qw",
    ".ods .xls .xlsx": "save the sheet as CSV",
    ".ulg": "make tables of it: ulog2csv FILE",
}
"""Advice for files of other programs that cannot be read, by extension."""

MOST_NAMES = 10_000
"""Names in a folder that are searched for similar ones."""


def read_trajectories(source: str, options: ReadingOptions = AS_THE_FILE_SAYS) -> Recording:
    """Read a recording.

    Parameters
    ----------
    source : str
        A path; with `:BODY` after it for one body by name, with `:*` for all bodies. A path alone selects one body: the
        first, such as the first animated object of a .blend, an FBX or a glTF, or the whole skeleton of a BVH, an FBX,
        a glTF, or an armature whose bones move.
    options : ReadingOptions
        Facts that the file does not state.

    Returns
    -------
    Recording
        The trajectories as recorded, the names of the other bodies, and remarks.

    Raises
    ------
    TrajectoryError
        One line: the file, the line in it, what is wrong and the way out. Also if no body has two samples, an option
        does not apply to the format, or a recording cannot be meant as it is read.

    Notes
    -----
    Tables take memory for their numbers and not for their text, JSON up to 30 times its size. Files beyond the limits
    in `tables`, `bvh` and `json_logs` are refused. Blender itself reads .blend and FBX files, and may crash on a
    damaged one: to be safe from that, read them in a separate process.
    """
    path, body = split_source(source)
    selection = Selection(path, body)
    try:
        result = format_of(path)
        trajectories = _read(result, path, selection, options)
    except OSError as error:
        problem = f"this file cannot be read ({error.strerror})"
        raise TrajectoryError(path, problem, "check its permissions") from None
    if all(len(trajectory.times) < 2 for trajectory in trajectories):
        problem = ", ".join(f"{shown(item.name)} has {len(item.times)} samples" for item in trajectories[:3])
        raise TrajectoryError(path, problem, "a trajectory needs at least 2")
    own = trajectories[0].axes
    recording = replace(selection.recording(trajectories), measured=result.measured)
    return replace(recording, axes=own or result.axes, axes_known=bool(own))


def read_all_singles(source: str, options: ReadingOptions = AS_THE_FILE_SAYS) -> Recording:
    """Read all bodies of a file if none is named and the first is not a whole body; else as `read_trajectories`."""
    recording = read_trajectories(source, options)
    if recording.others and not recording.body and recording.trajectories[0].rest_body is None:
        return read_trajectories(f"{recording.path}:{ALL}", options)
    return recording


def _read(result: Format, path: Path, selection: Selection, options: ReadingOptions) -> list[Trajectory]:
    for name in options.given:
        if name not in ("scale", "start", "end", "clean") and name not in result.honours:
            problem = f"--{name.replace('_', '-')} means nothing to {result.label}"
            raise TrajectoryError(path, problem, "leave it out, as its files say that themselves")
    trajectories = result.read(path, selection, options) if result.honours else result.read(path, selection)
    if options.scale is not None:
        trajectories = [replace(trajectory, metres_per_unit=options.scale) for trajectory in trajectories]
    else:
        trajectories = [sized(path, item, result.axes, unit_given=result.in_metres) for item in trajectories]
    if not result.measured:
        return trajectories
    takes_unit = "time_unit" in result.honours
    found = [implausibilities(trajectory, time_unit=takes_unit and not trajectory.dated) for trajectory in trajectories]
    return [replace(item, warnings=(*item.warnings, *more)) for item, more in zip(trajectories, found, strict=True)]


def files_of(source: str) -> list[str]:
    """Return the source itself or, for a folder, its files that may be recordings, sorted by name."""
    try:
        if not os.path.isdir(source):
            return [source]
        names = sorted(entry.name for entry in os.scandir(source) if entry.is_file())
    except (OSError, ValueError):
        return [source]  # Reading it will raise the error.
    return [os.path.join(source, name) for name in names if name.lower().endswith(ENDINGS)] or [source]


def split_source(source: str) -> tuple[Path, str | None]:
    """Return the file and the name of the body. Both may contain colons, as may a Windows drive.

    Raises
    ------
    TrajectoryError
        If neither `source` nor any part of it before a colon is a file.
    """
    colons = [index for index, character in enumerate(source) if character == ":"]
    for end in [len(source), *reversed(colons)]:
        # The "C" of "C:\take.csv" is a drive, even if the current folder has a file of that name.
        drive = end == 1 and source[:1].isalpha() and source[2:3] in ("\\", "/")
        if not drive and os.path.isfile(source[:end]):
            return Path(source[:end]), source[end + 1 :] if end < len(source) else None
    for end in [len(source), *reversed(colons)]:
        if result := _problem_of_path(source[:end]):
            raise TrajectoryError(source[:end], *result)
    raise TrajectoryError(source, f"no such file{_similar_name(source)}", "check the path")


def _similar_name(source: str) -> str:
    """Return a hint at a similar file name in the folder of a missing file, or an empty text."""
    folder, name = os.path.split(source)
    with suppress(OSError, ValueError), os.scandir(folder or ".") as entries:
        names = [entry.name for entry in islice(entries, MOST_NAMES) if entry.name.lower().endswith(ENDINGS)]
        return did_you_mean(name, names) or did_you_mean(name.partition(":")[0], names)
    return ""


def _problem_of_path(path: str) -> tuple[str, str] | None:
    """Return the problem and the way out for an existing path that is not a file, else None. The path is not opened."""
    if os.path.isdir(path):
        return "this is a folder without recordings", "name a file, or a folder that has some"
    if os.path.exists(path) and not os.path.isfile(path):
        return "this is a pipe or a device, not a file", "write what comes out of it to a file, and name that"
    if os.path.islink(path):
        return f"this is a symbolic link to {shown(os.readlink(path))}, where nothing is", "name the file itself"
    return None


def format_of(path: Path) -> Format:
    """Return the format of a file, chosen by extension and, if several formats share that, by its first lines."""
    candidates = [known for known in FORMATS if path.suffix.lower() in known.extensions]
    if not candidates:
        problem = f"unknown extension {shown(path.suffix)}"
        ways = [way for endings, way in OTHER_FORMATS.items() if path.suffix.lower() in endings.split()]
        raise TrajectoryError(path, problem, ways[0] if ways else f"known are {', '.join(ENDINGS)}")
    if len(candidates) > 1:
        with path.open("rb") as file:
            head = file.read(HEAD_BYTES)
        lines = head.decode(encoding_of(head), errors="replace").splitlines() or [""]
        for candidate in candidates[:-1]:
            if candidate.recognises and candidate.recognises(lines):
                return candidate
    return candidates[-1]
