"""Forces that a given motion needs: of drivers and joints, with their rates."""
