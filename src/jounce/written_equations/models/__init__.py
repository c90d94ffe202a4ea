"""What is written: the equations of mechanisms and of robots, as operations on their coordinates."""
