"""The schema of mechanism files: keys, models, and the messages for what does not match."""
