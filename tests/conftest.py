"""Blender in the test process: `bpy` first, since `mathutils` comes with it; an empty file and the zip for who asks."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import bpy
import pytest

from scripts.build_extension import build
from tests.recordings import RECORDINGS

EVERY_TEST = "RIGID_MOTION_EVERY_TEST"

STATUS = pytest.StashKey[int]()
"""How the session ended."""


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """Blender 4.5's module can wait forever while it is taken down, long after the last test: leave without that."""
    status = config.stash.get(STATUS, None)
    if bpy.app.version < (5, 0) and status is not None:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


def pytest_configure(config: pytest.Config) -> None:
    """A shell lets what it runs in the background ignore Ctrl-C, and all that is started from there."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    session.config.stash[STATUS] = int(exitstatus)


def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.get_closest_marker("recordings") and not RECORDINGS.is_dir():
        pytest.skip("the recordings are not beside the checkout")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item: pytest.Item):
    """Where every test has to run, as in continuous integration, one that was skipped has failed.

    But for those that need recordings, which a checkout need not have beside it.
    """
    report = yield
    excused = hasattr(report, "wasxfail") or item.get_closest_marker("recordings")
    if report.skipped and not excused and os.environ.get(EVERY_TEST):
        report.outcome = "failed"
        report.longrepr = f"skipped, which {EVERY_TEST} forbids: {report.longrepr}"
    return report


@pytest.fixture
def empty_file() -> bpy.types.Context:
    """A new file without objects, at factory settings."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy.context


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What users install, built from this checkout."""
    return build(tmp_path_factory.mktemp("dist"))
