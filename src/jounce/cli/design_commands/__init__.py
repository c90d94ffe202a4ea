"""Commands for many designs: optimize, sweep, tolerance."""
