"""Where a law of motion has breaks, and how smooth it is; doubts about its unit."""
