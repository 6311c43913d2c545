"""A whole body in the report: its errors over time, joint by joint, and what it looks like where they are largest.

Everything is SVG, sharp at any size; a heat map is a path for each of its colours. Errors are in millimetres.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from rigid_motion.motion import Poses
from rigid_motion.motion.quaternions import rotate
from rigid_motion_batch.analysis.body_metrics import MeasuredBody, ModeOfBody, key_samples
from rigid_motion_batch.axes import to_blender
from rigid_motion_batch.palette import ERROR_COLOURS, error_hex, full_colour
from rigid_motion_batch.recordings.figures import carrying, short_names

from .charts import nice_ticks
from .elements import heading, label, number_cell, rounded, swatch, table
from .error_charts import error_curves
from .markup import Content, Markup, element

SHADES = 24
"""Of a heat map."""

ROW = 11
"""The height of a joint in a heat map, in pixels."""

MOST_ROWS = 80
"""Joints that have a name beside the heat map: more get rows as thin as fit the same height."""

LETTER = 5.6
"""How wide one of a joint's name is, in pixels."""

LONGEST_NAME = 26
"""Letters of a joint's name beside the heat map."""

FIGURE_HEIGHT = 1000
"""Of a picture of the body, in its own units."""

TIMES_LARGER = 1.12
"""The room that a picture of the body has, relative to the body."""

NARROWEST = 0.1
"""How wide such a picture is at least, relative to its height, and how high relative to its width."""


def body_curves(measured: MeasuredBody) -> Markup:
    """The largest error of any joint over time, under each mode."""
    made = measured.made
    start = made.samples.start
    firsts = [group[0] for group in measured.groups]
    return error_curves(
        f"{made.clip.name}/{made.choice.name}",
        made.times - made.times[0],
        {mode: measured.modes[mode].over_time * 1e3 for mode in firsts},
        measured.groups,
        {mode: key_samples(made.keys[mode]) - start for mode in firsts},
        alike=made.choice.decimation == "uniform",
        measured="error of the worst joint",
    )


def body_charts(measured: MeasuredBody) -> Markup:
    """Which joint is how far off and when, the body at the worst moment of each mode, and the numbers of all joints."""
    modes = {group: measured.modes[group[0]] for group in measured.groups}
    top = 1e3 * full_colour(mode.by_joint for mode in modes.values())
    largest = 1e3 * max(float(mode.by_joint.max()) for mode in modes.values())
    return element(
        "div",
        element("h4", "Where each mode is off the most"),
        element(
            "p",
            "The body at the sample with the largest error, in colour, over the recording, in grey; a ring around the "
            "joint.",
            class_="note",
        ),
        element("div", list(_figures(measured, modes, top)), class_="figures"),
        element("h4", "Error of each joint over time"),
        _colour_bar(top, largest),
        element("div", [_heat_map(measured, group, mode, top) for group, mode in modes.items()], class_="heat-maps"),
        element(
            "details", element("summary", "The numbers of all joints"), _numbers_of_joints(measured), class_="joints"
        ),
        class_="body",
    )


# -- heat maps --------------------------------------------------------------------------------------------------------


def _heat_map(measured: MeasuredBody, group: tuple[str, ...], mode: ModeOfBody, top: float) -> Markup:
    """A row for each joint, in the order of the skeleton, and a column for each stretch of time."""
    return element(
        "figure",
        element(
            "div",
            _heat_drawing(measured, group, mode, top, width="100%"),
            class_="heat-map",
            style=f"--gutter:{_gutter(measured):.0f}px",
        ),
        element("figcaption", swatch(group[0]), " = ".join(map(label, group))),
    )


def heat_map_alone(measured: MeasuredBody, mode: str, width: int = 900) -> Markup:
    """The heat map of a mode as an SVG file, of so many pixels; the colours are those of the report."""
    modes = {group: measured.modes[group[0]] for group in measured.groups}
    group = next(group for group in modes if mode in group)
    top = 1e3 * full_colour(own.by_joint for own in modes.values())
    gutter = _gutter(measured)
    room = width - gutter - 20.0
    drawing = _heat_drawing(measured, group, modes[group], top, width=f"{room:.0f}", x=f"{gutter:.0f}", y=4)
    height = ROW * min(len(modes[group].by_joint), MOST_ROWS) + 48
    bar = [
        element("rect", x=f"{gutter + 30 + 6 * step}", y=height - 16, width=6, height=9, fill=error_hex(step / SHADES))
        for step in range(SHADES + 1)
    ]
    words = [
        element("text", "0", x=f"{gutter + 24:.0f}", y=height - 8, text_anchor="end"),
        element("text", f"{rounded(top)} mm", x=f"{gutter + 36 + 6 * (SHADES + 1):.0f}", y=height - 8),
    ]
    return element(
        "svg",
        element("style", "text { font: 9.5px sans-serif; fill: #768390 }"),
        drawing,
        bar,
        words,
        xmlns="http://www.w3.org/2000/svg",
        width=width,
        height=height,
    )


