"""``python -m jounce`` is the command ``jounce``, which imports nothing from the folder that it runs in."""

import contextlib
import sys
from pathlib import Path

if __name__ == "__main__":
    with contextlib.suppress(OSError):  # a folder that was removed meanwhile has no name
        if not sys.flags.safe_path and sys.path[:1] == [str(Path.cwd())]:
            del sys.path[0]
    from jounce.cli import main

    sys.exit(main())
