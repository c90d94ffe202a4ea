"""Charts: curves over time, bands, limits, phase portraits, cams."""
