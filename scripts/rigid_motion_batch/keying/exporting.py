"""Exporting .blend and FBX files for `reduce.py --glb`: Blender's glTF exporter, then a reduction of the keys."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import cast

import bpy

import rigid_motion
from rigid_motion_batch.recordings import TrajectoryError
from rigid_motion_batch.recordings.fbx import ADDON as FBX_ADDON
from rigid_motion_batch.recordings.fbx import refuse_damaged
from rigid_motion_batch.recordings.importing import enabled, run_operator
from rigid_motion_batch.recordings.scene_bodies import refuse_too_large
from rigid_motion_batch.silencing import silenced

from .blend_files import missing_data, open_file
from .gltf_files import do_gltf
from .records import FileProblem, Unreadable
from .reductions import Reductions
from .work import RunningJob

GLTF_ADDON = "io_scene_gltf2"


def export_glb(path: Path) -> None:
    """Write the open file as GLB, sampled on every frame, with one clip per Action. Raises FileProblem."""
    try:
        with enabled(path, GLTF_ADDON), _listed_extension():
            run_operator(path, "export", lambda: bpy.ops.export_scene.gltf(filepath=str(path), export_format="GLB"))
    except TrajectoryError as error:
        raise FileProblem(error.problem) from None


@contextmanager
def _listed_extension() -> Iterator[None]:
    """List the extension as an add-on, so that the exporter asks it which clips to skip: differences and dense keys."""
    addons = cast(bpy.types.Preferences, bpy.context.preferences).addons
    entry = addons.new()
    entry.module = rigid_motion.__name__
    try:
        yield
    finally:
        addons.remove(entry)


def export_file(doing: RunningJob, how: Reductions) -> None:
    """Open or import a .blend or FBX file, and write its animation as GLB with few keys."""
    job = doing.job

    def export(path: Path) -> None:
        if job.file.suffix.lower() == ".fbx":
            _import_fbx(job.file)
        else:
            open_file(job.file)
            missing = missing_data()
            for library in missing.libraries:
                doing.say(library)
            doing.outcome.incomplete = missing.hides_objects
        doing.outcome.read = list(map(Path, bpy.utils.blend_paths(absolute=True)))
        export_glb(path)

    do_gltf(doing, how, export)


def _import_fbx(path: Path) -> None:
    """Import an FBX file, with meshes and images, into an empty file. Raises Unreadable."""
    try:
        refuse_too_large(path)
        refuse_damaged(path)
        with silenced():
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        with enabled(path, FBX_ADDON):
            run_operator(path, "import", lambda: bpy.ops.import_scene.fbx(filepath=str(path.absolute())))
    except TrajectoryError as error:
        raise Unreadable(error.problem) from None
    except OSError as error:
        raise Unreadable(f"this cannot be read ({error.strerror}): see to its path, and who may read it") from None
