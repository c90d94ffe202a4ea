"""Links, joints and joint laws of a robot, and its tree."""
