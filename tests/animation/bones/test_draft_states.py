"""Whatever is edited of rigs in a window, in drafts that are finished in between, bones move as their keys say."""

from __future__ import annotations

from pathlib import Path

import bpy
from hypothesis import settings
from hypothesis.stateful import rule

from rigid_motion.animation.live import follower
from rigid_motion.animation.writers import drafts
from tests.animation.bones.test_bone_states import EditingBones
from tests.animation.editing import frames_in
from tests.thoroughness import THOROUGH


class EditingBonesInAWindow(EditingBones):
    """The same animator, to whose rigs Blender gives a window. All of them are large."""

    def __init__(self) -> None:
        super().__init__()
        self.large, drafts.LARGE = drafts.LARGE, 0
        follower.set_drafts(True)

    def teardown(self) -> None:
        drafts.LARGE = self.large
        super().teardown()

    @rule(frame=frames_in)
    def look_between_frames(self, frame):
        before = bpy.context.scene.frame_current
        bpy.context.scene.frame_set(int((frame + self.shift) // 1), subframe=0.5)
        self._assert_finished()
        bpy.context.scene.frame_set(before)

    @rule()
    def save(self):
        bpy.ops.wm.save_as_mainfile(filepath=str(Path(self.folder.name) / "scene.blend"), compress=False)
        self._assert_finished()

    def _assert_finished(self) -> None:
        assert not self.on or not any(action.rigid_motion.is_draft for action in bpy.data.actions)

    def switch_the_extension_on(self):
        super().switch_the_extension_on()
        follower.set_drafts(True)


EditingBonesInAWindow.TestCase.settings = settings(
    EditingBones.TestCase.settings, max_examples=20 if THOROUGH else 4, stateful_step_count=30
)
TestBoneEditsInAWindow = EditingBonesInAWindow.TestCase
