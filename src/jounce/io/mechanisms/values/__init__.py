"""Values of mechanism files: expressions, units, motion laws, curves and inertias."""
