"""Facts about a mechanism: freedom, gears, ropes and belts, ranges."""
