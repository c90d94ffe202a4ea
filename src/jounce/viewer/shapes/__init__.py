"""Shapes of bodies, joints and links, their appearance, and recorded motions."""
