"""URDF: links and joints, extensions of simulators, and what is left out."""
