"""Commands that make files: new, example, convert, export."""
