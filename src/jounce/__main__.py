"""``python -m jounce`` is the command ``jounce``."""

import sys

from jounce.cli import main

if __name__ == "__main__":
    sys.exit(main())
