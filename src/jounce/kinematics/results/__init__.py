"""What a solution is handed out as."""
