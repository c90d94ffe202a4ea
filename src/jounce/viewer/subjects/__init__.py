"""What the view can show, each with its controls."""
