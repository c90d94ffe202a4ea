"""Commands that write files: new, example, convert, export."""
