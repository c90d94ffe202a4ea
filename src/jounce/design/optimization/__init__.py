"""The search for the design with the least objective."""
