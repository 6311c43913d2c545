"""Errors that the program logs where it must not raise them, as in handlers: Blender would swallow an exception."""

import logging

import pytest


def complaints(caplog: pytest.LogCaptureFixture) -> list[str]:
    """Return the errors of a test so far, in all its phases; `caplog.records` starts again with each phase."""
    records = [record for phase in ("setup", "call", "teardown") for record in caplog.get_records(phase)]
    return [record.getMessage() for record in records if record.levelno >= logging.ERROR]
