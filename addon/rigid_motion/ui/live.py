"""The panel *Live*: settings and operators that receive, record and send motion over a network."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy
from bpy.app.translations import pgettext_iface as iface_
from bpy.app.translations import pgettext_rpt as rpt_
from bpy.app.translations import pgettext_tip as tip_

from ..animation.properties import MODE_ITEMS
from ..animation.transforms import OWN_WORDS
from ..blender import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    Operator,
    PointerProperty,
    Returned,
    StringProperty,
    existing,
    scene,
    with_properties,
)
from ..live import receiving, sending
from ..live.sockets import NotAllowed
from ..streams.vmc import VMC_PORT
from .panels import Folded
from .reducing import tolerance_property
from .wording import draw_text, labelled

HOST = "127.0.0.1"


def _update_drivers(_settings: LiveSettings | LiveBone, _context: bpy.types.Context) -> None:
    if (listening := receiving.listening()) is not None and not receiving.is_matching:
        listening.choose_drivers()


@with_properties
class LiveBone(bpy.types.PropertyGroup):
    """A joint of a body, and the bone that it moves. Its name is that of the joint."""

    bone: str = StringProperty(
        name="Bone", description="The bone that this joint moves; none if empty", update=_update_drivers
    )


@with_properties
class LiveSettings(bpy.types.PropertyGroup):
    host: str = StringProperty(
        name="Address",
        description="Where to listen: 127.0.0.1 for programs on this machine only, 0.0.0.0 for others too",
        default=HOST,
    )
    port: int = IntProperty(
        name="Port", description="The UDP port that other programs send to", default=VMC_PORT, min=1024, max=65535
    )
    delay: float = FloatProperty(
        name="Delay",
        description="The lag of VMC motion: larger is smoother on an uneven network",
        default=0.05,
        min=0.0,
        max=2.0,
        precision=3,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
    )
    steady: bool = BoolProperty(
        name="Steady",
        description="Remove jitter from incoming motion with all frames, within the delay, without extra lag. "
        "Recordings stay as received: Clean Motion removes more from them",
    )
    armature: bpy.types.Object | None = PointerProperty(
        name="Rig",
        description="The armature that a body drives, by the names of its bones. Without one, it gets a new armature",
        type=bpy.types.Object,
        poll=lambda _, obj: obj.type == "ARMATURE",
        update=_update_drivers,
    )
    body: str = StringProperty(
        name="Body",
        description="Which of several bodies drives the rig. Without a name, the first to arrive",
        update=_update_drivers,
    )
    bones: bpy.types.bpy_prop_collection_idprop[LiveBone] = CollectionProperty(type=LiveBone)
    bones_of: str = StringProperty(description="The rig that the table is for", options={"HIDDEN"})
    active_bone: int = IntProperty(options={"HIDDEN"})
    mode: str = EnumProperty(
        name="Mode",
        description="The motion between the recorded keys",
        items=MODE_ITEMS,
        translation_context=OWN_WORDS,
        default="lerp_slerp",
    )
    tolerance: float = tolerance_property(
        "The largest error of any bone when a recording of VMC, which has all frames, is reduced", 0.002
    )
    to_host: str = StringProperty(name="Address", description="The machine to send VMC to", default=HOST)
    to_port: int = IntProperty(
        name="Port", description="The UDP port to send VMC to", default=VMC_PORT + 1, min=1, max=65535
    )


def live_settings(scene: bpy.types.Scene | None) -> LiveSettings:
    return getattr(scene, receiving.LIVE)


class _WithoutUndo(Operator):
    bl_options = {"REGISTER"}  # noqa: RUF012 - Blender reads it

    def open(self, start: Callable[[], object], text: str, **facts: object) -> Returned:
        """Open a port, or report why it cannot be opened, and cancel."""
        try:
            start()
        except NotAllowed as error:
            why = str(error)
        except OSError as error:
            why = text.format(**facts, why=error.strerror or error)
        else:
            return {"FINISHED"}
        self.report({"ERROR"}, why)
        return {"CANCELLED"}


class RIGID_MOTION_OT_live_listen(_WithoutUndo):
    bl_idname = "rigid_motion.live_listen"
    bl_label = "Listen"
    bl_description = "Show bodies that other programs send to this port: as new objects, or on the rig below"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return receiving.listening() is None

    def execute(self, context: bpy.types.Context) -> Returned:
        live = live_settings(context.scene)
        text = rpt_("Cannot listen to port {port} of {host}; another program may be using it: choose another ({why})")
        return self.open(lambda: receiving.start(live.host, live.port), text, port=live.port, host=live.host)


class _WhileListening:
    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return receiving.listening() is not None


class RIGID_MOTION_OT_live_stop(_WhileListening, _WithoutUndo):
    bl_idname = "rigid_motion.live_stop"
    bl_label = "Stop Listening"
    bl_description = "Close the port. Everything stays as shown; an unfinished recording is discarded"

    def execute(self, _context: bpy.types.Context) -> Returned:
        receiving.stop()
        return {"FINISHED"}


class RIGID_MOTION_OT_live_record(_WhileListening, _WithoutUndo):
    bl_idname = "rigid_motion.live_record"
    bl_label = "Record"
    bl_description = "Record incoming motion from now on, as keys from the current frame on"

    def execute(self, context: bpy.types.Context) -> Returned:
        live = live_settings(context.scene)
        existing(receiving.listening()).record(live.mode, live.tolerance)
        return {"FINISHED"}


class RIGID_MOTION_OT_live_finish(Operator):
    bl_idname = "rigid_motion.live_finish"
    bl_label = "Finish Recording"
    bl_description = "Give each recorded body an Action with its keys. Reduce Keys then makes them fewer"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        listening = receiving.listening()
        return listening is not None and listening.is_recording

    def execute(self, _context: bpy.types.Context) -> Returned:
        count = existing(receiving.listening()).finish()
        if not count:
            self.report({"WARNING"}, rpt_("Nothing arrived during the recording: no keys"))
            return {"CANCELLED"}
        self.report({"INFO"}, rpt_("{count} poses of objects and bones have keys").format(count=count))
        return {"FINISHED"}


class RIGID_MOTION_OT_live_match(_WhileListening, Operator):
    bl_idname = "rigid_motion.live_match"
    bl_label = "Match Names"
    bl_description = "Reset the table of which bone of the rig each joint moves, by their names"

    def execute(self, context: bpy.types.Context) -> Returned:
        live = live_settings(context.scene)
        if live.armature is None:
            self.report({"ERROR"}, rpt_("Choose a rig first"))
            return {"CANCELLED"}
        receiving.match_bones([item.name for item in live.bones], live.armature)
        existing(receiving.listening()).choose_drivers()
        return {"FINISHED"}


class RIGID_MOTION_OT_live_send(_WithoutUndo):
    bl_idname = "rigid_motion.live_send"
    bl_label = "Send Selected"
    bl_description = (
        "Send the selected rigs as VMC performers and all other selected objects as VMC trackers, as you see them"
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.selected_objects:
            cls.poll_message_set(tip_("Select objects or rigs first"))
        return bool(context.selected_objects) and sending.sending() is None

    def execute(self, context: bpy.types.Context) -> Returned:
        live = live_settings(context.scene)
        text, objects = rpt_("{host} is not an address to send to ({why})"), context.selected_objects
        return self.open(lambda: sending.start(live.to_host, live.to_port, objects), text, host=live.to_host)


class RIGID_MOTION_OT_live_stop_sending(_WithoutUndo):
    bl_idname = "rigid_motion.live_stop_sending"
    bl_label = "Stop Sending"
    bl_description = "Stop sending, and close the port"

    @classmethod
    def poll(cls, _context: bpy.types.Context) -> bool:
        return sending.sending() is not None

    def execute(self, _context: bpy.types.Context) -> Returned:
        sending.stop()
        return {"FINISHED"}


class RIGID_MOTION_UL_live_bones(bpy.types.UIList):
    def draw_item(
        self,
        _context: bpy.types.Context | None,
        layout: bpy.types.UILayout,
        _data: object,
        item: Any,
        _icon: int | None,
        _active: object,
        _active_property: str | None,
        _index: int | None = None,
        _filter: int | None = None,
    ) -> None:
        split = layout.split(factor=0.45)
        split.label(text=item.name, translate=False)
        rig = live_settings(scene()).armature
        if rig is not None:
            split.prop_search(item, "bone", rig.data, "bones", text="", icon="BONE_DATA")


class RIGID_MOTION_PT_live(Folded):
    bl_label = "Live"
    bl_description = "Show, record and send motion over a network, to and from other programs"
    bl_space_type = "VIEW_3D"

    def draw_header(self, _context: bpy.types.Context) -> None:
        if receiving.listening() is None:
            self.layout.operator("rigid_motion.live_listen", text="", icon="PLAY", emboss=False)
        else:
            self.layout.operator("rigid_motion.live_stop", text="", icon="PAUSE", emboss=False)

    def draw(self, context: bpy.types.Context) -> None:
        layout, live, listening = self.layout, live_settings(context.scene), receiving.listening()
        column = layout.column(align=True)
        column.enabled = listening is None
        row = column.row(align=True)
        row.prop(live, "host", text="")
        row.prop(live, "port", text="")
        column.prop(live, "delay")
        layout.prop(live, "steady")
        layout.prop(live, "armature")
        if listening is None:
            layout.operator("rigid_motion.live_listen", icon="PLAY")
        else:
            layout.operator("rigid_motion.live_stop", icon="PAUSE")
        if trouble := receiving.running.trouble if listening is None else listening.complaint:
            draw_text(context, layout, trouble, "ERROR")
        if listening is None:
            return
        joints = listening.joints
        if not joints:
            layout.label(text="Nothing comes yet", icon="INFO")
        for label, names in joints.items():
            text = iface_("{count} joints") if len(names) > 1 else iface_("rigid")
            labelled(layout, label).label(text=text.format(count=len(names)), translate=False)
        if sum(len(names) > 1 for names in joints.values()) > 1 and live.armature:
            layout.prop(live, "body")
        column = layout.column(align=True)
        column.prop(live, "mode", text="")
        column.prop(live, "tolerance")
        if listening.is_recording:
            layout.operator("rigid_motion.live_finish", icon="SNAP_FACE")
        else:
            layout.operator("rigid_motion.live_record", icon="REC")


class RIGID_MOTION_PT_live_bones(Folded):
    bl_label = "Bones"
    bl_space_type = "VIEW_3D"
    bl_parent_id = RIGID_MOTION_PT_live.__name__

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        live = live_settings(context.scene)
        return live.armature is not None and len(live.bones) > 0

    def draw(self, context: bpy.types.Context) -> None:
        live = live_settings(context.scene)
        self.layout.template_list("RIGID_MOTION_UL_live_bones", "", live, "bones", live, "active_bone")
        self.layout.operator("rigid_motion.live_match")


class RIGID_MOTION_PT_live_send(Folded):
    bl_label = "Send"
    bl_space_type = "VIEW_3D"
    bl_parent_id = RIGID_MOTION_PT_live.__name__

    def draw(self, context: bpy.types.Context) -> None:
        live = live_settings(context.scene)
        row = self.layout.row(align=True)
        row.enabled = sending.sending() is None
        row.prop(live, "to_host", text="")
        row.prop(live, "to_port", text="")
        if sending.sending() is None:
            self.layout.operator("rigid_motion.live_send", icon="EXPORT")
        else:
            self.layout.operator("rigid_motion.live_stop_sending", icon="PAUSE")


def register() -> None:
    setattr(bpy.types.Scene, receiving.LIVE, PointerProperty(type=LiveSettings))


def unregister() -> None:
    receiving.stop()
    sending.stop()
    delattr(bpy.types.Scene, receiving.LIVE)
