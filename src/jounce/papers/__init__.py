"""The papers whose methods this package implements, with their figures and tables reproduced."""
