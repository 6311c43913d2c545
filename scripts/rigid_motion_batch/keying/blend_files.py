"""Opening .blend files without running what is in them, what they lack of libraries, and saving them whole."""

from __future__ import annotations

import os
import shutil
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

import bpy

from rigid_motion_batch.command_line import listed
from rigid_motion_batch.files import written_beside
from rigid_motion_batch.saving import save_copy
from rigid_motion_batch.silencing import silenced

from .records import FileProblem, InputRecord, Unreadable, changed_at, not_written

THIS_VERSION = bpy.app.version[:2]
"""The Blender that this runs in."""

MAGIC = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
"""The bytes that .blend files begin with: as they are, compressed, and compressed by a Blender before 3.0."""

MAX_NAMED_DATA = 5
"""As many of the data that are missing from a library are named."""

MAY_HOLD_OBJECTS = (bpy.types.Collection, bpy.types.Scene)


@dataclass
class Missing:
    """What the open file wants of libraries and cannot have."""

    libraries: list[str] = field(default_factory=list)
    """For each library that something is missing from: which, what, and the way out."""

    reasons: dict[bpy.types.Object, str] = field(default_factory=dict)
    """Objects of which one cannot know whether rigid motion moves them, for they or their Actions are missing."""

    hides_objects: bool = False
    """True if there may be more of those, in collections or scenes that are missing."""


def open_file(path: Path) -> None:
    """Open a .blend file, without running anything that is in it. Raises `Unreadable`."""
    if os.path.exists(path) and not os.path.isfile(path):
        raise Unreadable("this is not a file on a disk: save it as one first")
    try:
        with silenced(errors=True):
            bpy.ops.wm.open_mainfile(filepath=str(path.absolute()), load_ui=True, use_scripts=False)
    except RuntimeError as error:
        said = " ".join(str(error).split()).removeprefix("Error: ")
        reason = said.rpartition(": ")[2]
        if "Cannot read file" in said:
            raise Unreadable(f"this cannot be opened ({reason}): see to its path, and who may read it") from None
        if "not supported" in said:
            with path.open("rb") as stream:
                begin = stream.read(max(map(len, MAGIC)))
            if not begin.startswith(MAGIC):
                raise Unreadable(f"this is not a .blend file{'' if begin else ', it is empty'}") from None
            reason = "cut off, or scrambled behind its first bytes"
        raise Unreadable(
            f"Blender cannot read this file, which looks damaged ({reason}): take a copy of it, or its NAME.blend1"
        ) from None
    if (newer := cast(Any, bpy.data.version)[:2]) > THIS_VERSION:
        # Blender opens it all the same, and would leave out on saving what it does not know.
        raise Unreadable(
            f"this was saved by Blender {named(newer)}, and this is {named(THIS_VERSION)}: take that one or a later one"
        )


def missing_data() -> Missing:
    """Return what the open file wants of libraries and cannot have,
    which Blender puts nothing but names in the place of.
    """
    result = Missing()
    for library in bpy.data.libraries:
        blocks = [block for block in library.users_id if block.is_missing]
        if not blocks:
            continue
        path = os.path.normpath(bpy.path.abspath(library.filepath))
        is_there = os.path.exists(path)
        missing = listed(
            (f"{cast(bpy.types.Struct, block.bl_rna).name} {block.name}" for block in blocks), MAX_NAMED_DATA
        )
        result.libraries.append(
            f"library {path} {'cannot be read, or lacks something' if is_there else 'was not found'} "
            f"({missing}): "
            f"bring {'that' if is_there else 'it'} back, or tell the file where it is now (Outliner, Blender File, "
            "right-click: Relocate)"
        )
        result.reasons |= _reasons(blocks, path)
        result.hides_objects |= any(isinstance(block, MAY_HOLD_OBJECTS) for block in blocks)
    return result


def _reasons(blocks: list[bpy.types.ID], path: str) -> dict[bpy.types.Object, str]:
    """Return why these objects cannot be known, of which something is among what is missing from a library."""
    reasons = {block: f"it is missing from {path}" for block in blocks if isinstance(block, bpy.types.Object)}
    for obj in bpy.data.objects:
        if obj.override_library is not None and obj.override_library.reference in blocks:
            # What is changed would not be saved as a change, without that to compare it with.
            reasons[obj] = f"what it overrides is missing from {path}"
    actions = [block for block in blocks if isinstance(block, bpy.types.Action)]
    if actions:
        for action, users in bpy.data.user_map(subset=actions, value_types={"OBJECT"}).items():
            for user in users:
                if isinstance(user, bpy.types.Object):
                    reasons.setdefault(user, f"its Action {action.name} is missing from {path}")
    return reasons


def only_overridden() -> set[bpy.types.Object]:
    """Return the linked objects that are in the open file for the sake of overrides of them,
    and are not shown themselves.
    """
    overrides = [obj.override_library for obj in bpy.data.objects if obj.override_library is not None]
    references = (override.reference for override in overrides)
    linked = {reference for reference in references if isinstance(reference, bpy.types.Object)}
    instanced = {obj.instance_collection for obj in bpy.data.objects if obj.instance_collection is not None}
    for shown in (*(scene.collection for scene in bpy.data.scenes), *instanced):
        linked.difference_update(shown.all_objects)
    return linked


def write_file(output: Path, record: InputRecord | None, opened: int | None = None) -> None:
    """Save what is open, whole or not at all; in place of its file, which is kept as NAME.blend1, without a record.

    Parameters
    ----------
    output : Path
    record : Record, optional
    opened : int, optional
        When the file was changed last before it was opened, in nanoseconds, where it is to be replaced.

    Raises
    ------
    FileProblem
        Where it cannot be written, or was changed meanwhile.
    """
    try:
        with silenced(errors=True), record.writing(output) if record else written_beside(output) as beside:
            save_copy(beside, relative_remap=True)
            if not record:
                if changed_at(output) != opened:
                    raise FileProblem("it was changed while this program was at it, and stays so: do it again")
                kept = Path(os.path.realpath(output))
                with written_beside(kept.with_name(f"{kept.name}1")) as copy:
                    shutil.copy2(output, copy)
    except OSError as error:
        raise not_written(error.filename or output, error.strerror or error) from None


def named(version: tuple[int, ...]) -> str:
    """Return a version of Blender as people write it."""
    return ".".join(map(str, version))
