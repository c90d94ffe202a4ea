"""Design optimization: the search for the design with the least objective."""
