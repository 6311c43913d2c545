"""Baking and unbaking the objects and bones of the open file, for `bake.py`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence

from rigid_motion import animation
from rigid_motion.animation import Refused
from rigid_motion.animation.actions.reading import modes_said
from rigid_motion.animation.actions.slots import Binding, bindings_of
from rigid_motion.animation.evaluation.sources import Marks
from rigid_motion.animation.queries.keyed import frames_in, segment_modes
from rigid_motion.animation.transforms import Transform
from rigid_motion.motion import KEYFRAME_MODES
from rigid_motion_batch.keying.jobs import Operation, Result

MAX_NAMED_BONES = 4
"""The most bones that are named; of more, only the count is given."""


def baking(step: float, interpolation: str) -> Operation:
    """Return the operation that bakes keys with this interpolation on every `step` frames."""

    def bake(targets: Sequence[Transform]) -> Result:
        problems = {target: problem for target in targets if (problem := animation.problem_of(target))}
        fit = [target for target in targets if target not in problems]
        modes, refusals = modes_of(fit), list[Refused]()
        begin, end = (
            animation.bake(fit, step=step, interpolation=interpolation, refused=refusals) if fit else (0.0, 0.0)
        )
        return _result(targets, modes, problems | _by_target(refusals, fit), f", frames {begin:g} to {end:g}")

    return Operation(with_rigid_segments, bake)


def unbaking() -> Operation:
    """Return the operation that restores the keys from before baking."""

    def unbake(targets: Sequence[Transform]) -> Result:
        refusals: list[Refused] = []
        animation.unbake(targets, refused=refusals)
        return _result(targets, modes_of(targets), _by_target(refusals, targets))

    return Operation(lambda targets: list(filter(animation.is_baked, targets)), unbake)


def _result(
    targets: Sequence[Transform], modes: Mapping[Transform, str], problems: Mapping[Transform, str], span: str = ""
) -> Result:
    done = {target: modes[target] for target in targets if target not in problems}
    refused = {target: text.removeprefix(f"{target.name}: ") for target, text in problems.items()}
    return Result(list(done), refused, summary=f"{span}{described(done)}")


def _by_target(refusals: Iterable[Refused], targets: Sequence[Transform]) -> dict[Transform, str]:
    """Return the refusal of each target. A refusal begins with the target's name; the longest matching name counts."""
    longest_first = sorted(targets, key=lambda target: -len(target.name))
    result = {}
    for text in map(str, refusals):
        target = next(item for item in longest_first if item not in result and text.startswith(item.name))
        result[target] = text
    return result


def with_rigid_segments(targets: Sequence[Transform]) -> list[Transform]:
    """Return the targets with a segment that does not use Blender's own in-betweens, whether or not it can be baked."""
    rigid = {user for place in bindings_of(targets) if _has_rigid_segments(place) for user in place.users}
    return [target for target in targets if target in rigid]


def _has_rigid_segments(binding: Binding) -> bool:
    """Return whether a segment of a slot has another mode than Blender's own, even an unknown one."""
    modes = modes_said(binding)
    if isinstance(modes, Marks):
        return bool(modes.numbers[:-1].any())
    return modes != 0 and len(frames_in(binding)) > 1


def modes_of(targets: Sequence[Transform]) -> dict[Transform, str]:
    """Return the modes of each target's segments, once each, as Blender's menus show them."""
    modes: dict[Transform, dict[str, None]] = {target: {} for target in targets}
    for place in bindings_of(targets):
        for user in place.users:
            if user in modes:
                modes[user] |= dict.fromkeys(segment_modes(place))
    return {
        target: ", ".join(KEYFRAME_MODES[mode].label if mode in KEYFRAME_MODES else "Blender" for mode in result)
        for target, result in modes.items()
    }


def described(modes: Mapping[Transform, str]) -> str:
    """Return text on the modes of targets: that of a single one, or of several bones by mode, named if they are few."""
    if len(modes) == 1:
        return f", {next(iter(modes.values()))}"
    if len(modes) > MAX_NAMED_BONES:
        return "".join(f"; {count} {mode}" for mode, count in Counter(modes.values()).most_common())
    bones: dict[str, list[str]] = {}
    for target, mode in modes.items():
        bones.setdefault(mode, []).append(target.carrier.name)
    return "".join(f"; {mode}: {', '.join(names)}" for mode, names in bones.items())
