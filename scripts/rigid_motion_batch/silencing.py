"""Silencing of Blender's messages: it prints lines for every file and frame, from Python and from C."""

from __future__ import annotations

import ctypes
import io
import os
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout

OUTPUT_DESCRIPTOR, ERRORS_DESCRIPTOR = 1, 2
"""The file descriptors of the standard streams."""


@contextmanager
def silenced(*, errors: bool = False) -> Iterator[None]:
    """Discard output to standard output within the block, and to standard error if `errors` is set.

    Standard error stays open by default: if Blender aborts, its last message is there.
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
    """Write out the buffers of Python and of C."""
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # A windowed Python has no streams.
            stream.flush()
    (ctypes.CDLL("ucrtbase") if os.name == "nt" else ctypes.CDLL(None)).fflush(None)
