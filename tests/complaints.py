"""What the program logs as an error where it must not raise one, as in handlers: Blender would swallow it."""

import logging

import pytest


def complaints(caplog: pytest.LogCaptureFixture) -> list[str]:
    """The errors of a test so far, in all its phases; `caplog.records` begins anew with each of them."""
    records = [record for phase in ("setup", "call", "teardown") for record in caplog.get_records(phase)]
    return [record.getMessage() for record in records if record.levelno >= logging.ERROR]
