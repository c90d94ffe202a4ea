"""Values of mechanism files: expressions, units, laws of motion, curves and inertias."""
