"""Forces, torques and reactions as outputs."""
