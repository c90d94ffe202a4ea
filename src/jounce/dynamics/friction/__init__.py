"""Friction that follows reactions: coupled with them in known motions and in those that follow from forces."""
