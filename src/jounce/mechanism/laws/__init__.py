"""Laws of drivers and cams that depend on time, on a coordinate or on an output."""
