"""Blender's operators that take a pose from the channels, with the pose that is seen in these.

Each has the key and the menus of Blender's, and steps in for it only where a selected bone is on an in-between: an
operator whose poll fails leaves its key to the next one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import bpy
import numpy as np
from bpy.app.translations import pgettext_n as n_
from bpy.app.translations import pgettext_tip as tip_

from ..animation.live.follower import show_seen_in_channels
from ..animation.queries.visible_pose import shown_components
from ..animation.transforms import Refused, Transform, transform_of
from .targets import selected

ON_NO_IN_BETWEEN = n_("No selected bone is on an in-between: Blender's own operator does the same")

SAME = 1e-6
"""Components that differ by less are the same."""


def is_elsewhere(transform: Transform) -> bool:
    """Return whether something is seen elsewhere than its channels have it."""
    try:
        seen = shown_components(transform)
    except Refused:
        return False
    return seen is not None and not np.allclose(seen, transform.components(), rtol=SAME, atol=SAME)


class _OfSeenPose:
    """An operator of Blender's that reads the channels of the selected bones."""

    bl_options: ClassVar[set[str]] = {"REGISTER"}
    blender: ClassVar[Callable[[str], set[str]]]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode == "POSE" and any(map(is_elsewhere, map(transform_of, selected(context)))):
            return True
        cls.poll_message_set(tip_(ON_NO_IN_BETWEEN))
        return False

    def invoke(self, context: bpy.types.Context, _event: bpy.types.Event) -> set[str]:
        return self._call(context, "INVOKE_DEFAULT")

    def execute(self, context: bpy.types.Context) -> set[str]:
        return self._call(context, "EXEC_DEFAULT")

    def _call(self, context: bpy.types.Context, how: str) -> set[str]:
        show_seen_in_channels(map(transform_of, selected(context)))
        # A dialog that asks for more goes on by itself.
        return self.blender(how) & {"CANCELLED"} or {"FINISHED"}


class RIGID_MOTION_OT_copy_pose(_OfSeenPose, bpy.types.Operator):
    bl_idname = "rigid_motion.copy_pose"
    bl_label = "Copy Pose on Screen"
    bl_description = (
        "Copy the pose of the selected bones as you see it, with the in-betweens. "
        "Until the frame changes their channels have it, too"
    )

    blender = bpy.ops.pose.copy


class RIGID_MOTION_OT_create_pose_asset(_OfSeenPose, bpy.types.Operator):
    bl_idname = "rigid_motion.create_pose_asset"
    bl_label = "Create Pose Asset on Screen"
    bl_description = (
        "Create a pose asset of the selected bones as you see them, with the in-betweens. "
        "Until the frame changes their channels have that pose, too"
    )

    blender = bpy.ops.poselib.create_pose_asset


CLASSES = (RIGID_MOTION_OT_copy_pose, RIGID_MOTION_OT_create_pose_asset)
