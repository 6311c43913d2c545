"""Robust standard streams of a command: they may be closed, full, unread, or unable to show a character.

None of these cases stops a command's work or shows a traceback.
"""

from __future__ import annotations

import errno
import io
import os
import sys
from contextlib import suppress
from typing import Any, TextIO

READER_GONE = {errno.EPIPE, errno.ECONNRESET, *([errno.EINVAL] if os.name == "nt" else [])}
"""Errors of a pipe whose reader is gone, as `head` is once it has its lines."""


class _Descriptor(io.FileIO):
    """A descriptor that accepts everything: data that cannot be written is lost, and the first error is kept."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        if self.error is None:
            try:
                return super().write(data)
            except OSError as error:
                self.error = error
        return len(data)


def prepare() -> None:
    """Set up the standard streams of this process, and of processes that it starts."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            # The stream is closed. Otherwise the next file that is opened would get its number, and all printed text.
            os.open(os.devnull, os.O_RDWR)
            if number:
                os.set_inheritable(number, True)
    sys.stdout, sys.stderr = _robust_stream(sys.stdout, 1), _robust_stream(sys.stderr, 2)


def finish(program: str, code: int) -> int:
    """Flush the streams, and return the exit code: 1 if it was 0 and output was lost.

    A reader that is gone has had enough: then there is no message.
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


def _robust_stream(stream: TextIO | None, number: int) -> TextIO:
    """Return a stream that shows every character, escaped if necessary, and never fails."""
    if stream is None:
        return _text_stream(number, encoding="utf-8")
    if not isinstance(stream, io.TextIOWrapper) or stream.fileno() != number:
        return stream
    stream.flush()
    if os.name == "nt" and stream.isatty():  # A console has an encoding of its own.
        stream.reconfigure(errors="backslashreplace")
        return stream
    return _text_stream(
        number,
        encoding=stream.encoding,
        line_buffering=stream.line_buffering,
        write_through=stream.write_through,
    )


def _text_stream(number: int, **options: Any) -> io.TextIOWrapper:
    buffer = io.BufferedWriter(_Descriptor(number, "w", closefd=False))
    return io.TextIOWrapper(buffer, errors="backslashreplace", **options)
