"""Many designs of one mechanism, solved side by side."""
