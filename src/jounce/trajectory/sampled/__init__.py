"""Laws of motion through samples."""
