"""Joint by joint: the errors of a whole body over time, as pictures with a row for each joint, and in numbers."""

from __future__ import annotations

import base64
import struct
import zlib
from dataclasses import dataclass

import numpy as np

from rigid_motion_batch.analysis.results import ChoiceResult, ClipResult
from rigid_motion_batch.palette import error_hex, full_colour
from rigid_motion_batch.recordings.rest_bodies import short_names

from .numbers import Numbers, digits

COLUMNS = 240
"""Stretches of time that a picture has."""

SHADES = 24


@dataclass(frozen=True)
class Joints:
    """The joints of a body under one choice of keys."""

    place: int
    """Of the clip among those of the page."""

    clip: str
    choice: str
    title: str
    names: list[str]
    top: str
    """The error that is the last colour, in mm."""

    pictures: list[tuple[str, str]]
    """Of each motion its name and its picture, as an address."""

    worst: list[str]
    """Of each motion the joint with the largest error, and that, in mm."""

    slide: str
    """How far a joint that stands on the ground slides in the recording itself, in mm; empty where none stands."""

    rows: list[list[str]]
    """RMS and largest error under each motion, for each joint, in mm."""


def joints_of(place: int, clip: ClipResult, result: ChoiceResult, numbers: Numbers) -> Joints | None:
    """Return the joints of a clip under a choice; None of a single rigid body."""
    motions = [motion for motion in result.motions if motion.joint_errors is not None]
    if not motions:
        return None
    in_metres = [motion.joint_errors for motion in motions if motion.joint_errors is not None]
    errors, top = [1e3 * some for some in in_metres], 1e3 * full_colour(in_metres)
    pictures = [
        (numbers.joined(motion.modes), heat_map(some, top)) for motion, some in zip(motions, errors, strict=True)
    ]
    by_mode = [[row for row in result.joints if row.mode == motion.modes[0]] for motion in motions]
    rows = [
        [digits(1e3 * value) for row in of_joint for value in (row.rms_shell_m, row.max_shell_m)]
        for of_joint in zip(*by_mode, strict=True)
    ]
    names = short_names(clip.facts.joint_names)
    places = [int(np.argmax(some.max(axis=1))) for some in errors]
    worst = [f"{names[joint]} {digits(some[joint].max())} mm" for joint, some in zip(places, errors, strict=True)]
    slid = motions[0].metrics[0].recorded_slide_m
    slide = "" if slid is None else digits(1e3 * slid)
    facts = clip.facts.name, result.choice.name, result.choice.title
    return Joints(place, *facts, names, digits(top), pictures, worst, slide, rows)


def heat_map(errors: np.ndarray, top: float) -> str:
    """Return the errors (joints, n) as the address of a picture, a row for each joint, the colours ending at `top`."""
    count = errors.shape[1]
    begins = np.unique(np.arange(min(COLUMNS, count)) * count // min(COLUMNS, count))
    largest = np.maximum.reduceat(errors, begins, axis=1)
    shades = np.clip(largest / top * SHADES, 0, SHADES - 1).astype(np.uint8)
    palette = bytes.fromhex("".join(error_hex(shade / (SHADES - 1))[1:] for shade in range(SHADES)))
    return f"data:image/png;base64,{base64.b64encode(png(shades, palette)).decode('ascii')}"


def png(pixels: np.ndarray, palette: bytes) -> bytes:
    """Return a picture (rows, columns) of numbers of colours, three bytes each."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    lines = np.pad(pixels, ((0, 0), (1, 0))).tobytes()
    header = struct.pack(">IIBBBBB", pixels.shape[1], pixels.shape[0], 8, 3, 0, 0, 0)
    content = ((b"IHDR", header), (b"PLTE", palette), (b"IDAT", zlib.compress(lines, 9)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*item) for item in content)
