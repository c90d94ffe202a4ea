"""What a simulation is handed out as, and its derivatives with respect to parameters."""
