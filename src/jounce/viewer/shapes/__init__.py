"""Shapes of bodies, joints and links, how they look, and where they are recorded."""
