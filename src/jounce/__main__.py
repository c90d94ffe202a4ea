"""The command ``jounce`` as ``python -m jounce``, without imports from the current folder."""

import contextlib
import sys
from pathlib import Path

if __name__ == "__main__":
    with contextlib.suppress(OSError):  # the current folder may have been removed
        if not sys.flags.safe_path and sys.path[:1] == [str(Path.cwd())]:
            del sys.path[0]
    from jounce.cli import main

    sys.exit(main())
