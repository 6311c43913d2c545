"""What is done to the open file: an action on objects and on the bones of rigs, and which of them are meant."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase

import bpy

from rigid_motion.animation.transforms import Transform, transform_of


@dataclass
class Result:
    """What came of acting on several targets."""

    done: list[Transform] = field(default_factory=list)

    refused: dict[Transform, str] = field(default_factory=dict)
    """The reason why each could not be done, and the way out."""

    left: dict[Transform, str] = field(default_factory=dict)
    """The reason why there was nothing to do to each after all."""

    summary: str = ""
    """Text about those that were done; begins with a comma or a semicolon."""

    def refusals(self) -> Iterator[tuple[str, str, int]]:
        """Yield which targets were refused, why, and how many they are:
        all bones of a rig at once where it is the rig's.
        """
        reasons = set(self.refused.values())
        if len(reasons) == 1 < len(self.refused) and not (any(item.is_part for item in self.done) or self.left):
            yield title_of(list(self.refused)), reasons.pop(), len(self.refused)
        else:
            yield from ((target.name, reason, 1) for target, reason in self.refused.items())

    def describe_kept(self) -> str:
        """Return which targets were left as they are, and why; of several bones the reason of one."""
        (first, reason), *others = self.left.items()
        example = f", such as {first.name}" if any(other != reason for _, other in others) else ""
        left = "are left as they are" if others else "is left as it is"
        return f"{title_of(list(self.left))} {left}{example}: {reason}"


@dataclass(frozen=True)
class Action:
    """What is done to targets, such as baking."""

    concerned: Callable[[Sequence[Transform]], list[Transform]]
    """Returns those of several that there is something to do to, possible or not."""

    act: Callable[[Sequence[Transform]], Result]
    """Do it to several of one object, in one go."""

    whole_rigs: bool = False
    """True if the bones of a rig and its own motion are done in one go."""


def groups_of(obj: bpy.types.Object, *, whole_rigs: bool) -> Iterator[list[Transform]]:
    """Yield what is done in one go of an object: all bones of a rig, and with them or after them its own motion.

    The other way round each bone would be compared with what it was in the Action of which a copy is there already.
    """
    bones = [transform_of(bone) for bone in obj.pose.bones] if obj.pose is not None else []
    if bones and not whole_rigs:
        yield bones
        bones = []
    yield [*bones, transform_of(obj)]


def matching(target: Transform, asked: Iterable[str]) -> set[str]:
    """Return the names and patterns that a target fits. Those of a rig mean its bones too,
    and RIG/BONE means a bone.
    """
    return {item for item in asked for name in {target.name, target.animated.name} if _fits(name, item)}


def matching_missing(obj: bpy.types.Object, asked: Iterable[str]) -> set[str]:
    """Return the names and patterns that an object fits, or may have bones for that cannot be looked at."""
    return {item for item in asked if any(_fits(obj.name, part) for part in (item, *_before_slashes(item)))}


def _before_slashes(pattern: str) -> list[str]:
    return [pattern[:place] for place, letter in enumerate(pattern) if letter == "/"]


def _fits(name: str, pattern: str) -> bool:
    return name == pattern or fnmatchcase(name, pattern)


def title_of(targets: Sequence[Transform]) -> str:
    """Return one target by its name, several bones by how many they are of which rig,
    and the rig itself along with them.
    """
    rig, bones = targets[0].animated.name, sum(target.is_part for target in targets)
    if len(targets) == 1:
        return targets[0].name
    return f"{rig}: {bones} bone{'s' if bones > 1 else ''}{' and its own keys' if bones < len(targets) else ''}"
