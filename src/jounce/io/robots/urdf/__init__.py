"""URDF: links and joints, extensions of simulators, and parts that are left out."""
