"""Mechanism files: their keys and schema, reading, writing, and conversion."""
