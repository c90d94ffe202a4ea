"""Files of mechanisms: their keys and schema, how they are read, written, and converted."""
