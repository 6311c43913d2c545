"""The programs around the extension: comparing modes on recordings, streaming, baking, the paper, benchmarks.

Each command is a module with a `main(arguments)` that returns its exit code; `cli.commands` lists them.
"""

import sys

from .places import EXTENSION

# In a checkout, the extension is in a folder of its own, which Python does not search by default.
if str(EXTENSION.parent) not in sys.path:
    sys.path.insert(1, str(EXTENSION.parent))
