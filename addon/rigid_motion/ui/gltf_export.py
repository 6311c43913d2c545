"""*File > Export > glTF, Reduced*: exports by Blender's own glTF exporter, then reduces the keys of the file."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any, cast

import bpy
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_
from bpy_extras.io_utils import ExportHelper

from ..blender import BoolProperty, Operator, Returned, StringProperty, existing, with_properties
from ..gltf import GltfError, Options, Report, reduce_file
from .reducing import tolerance_property

EXPORTER = "export_scene.gltf"

NOT_PASSED_ON = {
    "filepath",
    "check_existing",
    "filter_glob",
    "export_format",
    "export_use_gltfpack",
    "use_selection",
    "will_save_settings",
}
"""Exporter options that this operator sets itself or that only matter in the dialog. gltfpack would resample."""


@with_properties
class RIGID_MOTION_OT_export_gltf(Operator, ExportHelper):
    bl_idname = "rigid_motion.export_gltf"
    bl_label = "Export glTF, Reduced"
    bl_description = (
        "Write a GLB file with only the keys that its animations need: nothing visible is off by more than the "
        "tolerance in any viewer. All other options are those of the last glTF 2.0 export"
    )
    bl_options = {"REGISTER"}  # noqa: RUF012 - Blender reads it

    filename_ext = ".glb"
    filter_glob: str = StringProperty(
        name="File Filter", description="Files that the dialog shows", default="*.glb", options={"HIDDEN"}
    )

    tolerance: float = tolerance_property(
        "The largest error of any vertex, and of any point close to a joint, in the world, at any time"
    )
    use_selection: bool = BoolProperty(
        name="Selected Objects", description="Export selected objects only", default=False
    )

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        if "gltf" not in dir(bpy.ops.export_scene):
            cls.poll_message_set(tip_("Enable the add-on glTF 2.0 format first"))
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> Any:
        return ExportHelper.invoke(self, context, event)

    def execute(self, context: bpy.types.Context) -> Returned:
        output = Path(cast(Any, self).filepath)
        try:
            with tempfile.TemporaryDirectory() as folder:
                exported = Path(folder) / output.name
                bpy.ops.export_scene.gltf(
                    filepath=str(exported),
                    export_format="GLB",
                    use_selection=self.use_selection,
                    **_last_options(context),
                )
                report = reduce_file(exported, output, Options(self.tolerance))
        except (GltfError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error).strip())
            return {"CANCELLED"}
        if report.left_alone:
            reason = rpt_("{name}: exported with all its keys: {reason}").format(
                name=output.name, reason=report.left_alone
            )
            self.report({"WARNING"}, reason)
        else:
            self.report({"INFO"}, _summary(report, output))
        return {"FINISHED"}


def _last_options(context: bpy.types.Context) -> dict[str, Any]:
    """Return the options last set in the dialog of Blender's exporter, except those in `NOT_PASSED_ON`."""
    last = existing(context.window_manager).operator_properties_last(EXPORTER)
    if last is None:
        return {}
    return {
        name: getattr(last, name)
        for name, result in last.bl_rna.properties.items()
        if result.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}
        and name not in NOT_PASSED_ON
        and last.is_property_set(name)
    }


def _summary(report: Report, output: Path) -> str:
    """Return one line for the status bar: keys and bytes before and after, and the largest error."""
    before, after = ([getattr(clip, when) for clip in report.clips] for when in ("before", "after"))
    return rpt_(
        "{name}: {keys} of {all_keys} keys, {size:.0f} of {full:.0f} kB of animation, {error:.2f} mm off at most"
    ).format(
        name=output.name,
        keys=sum(item.keys for item in after),
        all_keys=sum(item.keys for item in before),
        size=sum(item.size for item in after) / 1000.0,
        full=sum(item.size for item in before) / 1000.0,
        error=1000.0 * max(clip.error for clip in report.clips),
    )
