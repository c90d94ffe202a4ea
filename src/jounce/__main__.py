"""``python -m jounce`` is the command ``jounce``, which imports nothing from the folder that it runs in."""

import sys
from pathlib import Path

if __name__ == "__main__":
    if not sys.flags.safe_path and sys.path[:1] == [str(Path.cwd())]:
        del sys.path[0]
    from jounce.cli import main

    sys.exit(main())
