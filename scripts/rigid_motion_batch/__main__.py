"""The command `python -m rigid_motion_batch COMMAND ...`, for systems without `rigid-motion` on the path."""

import sys

from .cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
