"""Rooms are imported when something of them is first used, by one thread at a time."""

import threading

lock = threading.RLock()
"""Held while rooms are imported within functions: threads that import several at once may get each other's half."""
