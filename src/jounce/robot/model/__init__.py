"""Links, joints and laws of a robot, and its tree."""
