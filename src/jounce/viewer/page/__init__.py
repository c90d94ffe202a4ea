"""The page: its scene, panels, plots and legends, and the address that serves it."""
