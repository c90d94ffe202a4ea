"""Commands for robots: check, torques, smooth, retime, feedforward, servo."""
