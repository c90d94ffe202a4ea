"""Motion laws through samples."""
