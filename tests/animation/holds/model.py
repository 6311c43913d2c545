"""Model of props: where their keys, freshly read, put them relative to the displayed holders."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from mathutils import Matrix

from rigid_motion import animation
from rigid_motion.animation.actions.reading import read
from rigid_motion.animation.evaluation.components import PART_OF
from rigid_motion.animation.evaluation.differences import seen_values
from rigid_motion.animation.evaluation.sources import HoldRun, KeyedTransform
from rigid_motion.animation.holds.placing import matrices_of, unevenness_of
from rigid_motion.animation.queries.keyed import active_binding
from rigid_motion.animation.transforms import transform_of
from tests.animation.holds.oracle import mixed
from tests.animation.keyed import Carrier
from tests.animation.oracle import shown_worlds

OVER = 1e-3
"""Tolerance while an object passes to a moving holder: `test_passing` tests the precision of passes."""

HALF_A_TURN = 0.02
"""Between quaternions with a smaller absolute dot product, the rotation may go either way."""


def assert_held(props: Iterable[Carrier], frames: Sequence[float]) -> None:
    """Check that props are displayed where their keys say, to 1e-5 of the largest value, to `OVER` while passing."""
    frames = np.asarray(frames, float)
    for prop in props:
        expected, tolerances = expected_worlds(prop, frames)
        error = np.abs(shown_worlds([prop], frames)[0] - expected).max(axis=(1, 2)) / max(1.0, np.abs(expected).max())
        worst = int((error / tolerances).argmax())
        assert error[worst] < tolerances[worst], f"{prop!r} is off by {error[worst]:.3g} on frame {frames[worst]}"


def poses_in_holders(prop: Carrier, frames: Sequence[float]) -> np.ndarray:
    """Return the matrices of a prop relative to its holder that its channels must produce on frames, (m, 4, 4)."""
    source, frames = read(active_binding(transform_of(prop))), np.asarray(frames, float)
    result = np.empty((len(frames), 4, 4))
    for run in source.runs:
        shown_by = np.array([source.run_at(frame) is run for frame in frames], bool)
        if shown_by.any():
            result[shown_by] = _poses(prop, run if source.switches else source, frames[shown_by])
    return result


def expected_worlds(prop: Carrier, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a prop's expected matrices on frames, (m, 4, 4), and the tolerances as fractions of its size."""
    transform = transform_of(prop)
    source = read(active_binding(transform))
    holders = {holder.number: holder for holder in animation.hold_facts(prop).holders}
    numbers = [source.hold_at(run.stretch.first)[0] for run in source.runs]
    spaces: dict[int, np.ndarray] = {}

    def carried(place: int, chosen: np.ndarray) -> np.ndarray:
        number, run = numbers[place], source.runs[place] if source.switches else source
        if number not in spaces:
            holder = holders.get(number)
            spaces[number] = (
                _spaces(prop, frames)
                if holder is None
                # Its holder moves it, also with changes of the holder's scale.
                else shown_worlds([holder.target.pose.bones[holder.bone] if holder.bone else holder.target], frames)[0]
                @ np.array(holder.offset)
            )
        return spaces[number][chosen] @ _poses(prop, run, frames[chosen])

    result, tolerances = np.empty((len(frames), 4, 4)), np.full(len(frames), 1e-5)
    at = np.searchsorted([run.stretch.until for run in source.runs], frames, side="right")
    for place in np.unique(at).tolist():
        result[at == place] = carried(place, at == place)
    for place, switch in enumerate(source.switches):
        over = (frames > switch.begin) & (frames < switch.frame)
        if over.any():
            share = np.minimum((frames[over] - switch.begin) / (switch.there - switch.begin), 1.0)
            both = carried(place, over), carried(place + 1, over)
            shares = share * share * (3.0 - 2.0 * share)
            result[over] = [mixed(*each) for each in zip(*both, shares, strict=True)]
            turns = ([Matrix(each).to_quaternion() for each in matrices] for matrices in both)
            is_sure = np.abs([one.dot(other) for one, other in zip(*turns, strict=True)]) > HALF_A_TURN
            # Channels have no shear. A prop that passes to a holder of uneven scale is sheared until it arrives.
            holder = holders.get(numbers[place + 1])
            is_even = holder is None or unevenness_of(holder.offset) < 1e-5
            tolerances[over] = np.where(is_sure & is_even, OVER, np.inf)
    return result, tolerances


def _poses(prop: Carrier, run: HoldRun | KeyedTransform, frames: np.ndarray) -> np.ndarray:
    order = np.argsort(frames, kind="stable")
    rows = np.empty((10, len(frames)))
    # A prop that is never passed on may extrapolate before and after its keys.
    rows[:, order] = (
        seen_values(run, frames[order])
        if isinstance(run, KeyedTransform)
        else (seen_values(run.source, run.moments(frames[order])))
    )
    # Unkeyed channels keep their values.
    transform = transform_of(prop)
    source = run if isinstance(run, KeyedTransform) else run.source
    for row, one in enumerate(transform.components().tolist()):
        if PART_OF[row] not in source.keyed:
            rows[row] = one
    return np.array(matrices_of(rows, transform.order))


def _spaces(prop: Carrier, frames: np.ndarray) -> np.ndarray:
    """Return the spaces of the channels without a holder, (m, 4, 4)."""
    if prop != prop.id_data:
        rest = np.array(prop.bone.matrix_local)
        if prop.parent is None:
            return shown_worlds([prop.id_data], frames)[0] @ rest
        return shown_worlds([prop.parent], frames)[0] @ np.linalg.inv(prop.parent.bone.matrix_local) @ rest
    if prop.parent is None:
        return np.tile(np.eye(4), (len(frames), 1, 1))
    return shown_worlds([prop.parent], frames)[0] @ np.array(prop.matrix_parent_inverse)
