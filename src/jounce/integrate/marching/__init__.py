"""Step after step, over jumps and bends of forces and laws."""
