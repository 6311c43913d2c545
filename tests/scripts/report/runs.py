"""Results of comparisons, for tests of the report."""

from collections.abc import Sequence
from dataclasses import replace

from rigid_motion_batch.analysis.choices import EVERYWHERE, Choice, Uniform
from rigid_motion_batch.analysis.modes import COMPARED
from rigid_motion_batch.analysis.results import ClipResult, clip_result
from rigid_motion_batch.recordings.clips import Clip, ClipWarning
from tests.scripts.clips.recordings import compare_clip

MODES = COMPARED
RATES = tuple(map(Uniform, ("5", "10", "15", "20")))


def result_of(
    clip: Clip,
    choices: Sequence[Choice] = RATES,
    modes: Sequence[str] = MODES,
    *,
    warnings: Sequence[ClipWarning] = (),
) -> ClipResult:
    """Return the results of the analysis of a clip, for some choices of keys."""
    result = [compare_clip(clip, choice, modes, EVERYWHERE) for choice in choices]
    return clip_result(replace(clip, warnings=(*clip.warnings, *warnings)), [item for item in result if item])
