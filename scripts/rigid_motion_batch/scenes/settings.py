"""Settings of comparison scenes: how to show a comparison, and which object. Usable before Blender is loaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from rigid_motion_batch.places import ASSETS

ENGINES = ("workbench", "eevee", "cycles")
ANTIALIASING = ("OFF", "FXAA", "5", "8", "11", "16", "32")

MODELS_FILE = ASSETS / "models.blend"
MODELS = {"drill": "Drill", "controller": "Controller"}


@dataclass(frozen=True)
class SceneSettings:
    """The display settings of a comparison."""

    engine: str = "workbench"
    """One of `ENGINES`."""

    resolution: tuple[int, int] = (960, 540)
    """Width and height in pixels, even because the codec requires it."""

    fps: int = 30

    slow_motion: float = 1.0
    """The factor by which the film is slower than real time."""

    subject: str = "drill"
    """The object that moves: "drill", "controller" or "file.blend:Name"."""

    antialiasing: str | None = None
    """The antialiasing of Workbench: one of `ANTIALIASING`; numbers are samples.

    By default, a graphics card draws 8 samples, if Blender can tell that there is one (5.2 and later). Without one,
    the compositor smooths edges (SMAA), which takes a tenth of the time of FXAA.
    """

    samples: int = 16
    """The samples of EEVEE and Cycles."""

    theme: str = "dark"
    """One of `palette.THEMES`."""

    deviation: float | None = None
    """The factor that magnifies a mode's deviation from the recording; None chooses a suitable one."""

    distinct: bool = False
    """True if modes with identical motion share a lane."""

    def __post_init__(self) -> None:
        """Raise ValueError for values that the command line's options do not check."""
        if min(self.resolution) < 2 or any(size % 2 for size in self.resolution):
            raise ValueError(f"resolution {self.resolution[0]}x{self.resolution[1]}: give two even numbers of pixels")
        if self.deviation is not None and not 1.0 <= self.deviation <= 1000.0:
            raise ValueError(f"deviations {self.deviation:g} times as large: give 1 to 1000")


class SubjectError(ValueError):
    """The object to show cannot be loaded. The message says why, in one line."""


def place_of_subject(requested: str) -> tuple[Path, str]:
    """Return the file of an object, which need not exist, and the object's name in the file.

    Parameters
    ----------
    requested : str
        A key of `MODELS`, or "file.blend:Name".

    Raises
    ------
    SubjectError
        If the request names no object.
    """
    if requested in MODELS:
        return MODELS_FILE, MODELS[requested]
    file, colon, name = requested.rpartition(":")
    if not colon or not file.lower().endswith(".blend"):
        raise SubjectError(f"object {requested!r}: give {', '.join(MODELS)} or file.blend:Name")
    return Path(file), name
