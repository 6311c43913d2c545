"""Opening .blend files without running their scripts, finding missing library data, and saving files completely."""

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
"""The version (major, minor) of the running Blender."""

MAGIC = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
"""The first bytes of .blend files: uncompressed, compressed, and compressed by a Blender before 3.0."""

MAX_NAMED_DATA = 5
"""How many of the data-blocks missing from a library are named."""

MAY_HOLD_OBJECTS = (bpy.types.Collection, bpy.types.Scene)


@dataclass
class Missing:
    """The library data that the open file lacks."""

    libraries: list[str] = field(default_factory=list)
    """For each library with missing data: a message with the library, the data-blocks, and what the user can do."""

    reasons: dict[bpy.types.Object, str] = field(default_factory=dict)
    """Objects whose motion is unknown because they or their Actions are missing, with the reason."""

    hides_objects: bool = False
    """True if collections or scenes are missing that may hold more such objects."""


def open_file(path: Path) -> None:
    """Open a .blend file without running its scripts. Raises `Unreadable`."""
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
        # Blender opens it anyway, but on saving it would drop the data that it does not know.
        raise Unreadable(
            f"this was saved by Blender {named(newer)}, and this is {named(THIS_VERSION)}: take that one or a later one"
        )


def missing_data() -> Missing:
    """Return the library data that the open file lacks; Blender keeps only placeholders with their names."""
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
    """Return the objects that depend on data missing from a library, with the reasons."""
    reasons = {block: f"it is missing from {path}" for block in blocks if isinstance(block, bpy.types.Object)}
    for obj in bpy.data.objects:
        if obj.override_library is not None and obj.override_library.reference in blocks:
            # Without the original to compare with, Blender would not save the changes of the override.
            reasons[obj] = f"what it overrides is missing from {path}"
    actions = [block for block in blocks if isinstance(block, bpy.types.Action)]
    if actions:
        for action, users in bpy.data.user_map(subset=actions, value_types={"OBJECT"}).items():
            for user in users:
                if isinstance(user, bpy.types.Object):
                    reasons.setdefault(user, f"its Action {action.name} is missing from {path}")
    return reasons


def only_overridden() -> set[bpy.types.Object]:
    """Return the linked objects that the open file holds only as sources of overrides, and does not show."""
    overrides = [obj.override_library for obj in bpy.data.objects if obj.override_library is not None]
    references = (override.reference for override in overrides)
    linked = {reference for reference in references if isinstance(reference, bpy.types.Object)}
    instanced = {obj.instance_collection for obj in bpy.data.objects if obj.instance_collection is not None}
    for shown in (*(scene.collection for scene in bpy.data.scenes), *instanced):
        linked.difference_update(shown.all_objects)
    return linked


def write_file(output: Path, record: InputRecord | None, opened: int | None = None) -> None:
    """Save the open file, completely or not at all; without a record in its own place, with a copy as NAME.blend1.

    Parameters
    ----------
    output : Path
    record : InputRecord, optional
    opened : int, optional
        When the file was last changed before it was opened, in nanoseconds, if it is to be replaced.

    Raises
    ------
    FileProblem
        If the file cannot be written, or has been changed since.
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
    """Return a version of Blender as text."""
    return ".".join(map(str, version))
