"""Elastic drives: the motion of motors for a required motion of links, and the motion of links under motor torques."""
