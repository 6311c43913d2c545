"""Fixtures for tests in Blender, as a pytest plugin: it imports `bpy` first, since `mathutils` comes with it."""

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
"""The exit status of the session."""


@pytest.hookimpl(wrapper=True)
def pytest_sessionfinish(session: pytest.Session):
    result = yield
    session.config.stash[STATUS] = int(session.exitstatus)
    return result


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Exit without shutting down Blender 4.5's module, which can hang forever after the last test."""
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
    """A new file with the extension registered, as if Blender had enabled it."""
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
    """The zip that users install, built from this checkout."""
    return build(tmp_path_factory.mktemp("dist"))
