"""What tests in Blender share: `bpy` is imported first, since `mathutils` comes with it. A plugin of pytest."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

import rigid_motion
from rigid_motion_batch.cli.build_extension import build
from tests.blank import blank
from tests.rigs import human as rigify

STATUS = pytest.StashKey[int]()
"""How the session ended."""


@pytest.hookimpl(wrapper=True)
def pytest_sessionfinish(session: pytest.Session):
    result = yield
    session.config.stash[STATUS] = int(session.exitstatus)
    return result


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Leave without taking Blender 4.5's module down, which can wait forever long after the last test."""
    status = config.stash.get(STATUS, None)
    if bpy.app.version < (5, 0) and status is not None:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


@pytest.fixture
def empty_file() -> bpy.types.Context:
    """A new file without objects, at factory settings."""
    return blank()


@pytest.fixture
def extension(empty_file: bpy.types.Context) -> Iterator[bpy.types.Context]:
    """A new file, and the extension as it is when Blender has switched it on."""
    rigid_motion.register()
    try:
        yield empty_file
    finally:
        rigid_motion.unregister()


@pytest.fixture
def human(empty_file: bpy.types.Context) -> bpy.types.Object:
    """Rigify's human in a new file."""
    try:
        return rigify.human()
    except rigify.NoRigify as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What users install, built from this checkout."""
    return build(tmp_path_factory.mktemp("dist"))
