"""A simulated full disk."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def disk_full_after(size: int) -> Iterator[None]:
    """Limit files to `size` bytes within the block: Blender's writing fails there, as on a full disk. Unix only."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