def _names_beside(measured: MeasuredBody) -> list[str]:
    """What the rows of a heat map are called; nothing where they are too many."""
    joints = short_names(measured.made.clip.figure.joints)
    return joints if len(joints) <= MOST_ROWS else []


def _gutter(measured: MeasuredBody) -> float:
    """The room that these take, in pixels."""
    return 8 + LETTER * max((len(_cut(name)) for name in _names_beside(measured)), default=0)


def _heat_drawing(
    measured: MeasuredBody, group: tuple[str, ...], mode: ModeOfBody, top: float, **place: Content
) -> Markup:
    errors = mode.by_joint * 1e3
    rows, columns = errors.shape
    height = ROW * min(rows, MOST_ROWS)
    names = _names_beside(measured)
    duration = float(measured.made.times[-1] - measured.made.times[0])
    ticks = nice_ticks(0.0, duration)
    title = f"Error of each joint under {' = '.join(map(label, group))}"
    return element(
        "svg",
        element("title", title),
        element(
            "svg",
            element("path", d=f"M0 0h{columns}v{rows}h-{columns}z", fill=error_hex(0.0)),
            [element("path", d=path, fill=error_hex(shade)) for shade, path in _shades(errors / top)],
            viewBox=f"0 0 {columns} {rows}",
            width="100%",
            height=height,
            preserveAspectRatio="none",
            shape_rendering="crispEdges",
        ),
        [
            element(
                "rect",
                element("title", f"{name}: {rounded(float(own.max()))} mm at most"),
                x=0,
                y=ROW * row,
                width="100%",
                height=ROW,
                fill="transparent",
            )
            for row, (name, own) in enumerate(zip(names, errors, strict=bool(names)))
        ],
        [
            element("text", _cut(name), x=-6, y=ROW * row + ROW - 2.5, text_anchor="end")
            for row, name in enumerate(names)
        ],
        [
            element("text", f"{tick:g}", x=f"{100.0 * tick / duration:.2f}%", y=height + 13, text_anchor="middle")
            for tick in ticks.tolist()
        ],
        element("text", "s", x="100%", y=height + 13, dx=8),
        role="img",
        class_="heat",
        **place,
        height=height + 18,
        overflow="visible",
    )


def _shades(shares: np.ndarray) -> Iterator[tuple[float, str]]:
    """The shade and the path of the cells that have it, of all shades but the lowest; cells side by side are one."""
    shades = np.clip(np.floor(shares * SHADES), 0, SHADES - 1).astype(int)
    for shade in range(1, SHADES):
        cells = np.zeros((shades.shape[0], shades.shape[1] + 2), dtype=np.int8)
        cells[:, 1:-1] = shades == shade
        edges = np.diff(cells, axis=1)
        rows, firsts = np.nonzero(edges == 1)
        _, ends = np.nonzero(edges == -1)
        if len(rows):
            runs = zip(firsts.tolist(), rows.tolist(), (ends - firsts).tolist(), strict=True)
            yield shade / (SHADES - 1), "".join(f"M{left} {row}h{run}v1h-{run}z" for left, row, run in runs)


def _colour_bar(top: float, largest: float) -> Markup:
    beyond = f" and beyond, to {rounded(largest)}" if largest > 1.005 * top else ""
    return element(
        "p",
        "0 ",
        element("i", class_="colour-bar", style=f"--colours:{','.join(ERROR_COLOURS)}"),
        f" {rounded(top)} mm{beyond}",
        class_="note",
    )


