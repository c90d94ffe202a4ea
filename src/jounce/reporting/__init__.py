"""Reports of mechanisms, motions and robots: facts, and how a terminal, a notebook and JSON show them."""
