"""The standard streams of a command, which may be closed, full, read by nobody, or unable to show a letter.

None of that keeps a command from its work, and nothing of it is a traceback.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from contextlib import suppress
from typing import Any, TextIO

READER_GONE = {errno.EPIPE, errno.ECONNRESET, *([errno.EINVAL] if os.name == "nt" else [])}
"""Errors of a pipe whose reader has gone, as `head` does when it has its lines."""


class _Descriptor(io.FileIO):
    """A descriptor that takes all there is: what cannot be written is lost, and the first error is kept."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        if self.error is None:
            try:
                return super().write(data)
            except OSError as error:
                self.error = error
        return len(data)


def prepare() -> None:
    """Set up the standard streams of this process, and of those that it starts."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # Closed. Otherwise the next file that is opened gets its number, and all that is printed.
            os.open(os.devnull, os.O_RDWR)
            if number:
                os.set_inheritable(number, True)
    sys.stdout, sys.stderr = _prepared(sys.stdout, 1), _prepared(sys.stderr, 2)


def finish(program: str, code: int) -> int:
    """Write out what is held back, and return the exit code: 1 where it was 0 and output was lost.

    Nothing is said where nobody reads any more, who has had enough.
    """
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    raw = getattr(getattr(sys.stdout, "buffer", None), "raw", None)
    error = raw.error if isinstance(raw, _Descriptor) else None
    if error is None or error.errno in READER_GONE:
        return code
    print(f"{program}: standard output: {error.strerror}; output there is lost", file=sys.stderr, flush=True)
    return code or 1


def _prepared(stream: TextIO | None, number: int) -> TextIO:
    """Return a stream that shows every letter, escaped if need be, and never fails."""
    if stream is None:
        return _text(number, encoding="utf-8")
    if not isinstance(stream, io.TextIOWrapper) or stream.fileno() != number:
        return stream
    stream.flush()
    if os.name == "nt" and stream.isatty():  # A console has letters of its own.
        stream.reconfigure(errors="backslashreplace")
        return stream
    return _text(
        number,
        encoding=stream.encoding,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _text(number: int, **options: Any) -> io.TextIOWrapper:
    buffer = io.BufferedWriter(_Descriptor(number, "w", closefd=False))
    return io.TextIOWrapper(buffer, errors="backslashreplace", **options)
