"""Blender's own words, kept off the streams: it writes of every file and frame, by Python and by C."""

from __future__ import annotations

import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout

OUTPUT_DESCRIPTOR, ERRORS_DESCRIPTOR = 1, 2
"""The descriptors of the standard streams."""


@contextmanager
def silenced(*, errors: bool = False) -> Iterator[None]:
    """Keep what is written meanwhile off the standard output, and off the standard error where `errors` is set.

    Otherwise that stays open: where Blender has to abort, its last words are there.
    """
    _flush()
    streams = (OUTPUT_DESCRIPTOR, ERRORS_DESCRIPTOR) if errors else (OUTPUT_DESCRIPTOR,)
    kept = {stream: os.dup(stream) for stream in streams}
    nothing = os.open(os.devnull, os.O_WRONLY)
    try:
        with ExitStack() as redirected:
            for stream in streams:
                os.dup2(nothing, stream)
            redirected.enter_context(redirect_stdout(io.StringIO()))
            if errors:
                redirected.enter_context(redirect_stderr(io.StringIO()))
            yield
    finally:
        _flush()
        for stream, descriptor in kept.items():
            os.dup2(descriptor, stream)
            os.close(descriptor)
        os.close(nothing)


def _flush() -> None:
    """Write out what Python and C have been holding back."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # A windowed Python has none.
            stream.flush()
    (ctypes.CDLL("ucrtbase") if os.name == "nt" else ctypes.CDLL(None)).fflush(None)