def _cut(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


# -- the body at the worst moments ------------------------------------------------------------------------------------


def _figures(measured: MeasuredBody, modes: Mapping[tuple[str, ...], ModeOfBody], top: float) -> Iterator[Markup]:
    """A picture for each motion, all of one scale."""
    drawn = {group: _Drawn.of(measured, mode) for group, mode in modes.items()}
    extent = TIMES_LARGER * np.max([one.extent for one in drawn.values()], axis=0)
    extent = np.maximum(extent, NARROWEST * max(float(extent.max()), 1e-9))
    names = short_names(measured.made.clip.figure.joints)
    for group, one in drawn.items():
        joint, sample, error = modes[group].worst
        at = measured.made.times[sample] - measured.made.times[0]
        said = f"{names[joint]} {rounded(1e3 * error)} mm at {at:.2f} s"
        yield element(
            "figure",
            element("figcaption", swatch(group[0]), " = ".join(map(label, group))),
            one.drawing(f"{' = '.join(map(label, group))}: {said}", modes[group], joint, extent, top),
            element("p", said),
        )


class _Drawn:
    """A body and the recording at one moment, flat: metres to the right and up, around the middle of both."""

    def __init__(self, bones: np.ndarray, truth: np.ndarray, parents: np.ndarray) -> None:
        middle = (np.minimum(bones.min(axis=(0, 1)), truth.min(axis=(0, 1))) + bones.max(axis=(0, 1))) / 2.0
        self.bones, self.truth, self.parents = bones - middle, truth - middle, parents
        """Where each bone begins and ends, shape (joints, 2, 2)."""

    @classmethod
    def of(cls, measured: MeasuredBody, mode: ModeOfBody) -> _Drawn:
        clip = measured.made.clip
        truth = to_blender(mode.truth, clip.axes)
        flat = truth.positions[:, :2] - truth.positions[:, :2].mean(axis=0)
        # From the side on which the body is widest.
        right = np.linalg.eigh(flat.T @ flat)[1][:, 1]
        right = right if right[0] >= 0.0 else -right
        seen = np.stack((np.append(right, 0.0), (0.0, 0.0, 1.0)), axis=-1)
        tails = to_blender(Poses(clip.figure.tails, np.tile((1.0, 0.0, 0.0, 0.0), (len(flat), 1))), clip.axes)

        def bones(poses: Poses) -> np.ndarray:
            ends = poses.positions + rotate(poses.quaternions, tails.positions * clip.metres_per_unit)
            return np.stack((poses.positions @ seen, ends @ seen), axis=1)

        return cls(bones(to_blender(mode.shown, clip.axes)), bones(truth), clip.figure.parents)

    @property
    def extent(self) -> np.ndarray:
        """Twice as far as anything is from the middle, to the side and up, shape (2,)."""
        return 2.0 * np.max([np.abs(one).max(axis=(0, 1)) for one in (self.bones, self.truth)], axis=0)

    def drawing(self, title: str, mode: ModeOfBody, worst: int, extent: np.ndarray, top: float) -> Markup:
        """With a window of this extent around the middle, shape (2,)."""
        scale = FIGURE_HEIGHT / extent[1]
        children = np.bincount(self.parents[self.parents >= 0], minlength=len(self.parents))
        carries = carrying(self.parents)

        def at(point: np.ndarray) -> str:
            return f"{scale * point[0]:.0f} {-scale * point[1]:.0f}"

        def lines(bones: np.ndarray, joint: int) -> str:
            """The bone of a joint, and what joins it to its parent."""
            begin, end = bones[joint]
            parent = self.parents[joint]
            linked = f"M{at(bones[parent, 0])}L{at(begin)}" if parent >= 0 and not carries[parent] else ""
            return linked + ("" if children[joint] else f"M{at(begin)}L{at(end)}")

        joints = range(len(self.bones))
        right, up = scale * self.bones[worst, 0]
        ghost = element("path", d="".join(lines(self.truth, joint) for joint in joints), class_="ghost")
        bones = [
            element("path", d=path, class_="bone", stroke=error_hex(min(1e3 * float(mode.errors[joint]) / top, 1.0)))
            for joint in joints
            if (path := lines(self.bones, joint))
        ]
        width = round(scale * extent[0])
        return element(
            "svg",
            element("title", title),
            ghost,
            bones,
            element("circle", cx=f"{right:.0f}", cy=f"{-up:.0f}", r=38, class_="ring"),
            viewBox=f"{-width // 2} {-FIGURE_HEIGHT // 2} {width} {FIGURE_HEIGHT}",
            role="img",
            class_="stick-figure",
        )


# -- numbers ----------------------------------------------------------------------------------------------------------


def _numbers_of_joints(measured: MeasuredBody) -> Markup:
    """RMS and largest error of every joint under each motion."""
    by_mode = {group[0]: [row for row in measured.joints if row.mode == group[0]] for group in measured.groups}
    head = [heading("Joint", "text")]
    for mode in by_mode:
        head += [heading(f"{label(mode)}, RMS", "number", "mm"), heading("largest", "number", "mm")]
    body: list[Markup] = []
    for joint, name in enumerate(measured.made.clip.figure.joints):
        cells: list[Content] = [element("th", name, scope="row", data_value=name)]
        for rows in by_mode.values():
            for value in (1e3 * rows[joint].rms_shell_m, 1e3 * rows[joint].max_shell_m):
                cells.append(number_cell(value, rounded(value), best=False))
        body.append(element("tr", cells))
    clip, choice = measured.made.clip, measured.made.choice
    return table(f"Shell error of the joints of {clip.name} {choice.phrase}", head, body)
