"""Steps of the editing state machine for keys on paths: edits in world space, of timing and of speed."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
from hypothesis import strategies as st
from mathutils import Euler, Matrix

from rigid_motion import animation
from rigid_motion.animation.edits.path_keys import KeyEdits, KeySpaces, delete_keys, insert_key
from rigid_motion.animation.edits.path_tangents import SIDE_AFTER, SIDE_BEFORE, TangentEdit
from rigid_motion.animation.edits.speed import EASES
from rigid_motion.animation.evaluation.marks import near
from rigid_motion.animation.transforms import transform_of
from rigid_motion.motion.affine import AffineMaps
from tests.animation.body_oracle import DEPENDS_ON_KEYS, location_axes
from tests.animation.keyed import WIDTHS, key_frames, mode_at, moving_curves, moving_in, transform_paths
from tests.animation.machine import TURNS, Name, seeds, shares, while_on
from tests.animation.oracle import assert_near, shown_worlds
from tests.animation.tool_steps import WithTools

VALUE_AND_SETTINGS = 1, *range(6, 14)
"""Indices of the fields of a key in a snapshot."""

NOT_EVENED = "passes from hand to hand", "no two keys", "only some channels have a key", "does not move"


def assert_keys_at(before: dict, after: dict, moved: Callable[[float], float], settings: tuple[int, ...]) -> None:
    """Check that all keys moved to the expected frames (None if deleted), with these of their fields unchanged."""
    for channel, (*rest, keys) in before.items():
        moves = channel[0] in WIDTHS or channel == TURNS
        kept = [(key, x) for key in keys if (x := moved(key[0]) if moves else key[0]) is not None]
        *rest_now, now = after.get(channel, (*rest, ()))
        assert rest_now == rest
        assert len(now) == len(kept), f"{channel} has {len(now)} keys instead of {len(kept)}"
        for key, (old, x) in zip(now, kept, strict=True):
            assert abs(key[0] - x) < 1e-4, f"a key of {channel} is on {key[0]} instead of {x}"
            assert [key[field] for field in settings] == [old[field] for field in settings]
    assert after.keys() <= before.keys()


class WithPaths(WithTools):
    """An animator who also edits keys on paths."""

    @while_on(
        who=shares,
        which=st.sets(st.integers(0, 5), min_size=1),
        how=st.sampled_from(("move", "turn", "retime", "insert", "delete")),
        by=st.sampled_from((-3.0, 0.25, 2.0, 60.0)),
        is_free=st.booleans(),
        seed=seeds,
    )
    def edit_keys_on_its_path(self, who, which, how, by, is_free, seed):
        name, frame, random = self._named(who), bpy.context.scene.frame_current_final, np.random.default_rng(seed)
        obj, keys = self._found(name), key_frames(self._found(name))
        chosen = near(keys, np.array(self._chosen(name, which)))
        if not chosen.any() or self._sharing(name) != {name}:
            return
        if is_free:
            self._edit(lambda: self._free_handles(name))
        spaces = self._spaces(name, keys[chosen])
        if spaces is None:
            return
        delta = Matrix.Translation(random.normal(size=3))
        delta = np.array(delta @ Euler(random.normal(size=3)).to_matrix().to_4x4() if how == "turn" else delta)
        stay = self._frames_that_stay(name, how, chosen, is_free=is_free)
        before, poses, worlds = self._keyed()[name], self._expected(name, stay), shown_worlds([obj], keys)[0]
        is_possible = how in ("insert", "delete") or any(moving_in(obj, path) for path in transform_paths(obj)[:2])
        refused: list[animation.Refused] = []

        def is_chosen(x: float) -> bool:
            return bool(near(np.array([x]), keys[chosen])[0])

        def change() -> None:
            nonlocal by
            transform = transform_of(self._found(name))
            if how == "insert":
                insert_key(transform, frame)
            elif how == "delete":
                delete_keys({transform: keys[chosen]}, refused=refused)
            else:
                edits = KeyEdits({transform: spaces}, refused=refused)
                if how == "retime" and not refused:
                    by = edits.retime(by)
                elif not refused:
                    edits.move(lambda _: delta)

        self._edit(change)
        obj, after = self._found(name), self._keyed()[name]
        assert not refused or not is_possible
        if refused:
            assert after == before
            return
        if how == "retime":
            assert_keys_at(before, after, lambda x: x + by * is_chosen(x), VALUE_AND_SETTINGS)
        elif how == "delete":
            assert_keys_at(before, after, lambda x: None if is_chosen(x) else x, VALUE_AND_SETTINGS)
        elif how in ("move", "turn") and self._is_whole(name):
            # Where other keys lack a channel, that channel is on its way to the chosen keys.
            kept = chosen | (len(self._timings(name)) == 1)
            there = np.where(chosen[:, None, None], delta @ worlds, worlds)[kept]
            (now,) = shown_worlds([obj], keys[kept])
            # In a space of uneven scale, a key cannot be turned exactly in the world. It comes as near as it can.
            scales = np.swapaxes(spaces.maps.axes, 1, 2) @ spaces.maps.axes
            is_even = np.allclose(scales, scales[:, :1, :1] * np.eye(3), atol=1e-5 * np.abs(scales).max())
            columns = slice(0 if is_even or how == "move" else 3, 4)
            assert_near(now[:, :3, columns], there[:, :3, columns], name)
        assert_near(self._expected(name, stay), poses, name, 1e-3 if how == "insert" else 1e-5)

    @while_on(
        who=shares,
        which=seeds,
        side=st.sampled_from((SIDE_BEFORE, SIDE_AFTER)),
        slope=st.sampled_from((0.0, 0.4, 1.0, 2.5)),
    )
    def set_its_speed_at_a_key(self, who, which, side, slope):
        """The keys stay, and so does all of the motion except on one side of one key."""
        name = self._named(who)
        keys = key_frames(self._found(name))
        if len(keys) < 2 or self._sharing(name) != {name}:
            return
        number = which % len(keys)
        other = number + (1 if side == SIDE_AFTER else -1)
        first, last = sorted(keys[[number, min(max(other, 0), len(keys) - 1)]])
        stay = np.union1d(np.arange(keys[0], keys[-1], 0.5), keys)
        stay = stay[(stay <= first) | (stay >= last)]
        before, poses = self._keyed()[name], self._expected(name, stay)
        refused: list[animation.Refused] = []

        def change() -> None:
            edits = TangentEdit(transform_of(self._found(name)), keys[number], side, refused=refused)
            if edits:
                edits.apply(slope)

        self._edit(change)
        after = self._keyed()[name]
        if refused:
            assert after == before
            return
        assert_keys_at(before, after, lambda x: x, (1, 7, 8, 9, 12, 13))
        assert_near(self._expected(name, stay), poses, name)

    def _free_handles(self, name: Name) -> None:
        for fcurve in moving_curves(self._found(name)):
            for point in fcurve.keyframe_points:
                point.handle_left_type = point.handle_right_type = "FREE"
            fcurve.update()

    def _timings(self, name: Name) -> set[tuple[float, ...]]:
        """Return the different sets of key frames that the channels have."""
        curves = moving_curves(self._found(name))
        return {tuple(np.round([key.co[0] for key in curve.keyframe_points], 4)) for curve in curves}

    def _is_whole(self, name: Name) -> bool:
        """Whether all channels of location and rotation are keyed and unmuted."""
        carrier = self._found(name)
        return all(len(moving_in(carrier, path)) == WIDTHS[path] for path in transform_paths(carrier)[:2])

    def _spaces(self, name: Name, frames: np.ndarray) -> KeySpaces | None:
        """Return the spaces of the channels on frames, from the displayed pose; None if a basis is singular."""
        carrier = self._found(name)
        (worlds,), bases = shown_worlds([carrier], frames), self._expected(name, frames)
        if np.abs(np.linalg.det(bases[:, :3, :3])).min() < 1e-3:
            return None
        axes, turns = worlds[:, :3, :3] @ np.linalg.inv(bases[:, :3, :3]), location_axes(carrier).T
        along = axes @ turns.T
        origins = worlds[:, :3, 3] - np.einsum("nij,nj->ni", along, bases[:, :3, 3])
        is_same = np.allclose(turns, np.eye(3))
        return KeySpaces(
            frames,
            AffineMaps(along, origins),
            None if is_same else np.tile(turns, (len(frames), 1, 1)),
            worlds[:, :3, 3],
            np.ones(len(frames)),
        )

    def _frames_that_stay(self, name: Name, how: str, chosen: np.ndarray, *, is_free: bool) -> np.ndarray:
        """Return the frames on which the motion must not change, whatever happens to the chosen keys (n,).

        Handles that are not free follow the keys.
        """
        carrier = self._found(name)
        keys, modes = key_frames(carrier), {mode_at(carrier, key) for key in key_frames(carrier)}
        if how == "insert":
            return self._frames_kept_by_a_key(name)
        if not is_free or DEPENDS_ON_KEYS & modes or len(self._timings(name)) > 1 or not self._is_whole(name):
            return np.empty(0)
        at = np.arange(keys[0], keys[-1], 0.5)
        behind = np.clip(np.searchsorted(keys, at, side="right"), 1, len(keys) - 1)
        return at[~chosen[behind] & ~chosen[behind - 1]]

    @while_on(
        who=shares,
        which=st.none() | st.sets(st.integers(0, 5), min_size=1),
        ease=st.sampled_from(EASES),
        turning=st.booleans(),
        between_frames=st.booleans(),
    )
    def equalise_its_speed(self, who, which, ease, turning, between_frames):
        """The first and last keys stay, and everything but the timing of the keys between them."""
        name = self._named(who)
        frames, before = None if which is None else self._chosen(name, which), self._keyed()
        refused: list[animation.Refused] = []
        done: list[animation.EvenSpeed] = []

        def change() -> None:
            timing = {"turning": turning, "between_frames": between_frames, "refused": refused}
            done.extend(animation.equalise_speed(self._found(name), ease, frames, **timing).values())

        keys = key_frames(self._found(name))
        modes, whole = [mode_at(self._found(name), key) for key in keys], self._is_whole(name)
        poses = self._expected(name, keys)
        self._edit(change)
        after, now = self._keyed(), key_frames(self._found(name))
        for other in self.names:
            assert after[other] == before[other] or (not refused and other in self._sharing(name))
        if refused:
            assert any(text in str(refused[0]) for text in NOT_EVENED), refused
            return
        assert len(now) == len(keys)
        ends = (keys <= done[0].first) | (keys >= done[0].last)
        assert np.abs(now - keys)[ends].max() < 1e-4
        assert [mode_at(self._found(name), key) for key in now] == modes
        assert_keys_at(before[name], after[name], lambda x: np.interp(x, keys, now), (1, 7, 8, 9, 12, 13))
        if whole and DEPENDS_ON_KEYS.isdisjoint(modes) and "BLENDER" not in modes:
            assert done[0].bend < 1e-4 * max(1.0, np.abs(poses).max())
