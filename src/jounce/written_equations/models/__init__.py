"""The equations of mechanisms and robots, as operations on their coordinates."""
