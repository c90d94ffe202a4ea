"""What a person is told of mechanisms, motions and robots: facts, and how a terminal, a notebook and JSON show them."""
