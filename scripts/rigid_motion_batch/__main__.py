"""`python -m rigid_motion_batch COMMAND ...`, where there is no `rigid-motion` on the path."""

import sys

from .cli.commands import main

if __name__ == "__main__":
    sys.exit(main())
