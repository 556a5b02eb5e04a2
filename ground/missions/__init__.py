"""Mission scripts and the mission items they compile to."""
