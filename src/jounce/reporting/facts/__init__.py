"""What is told of each kind of result, as plain data."""
