"""glTF files with fewer keys: the animation stays within a tolerance of the original, measured in world space.

`documents` reads and writes files, `accessors` their numbers. `tracks` and `nodes` describe the animation. `rewriting`
replaces the tracks of a document. Depends on NumPy and the standard library only.
"""

from .clips import Options, ReducedClip
from .documents import Document, GltfError, read_document
from .files import Report, reduce_file, reduced

__all__ = ["Document", "GltfError", "Options", "ReducedClip", "Report", "read_document", "reduce_file", "reduced"]
