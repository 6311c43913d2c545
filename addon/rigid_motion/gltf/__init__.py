"""glTF files with fewer keys: what they show stays within a tolerance, in the world, of what they showed.

`documents` are files, `accessors` their numbers, `tracks` and `nodes` what moves; `rewriting` puts other tracks into a
document. NumPy and the standard library alone.
"""

from .clips import Options, ReducedClip
from .documents import Document, GltfError, read_document
from .files import Report, reduce_file, reduced

__all__ = ["Document", "GltfError", "Options", "ReducedClip", "Report", "read_document", "reduce_file", "reduced"]
