"""Results of commands as JSON, and their schema."""
