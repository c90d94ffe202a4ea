"""The schema of mechanism files: keys, models, and messages for errors."""
